"""The climb over ladders of joint errors: against whole fits, written-out folds and true maps."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climb import best_alone, climb
from calib.identification.climbing import ASKED
from calib.identification.evidence.normal_equations import NormalEquations, normal_equations
from calib.identification.identify import Status, identify
from calib.identification.ladders import MAP_ORDERS, ladders_of
from calib.identification.levels import prior_of, with_errors
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import weak_prior
from calib.measurement.tables import poses as poses_of
from tests.calib.identification.test_joint_models import GOALS, POOL, bent, seen
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, rigid_truth, tx60
from tests.truth.measuring import measured

MDEG = 1e-3 * DEG
PARAMETERS = parameters_of(tx60())
PRIOR = weak_prior(PARAMETERS)


def mapped(seed: int, size: float = 2.0) -> RobotModel:
    """A robot whose joints turn beside their commands by 10 to 30 waves, `size` mdeg each."""
    rng = np.random.default_rng([seed, 5])
    terms = harmonic_terms(6, tuple(range(10, 31)))
    errors = JointErrors(terms, size * MDEG * rng.normal(size=len(terms)))
    return replace(rigid_truth(np.random.default_rng(seed)), joint_errors=errors)


def climbed(table, loss="squared", part=None):
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR, loss=loss).model
    part = np.arange(len(table)) % 4 if part is None else part
    return climb(tx60(), near, table, PARAMETERS, ladders_of(tx60()), part, prior=PRIOR, loss=loss)


def system(table) -> NormalEquations:
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    errors = ladders_of(tx60())[1].levels[-1].errors
    return normal_equations(tx60(), near, table, PARAMETERS, [errors], PRIOR)


@pytest.mark.parametrize("level", [1, 2, 3, 5])
def test_a_part_of_the_normal_equations_is_the_whole_fit_of_that_model(level):
    """Two steps of micrometers: what is not linear is a thousandth of a standard deviation."""
    table = seen(mapped(1), 61, 2)
    chosen = ladders_of(tx60())[1].levels[level]
    wide, found = extended_by(tx60(), table, PARAMETERS, [chosen], prior=PRIOR)
    assert found.status is Status.CONVERGED
    names = chosen.names
    solved = system(table).solved(chosen.errors, chosen.sd)
    step = solved.step[42:]
    at = [found.names.index(name) for name in names]
    u = found.standard_uncertainty[at]
    assert (np.abs(step - found.step[at]) / u).max() < 5e-3
    plain = identify(tx60(), table, PARAMETERS, prior=PRIOR)
    gain = solved.evidence - system(table).solved(JointErrors(), np.zeros(0)).evidence
    assert gain == pytest.approx(found.log_evidence - plain.log_evidence, abs=0.1)
    learned = system(table).learned(chosen.errors, chosen.sd)
    assert learned == pytest.approx(len(found.residual) - found.dof_effective, abs=0.05)
    assert solved.left == pytest.approx(found.chi_square, rel=1e-3)
    assert wide.n_numbers == 42 + len(names)


def test_poses_left_out_are_missed_by_what_a_fit_without_them_misses():
    table = seen(bent(3), 40, 4)
    part = np.arange(40) % 4
    found = climbed(table, part=part)
    missed = np.zeros(40)
    for k in range(4):
        rest, left_out = table.rows(part != k), table.rows(part == k)
        fit = extended_by(tx60(), rest, PARAMETERS, found.taken, prior=PRIOR)[1]
        gap = fit.model.poses(left_out.q)[:, :3, 3] - left_out.position
        missed[part == k] = np.linalg.norm(gap, axis=1)
    # the folds share one line of approach, at the fit to all poses: a percent of noise
    assert found.after == pytest.approx(missed.mean(), rel=0.01)
    assert found.before > 1.5 * found.after


@pytest.mark.parametrize(
    ("after", "steps"),
    [("", ["small waves"]), ("waves", ["waves", "small waves"]), ("not there", [])],
)
def test_a_level_that_refines_another_is_reached_from_there_alone(after, steps):
    """However much more evidence it has: it must be asked for beside the level that it refines."""
    table, waves = seen(bent(3), 40, 4), ladders_of(tx60())[1]
    named = {level.name: level for level in waves.levels}
    best = replace(named["small waves"], after=after)
    kept = [named["none"], best, *(level for level in waves.levels if level.name == after)]
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    ladder = replace(waves, levels=tuple(kept))
    found = climb(tx60(), near, table, PARAMETERS, [ladder], np.arange(40) % 4, prior=PRIOR)
    assert [step.level for step in found.steps] == steps
    # of no level that a climb cannot begin with is it said that it is the best one
    gains = {offer.level: offer.gain for offer in found.offered}
    begin = [level.name for level in kept[1:] if not level.after]
    best = max(begin, key=lambda name: gains[name], default=None)
    assert found.best == (best and (best, gains[best]))


def test_a_level_that_poses_left_out_do_not_confirm_is_not_taken(monkeypatch):
    table = seen(bent(4), 40, 5)
    true = NormalEquations.misses

    def worse(self, found, rows):
        return true(self, found, rows) + 1e-3 * (len(found.step) - 42)

    monkeypatch.setattr(NormalEquations, "misses", worse)
    found = climbed(table)
    assert not found.taken
    assert found.steps
    assert all(step.gain > ASKED and not step.taken for step in found.steps)
    refused = {offer.level for offer in found.offered if offer.outcome.startswith("refused")}
    assert refused == {step.level for step in found.steps}
    assert found.gain == 0.0


def climbed_where_levels_miss_by(more, monkeypatch):
    """A climb whose levels all miss by so much more than geometry, give or take 10 um a pose."""

    def misses(self, found, rows):
        swing = np.where(np.arange(rows.sum()) % 2, 1e-5, -1e-5)
        return 1e-4 + (swing + more if len(found.step) > 42 else np.zeros(rows.sum()))

    monkeypatch.setattr(NormalEquations, "misses", misses)
    return climbed(seen(bent(4), 40, 5))


def test_a_level_is_taken_that_is_worse_by_less_than_chance(monkeypatch):
    found = climbed_where_levels_miss_by(1e-7, monkeypatch)
    assert found.steps[0].taken
    assert found.steps[0].after > found.steps[0].before


def test_levels_that_are_each_worse_by_less_than_chance_must_not_add_up(monkeypatch):
    """Many visits of few poses make the evidence sure of what only these poses show."""
    # 1 um, where the standard error is 10 um over the root of 40: six tenths of it
    found = climbed_where_levels_miss_by(1e-6, monkeypatch)
    assert not found.taken
    assert found.after == found.before
    assert not found.steps[0].taken
    assert found.gain == 0.0


def test_without_poses_to_leave_out_nothing_is_taken_and_that_is_said():
    table = seen(bent(4), 16, 5)
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    found = climb(tx60(), near, table, PARAMETERS, ladders_of(tx60()), None, prior=PRIOR)
    assert found.steps
    assert not found.taken
    assert "too few poses to confirm" in {offer.outcome for offer in found.offered}


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_the_noise_scale_is_that_of_the_richest_model(factor):
    table = measured(mapped(2), POOL[:150], np.random.default_rng(3))
    stated = replace(table, covariance=table.covariance / factor**2)
    found = climbed(stated)
    # 900 rows less some 100 numbers learned: 2.5 % in a standard deviation
    assert found.noise_factor == pytest.approx(factor, rel=0.08)
    assert found.noise_factor >= 1.0


@pytest.mark.slow
def test_a_joint_map_is_found_where_there_is_one_and_its_band_holds_it():
    within, errors = [], []
    for seed in range(2):
        truth = mapped(seed, size=4.0)
        choice = choose(tx60(), seen(truth, 200, seed))
        assert choice.climb.taken[-1].name.startswith("joint map")
        found = choice.identification
        terms = [t for t in found.model.joint_errors.terms if t.order >= 10]
        at = [found.names.index(term.name) for term in terms]
        true = dict(zip(truth.joint_errors.names, truth.joint_errors.coefficients, strict=True))
        off = found.step[at] - [true.get(term.name, 0.0) for term in terms]
        within.append(np.abs(off) < 2 * found.standard_uncertainty[at])
        gap = [
            fit.model.poses(GOALS)[:, :3, 3] - truth.poses(GOALS)[:, :3, 3]
            for fit in choice.identifications
        ]
        errors.append([np.linalg.norm(each, axis=1).mean() for each in gap])
    # waves of 4 mdeg where 3 are believed: a little more than normal deviates; 552 numbers
    assert np.mean(within) > 0.90
    before, after = np.mean(errors, axis=0)
    assert after < 0.5 * before


def test_waves_are_offered_to_joints_that_turn():
    scara = RobotModel(
        Chain(
            [[0, 0.4, 0.3, 0, 0], [0, 0, 0.25, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]],
            kinds=("revolute", "revolute", "prismatic", "revolute"),
        )
    )
    _, waves = ladders_of(scara)
    assert {term.joint for level in waves.levels for term in level.errors.terms} == {0, 1, 3}
    assert len(waves.levels[-1].names) == 3 * 2 * MAP_ORDERS
    slides = RobotModel(Chain([[0, 0.4, 0.3, 0, 0]], kinds=("prismatic",)))
    assert ladders_of(slides)[1].why_not == ("waves: no joint of this robot turns",)


def test_the_prior_of_a_map_is_a_stationary_process_on_the_circle():
    """From the third wave on: its covariance depends on the difference of two angles alone."""
    level = ladders_of(tx60())[1].levels[-1]
    own = [
        (t, s)
        for t, s in zip(level.errors.terms, level.sd, strict=True)
        if t.joint == 0 and t.order > 2
    ]
    q = np.zeros((50, 6))
    q[:, 0] = np.linspace(-np.pi, np.pi, 50)
    B = JointErrors(tuple(t for t, _ in own)).basis(q) * [s for _, s in own]
    K = B @ B.T
    np.testing.assert_allclose(np.diag(K), K[0, 0], rtol=1e-12)
    np.testing.assert_allclose(K[:-1, :-1], K[1:, 1:], atol=1e-12 * K[0, 0])


def test_poses_of_a_table_stay_those_of_the_model_when_terms_are_added():
    levels = ladders_of(tx60())[1].levels[1:2]
    wide = with_errors(tx60(), levels[0].errors)
    np.testing.assert_array_equal(wide.poses(GOALS), tx60().poses(GOALS))
    assert prior_of(levels).names == levels[0].names
    table = poses_of(GOALS, wide.poses(GOALS), sd=(SIGMA_POSITION, SIGMA_ROTATION))
    assert not climbed(table).taken


@pytest.mark.parametrize("true", [bent(3), mapped(1)], ids=["bent", "mapped"])
def test_the_best_level_alone_is_that_of_a_climb(true):
    """To the last bit: the same equations, without the rounds that follow the first."""
    table = seen(true, 40, 4)
    near = identify(tx60(), table, PARAMETERS, prior=PRIOR).model
    for ladder in ladders_of(tx60()):
        whole = climb(tx60(), near, table, PARAMETERS, [ladder], None, prior=PRIOR).best
        assert best_alone(tx60(), near, table, PARAMETERS, [ladder], prior=PRIOR) == [whole]
