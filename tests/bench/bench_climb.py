"""Speed of the choice of a model, beside whole fits of every level; run by hand.

``pytest tests/bench/bench_climb.py --benchmark-only``, one thread. Aim: the climb costs less than
one fit of the model that it finds.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve

from calib.geometry.parameters import parameters_of
from calib.identification.climb import climb
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.evidence.shared_misfit import SharedMisfit
from calib.identification.evidence.spring_products import settled
from calib.identification.folds import parts_of
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.levels import asked_of
from calib.identification.many.climb import climb_many
from calib.identification.many.single import identify_many
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import weak_prior
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.studies import load_scenario
from testbed.studies.coverage.visits import measure_robots, poses_of
from testbed.studies.trial.play import criterion_of, select
from tests.calib.identification.test_climb import mapped
from tests.calib.identification.test_joint_models import seen
from tests.reference import tx60

POSES, ROBOTS = 100, 25
PARAMETERS = parameters_of(tx60())
PRIOR = weak_prior(PARAMETERS)


@pytest.fixture(scope="module")
def table():
    """Poses of a robot whose joints turn beside their commands by fast waves."""
    return seen(mapped(1, size=4.0), POSES, 2)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_climb_about_one_linear_system(benchmark, table):
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    part = np.arange(POSES) % 4
    benchmark(climb, tx60(), near, table, PARAMETERS, ladders_of(tx60()), part, prior=PRIOR)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_choice_with_both_fits(benchmark, table):
    benchmark(choose, tx60(), table)


@pytest.mark.benchmark(group="choice of a model, 100 poses")
def test_whole_fits_of_every_level_and_fold(benchmark, table):
    """One round of a climb by brute force: each level from all poses, the best in four folds."""
    levels = [level for ladder in ladders_of(tx60()) for level in ladder.levels[1:]]
    rests = [table.rows(np.arange(POSES) % 4 != k) for k in range(4)]

    def whole():
        found = [extended_by(tx60(), table, PARAMETERS, [one], prior=PRIOR)[1] for one in levels]
        best = levels[int(np.argmax([each.log_evidence for each in found]))]
        return [extended_by(tx60(), rest, PARAMETERS, [best], prior=PRIOR) for rest in rests]

    benchmark.pedantic(whole, rounds=2)


@pytest.fixture(scope="module")
def thrice(table):
    """The richest model of all ladders, and its equations for three visits of each pose."""
    rng = np.random.default_rng(0)
    rows = table.rows(np.repeat(np.arange(POSES), 3))
    moved = rows.position + 1e-5 * rng.normal(size=rows.position.shape)
    rows = replace(rows, position=moved, repeat=np.tile(np.arange(3), POSES))
    near = identify(tx60(), rows, PARAMETERS, prior=PRIOR).model
    ladders = ladders_of(tx60())
    every = [level.errors for ladder in ladders for level in ladder.levels]
    system = normal_equations(tx60(), near, rows, PARAMETERS, every, PRIOR)
    return SharedMisfit.of(system, rows), asked_of(tuple(k.levels[-1] for k in ladders))


VARIANCES = np.geomspace(0.1, 10, 12)
"""As many as a search looks at."""


@pytest.mark.benchmark(group="evidence of 12 misfits, 429 numbers and 384 products")
def test_columns_of_the_model_taken_out_once(benchmark, thrice):
    """Aim: half the time of the plain form."""
    shared, asked = thrice

    def search():
        model = shared.of_model(asked)
        return [model.solved_at(v, 1.0).evidence for v in VARIANCES]

    benchmark.pedantic(search, rounds=5, warmup_rounds=1)


@pytest.mark.benchmark(group="evidence of 12 misfits, 429 numbers and 384 products")
def test_columns_of_all_models_for_each_variance(benchmark, thrice):
    """With products that no row sees, and inv(H) C written out."""
    shared, (errors, sd, mean) = thrice

    def one(v):
        system, k = shared.at(v), len(errors.terms)
        model, springs = system.of_model(errors, sd, mean), system.products.of(errors, sd[k:])
        linear = model.columns[: len(model.size)]
        N = system.normal
        H = N[np.ix_(linear, linear)] * (model.size[:, None] * model.size) + model.precision
        C = N[np.ix_(linear, springs.columns)] * model.size[:, None]
        own = N[np.ix_(springs.columns, springs.columns)] - C.T @ cho_solve(cho_factor(H), C)
        force = model.size * system.pull[linear] - model.precision @ model.away
        pull = system.pull[springs.columns] - C.T @ np.linalg.solve(H, force)
        return settled(springs, own, pull).loss

    benchmark.pedantic(lambda: [one(v) for v in VARIANCES], rounds=3, warmup_rounds=1)


@pytest.fixture(scope="module", params=["rigid", "unmodelled"])
def robots(request):
    """Rows of robots at the 29 poses of the coverage scene, and fits of their geometry."""
    scenario = load_scenario("coverage")
    bench = open_laboratory(scenario, make_setting(scenario))
    random, trial = np.random.default_rng(1), scenario.trial[0]
    criterion = criterion_of(bench, trial)
    chosen = select(bench.design_blocks(trial.rows), trial, random, criterion).indices
    poses = [poses_of(bench, k) for k in range(ROBOTS)]
    seen = [o.seen for o in measure_robots(bench, request.param, chosen, range(ROBOTS), poses)]
    nominal, free = bench.setting.nominal, bench.free("whitened")
    prior = weak_prior(free, nominal)
    near = [one.model for one in identify_many(nominal, seen, free, prior=prior)]
    return nominal, near, seen, free, bench.ladders, prior


@pytest.mark.benchmark(group="climbs of robots at 29 poses")
def test_25_robots_one_by_one(benchmark, robots):
    nominal, near, seen, free, ladders, prior = robots
    part = parts_of(seen[0], np.random.default_rng(0))

    def each():
        for model, table in zip(near, seen, strict=True):
            climb(nominal, model, table, free, ladders, part, prior=prior)

    benchmark.pedantic(each, rounds=2)


@pytest.mark.benchmark(group="climbs of robots at 29 poses")
def test_25_robots_together(benchmark, robots):
    """Aim: five times as fast."""
    nominal, near, seen, free, ladders, prior = robots
    benchmark.pedantic(climb_many, (nominal, near, seen, free, ladders), {"prior": prior}, rounds=3)
