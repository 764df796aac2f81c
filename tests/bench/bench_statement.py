"""Speed of the believed statement, beside dense likelihoods and refits; run by hand.

``pytest tests/bench/bench_statement.py --benchmark-only``, one thread. Aim: a whole judgement of 60
poses within 0.1 s, less than the identification before it.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.observations import joined
from calib.uncertainty.drift.memory import memory_p
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.many.judgements import judge_many
from calib.uncertainty.statement.evidence import position_rows
from calib.uncertainty.statement.likelihood import likelihood
from calib.uncertainty.statement.shape import misfit_shape
from tests.calib import kinds
from tests.calib.uncertainty.statement.test_misfit import dense_likelihood

TX60 = RobotModel(kinds.ARMS["tx60"])
M, N = 40, 20


@pytest.fixture(scope="module")
def campaign():
    """An identification with its tables."""
    rng = np.random.default_rng(1)
    table = kinds.poses(TX60, kinds.joints("tx60", rng, M + N), rng)
    train, held_out = table.rows(np.arange(M)), table.rows(np.arange(M, M + N))
    held_out = replace(held_out, pose_id=M + np.arange(N))
    return identify(TX60, train, parameters_of(TX60)), train, held_out


@pytest.mark.benchmark(group="statement")
def test_identification_of_40_poses(benchmark, campaign):
    train = campaign[1]
    benchmark(identify, TX60, train, parameters_of(TX60))


@pytest.mark.benchmark(group="statement")
def test_judgement_of_40_and_20_poses(benchmark, campaign):
    fit, train, held_out = campaign
    known = Circumstances(order=(np.arange(M), M + np.arange(N)), repeatability=np.full(6, 15e-6))
    benchmark(judge, fit, held_out, train=train, circumstances=known)


@pytest.mark.benchmark(group="evidence of a misfit, 60 poses")
def test_likelihood_of_all_sizes_turned_once(benchmark, campaign):
    fit, train, held_out = campaign
    table = joined([train, held_out])
    shape = misfit_shape(fit.model, table)

    def ours():
        rows = position_rows(fit.model, fit.parameters, table, shape, np.ones(len(table)))
        return likelihood(rows, rows.noise_sd, None)

    benchmark(ours)


@pytest.mark.benchmark(group="evidence of a misfit, 60 poses")
def test_likelihood_of_ten_sizes_with_dense_matrices(benchmark, campaign):
    fit, train, held_out = campaign
    table = joined([train, held_out])
    shape = misfit_shape(fit.model, table)
    sizes = np.geomspace(0.03, 10, 10)
    benchmark(lambda: [dense_likelihood(fit, table, shape, kinds.NOISE, s, 1.0) for s in sizes])


@pytest.mark.benchmark(group="memory of 60 rows")
def test_permutations_by_lags(benchmark):
    rng = np.random.default_rng(2)
    residual = rng.normal(size=(60, 3))
    benchmark(memory_p, residual, np.arange(60), rng)


@pytest.mark.benchmark(group="memory of 60 rows")
def test_permutations_by_matrices(benchmark):
    rng = np.random.default_rng(2)
    residual, apart = rng.normal(size=(60, 3)), np.abs(np.subtract.outer(*[np.arange(60)] * 2))
    kernel = np.where(apart > 0, np.exp(-apart / 8), 0.0)

    def plain():
        orders = (rng.permutation(60) for _ in range(500))
        return [float((kernel * (residual[k] @ residual[k].T)).sum()) for k in orders]

    benchmark(plain)


@pytest.fixture(scope="module")
def robots():
    """Twenty-five robots alike, each with its tables and 100 targets."""
    found = []
    for k in range(25):
        rng = np.random.default_rng(100 + k)
        table = kinds.poses(TX60, kinds.joints("tx60", rng, M + N), rng)
        train, held_out = table.rows(np.arange(M)), table.rows(np.arange(M, M + N))
        fit = identify(TX60, train, parameters_of(TX60))
        found.append((fit, train, held_out, kinds.joints("tx60", rng, 100)))
    return found


@pytest.mark.benchmark(group="judgements of 25 robots, 40 and 20 poses")
def test_judgements_over_the_robot_axis(benchmark, robots):
    fits, trains, tests, targets = zip(*robots, strict=True)
    benchmark(judge_many, fits, trains, tests, targets)


@pytest.mark.benchmark(group="judgements of 25 robots, 40 and 20 poses")
def test_judgements_one_by_one(benchmark, robots):
    """Aim: five times the arrays' time."""
    known = Circumstances(order=(np.arange(M), M + np.arange(N)))

    def each():
        for fit, train, held_out, q in robots:
            belief = judge(fit, held_out, train=train, circumstances=known).belief
            belief.regions(q)

    benchmark(each)
