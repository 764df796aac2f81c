"""Terms that follow the rows: found where they are there, refused with their reason where not."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.chain import forward
from calib.geometry.gravity import weight_of
from calib.geometry.operating import OperatingConditions, approaches
from calib.geometry.parameters import parameters_of
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import weak_prior
from calib.identification.row_ladders import (
    EXPANSION,
    NOTHING_KNOWN,
    RowTerms,
    gear_terms,
    row_ladders,
)
from calib.measurement.tables import poses
from tests.calib.identification.test_joint_models import GOALS, MDEG, POOL
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, rigid_truth, tx60
from tests.truth.measuring import measured

KAPPA = 17e-6


def drawn(seed, m=40):
    """A rigid robot, poses of it, and the rest of the draws."""
    rng = np.random.default_rng([seed, m])
    return rigid_truth(rng), POOL[rng.choice(len(POOL), m, replace=False)], rng


def table(T, q, rng, **said):
    """Noisy poses with what rows say of them."""
    clean = poses(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))
    return replace(noisy(clean, rng), conditions=OperatingConditions(**said))


def noisy(clean, rng):
    """The table with its stated noise."""
    step = rng.normal(size=(len(clean), 6)) * np.repeat([SIGMA_POSITION, SIGMA_ROTATION], 3)
    turn = np.array([rotation(v) for v in step[:, 3:]])
    return replace(clean, position=clean.position + step[:, :3], rotation=turn @ clean.rotation)


def rotation(v):
    """Rodrigues' formula, written out."""
    angle = np.linalg.norm(v)
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]) / angle
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def warmed(truth, q, warmth):
    """Poses of an arm whose links are longer by 17e-6 per kelvin above 20 degC, one by one."""
    out = []
    for row, t in zip(q, warmth, strict=True):
        links = truth.chain.links.copy()
        links[:, 1:3] *= 1 + KAPPA * (t - 20.0)
        out.append(forward(replace(truth.chain, links=links), row[None])[0])
    return np.array(out)


def ladder(name, found, known=NOTHING_KNOWN):
    return next(one for one in row_ladders(tx60(), found, known) if one.name == name)


def error(model, truth, at):
    """Mean distance at the goals [m]."""
    off = model.poses(GOALS, at)[:, :3, 3] - truth
    return float(np.linalg.norm(off, axis=1).mean())


@pytest.mark.slow
def test_how_much_an_arm_grows_is_found_within_its_uncertainty():
    """Twelve robots that warm by 10 K: kappa within 2 sd of most, and errors as of cold ones."""
    prior, off, warm_error, cold_error = weak_prior(parameters_of(tx60())), [], [], []
    for seed in range(12):
        truth, q, rng = drawn(seed)
        warmth = np.linspace(20.0, 30.0, len(q))
        found = table(warmed(truth, q, warmth), q, rng, temperature=warmth)
        level = ladder("lengths", found).levels[1]
        _, fit = extended_by(tx60(), found, parameters_of(tx60()), [level], prior=prior)
        k = fit.names.index("lengths")
        off.append((fit.step[k] - KAPPA) / fit.standard_uncertainty[k])
        at = OperatingConditions(temperature=np.full(len(GOALS), 22.0))
        there = warmed(truth, GOALS, np.full(len(GOALS), 22.0))[:, :3, 3]
        warm_error.append(error(fit.model, there, at))
        cold = measured(truth, q, rng)
        _, plain = extended_by(tx60(), cold, parameters_of(tx60()), [], prior=prior)
        cold_error.append(error(plain.model, truth.poses(GOALS)[:, :3, 3], OperatingConditions()))
    # of 12 normal numbers more than 3 lie beyond 2 sd once in 400 draws; chi-square of their size
    assert (np.abs(off) > 2).sum() <= 3
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.6
    assert np.mean(warm_error) == pytest.approx(np.mean(cold_error), rel=0.1)


def test_a_warm_arm_asks_for_lengths_and_a_silent_file_cannot():
    truth, q, rng = drawn(1)
    warmth = np.linspace(20.0, 30.0, len(q))
    said = table(warmed(truth, q, warmth), q, rng, temperature=warmth)
    choice = choose(tx60(), said)
    assert [level.name for level in choice.climb.taken] == ["lengths"]
    coefficient = choice.identification.model.joint_errors.coefficients
    assert coefficient == pytest.approx([KAPPA], abs=2e-6)
    silent = choose(tx60(), replace(said, conditions=OperatingConditions()))
    assert "lengths" not in [level.name for level in silent.climb.taken]
    at = OperatingConditions(temperature=np.full(len(GOALS), 29.0))
    there = warmed(truth, GOALS, at.temperature)[:, :3, 3]
    told = error(choice.identification.model, there, at)
    assert told < 0.5 * error(silent.identification.model, there, at)


@pytest.mark.parametrize("current", [False, True])
def test_play_gears_and_torques_are_found_and_measured(current):
    truth, q, rng = drawn(2, 80)
    play = np.array([4, 3, 2, 3, 4, 5]) * MDEG
    side = approaches(q)
    load = rng.normal(0, 40, q.shape)
    give = 0.1 * MDEG * load
    wave = 4 * MDEG * np.sin(60.5 * q[:, [1]] + 0.3) * [0, 1, 0, 0, 0, 0]
    T = forward(truth.chain, q + play * side + give + wave)
    found = table(T, q, rng, approach=side, torque=load)
    known = RowTerms(gear=((), (60.5, 121.0), *[()] * 4), current=current)
    choice = choose(tx60(), found, known=known)
    assert {level.name for level in choice.climb.taken} == {"approach", "torque", "gear"}
    fit = choice.identification
    told = dict(zip(fit.names, fit.step, strict=True))
    sd = dict(zip(fit.names, fit.standard_uncertainty, strict=True))
    for j in range(6):
        # three standard deviations, of 18 numbers
        assert told[f"approach{j + 1}"] == pytest.approx(play[j], abs=3.3 * sd[f"approach{j + 1}"])
        assert told[f"torque{j + 1}"] == pytest.approx(0.1 * MDEG, abs=3.3 * sd[f"torque{j + 1}"])
    sine, cosine = told["gear2.sin60.5"], told["gear2.cos60.5"]
    size = np.hypot(sd["gear2.sin60.5"], sd["gear2.cos60.5"])
    assert np.hypot(sine, cosine) == pytest.approx(4 * MDEG, abs=3.3 * size)
    assert abs(told["gear2.sin121"]) < 3.3 * sd["gear2.sin121"]
    # a joint that takes a side it is not told of stands in the middle of its play
    middle = forward(truth.chain, q + 0.1 * MDEG * load.mean(axis=0) + wave)[:, :3, 3]
    off = fit.model.poses(q)[:, :3, 3] - middle
    assert np.linalg.norm(off, axis=1).mean() < 20e-6


def test_torques_that_only_repeat_gravity_leave_it_to_gravity():
    """Both explain the rows alike; only those of gravity are known where the robot will go."""
    truth, q, rng = drawn(7, 60)  # by a hair more by reports
    load = weight_of(truth.chain).torques(q)[:, :, 2]
    give = 40 * MDEG / np.abs(load).max(axis=0).clip(min=1.0)
    found = table(forward(truth.chain, q + give * load), q, rng, torque=load)
    choice = choose(tx60(), found)
    assert {step.ladder for step in choice.climb.steps if step.taken} == {"gravity"}


def said(**columns):
    """Rows that say something, of a robot without errors."""
    q = POOL[:20]
    return table(tx60().poses(q), q, np.random.default_rng(0), **columns)


@pytest.mark.parametrize(
    ("name", "columns", "known", "why"),
    [
        ("approach", {}, RowTerms(), "approach: the order of the poses is not known"),
        ("torque", {}, RowTerms(), "torque: the file has no such columns"),
        ("gear", {}, RowTerms(), "gear: no ratio or order is stated"),
        ("lengths", {}, RowTerms(), "lengths: the file gives no temperature"),
        (
            "approach", {}, RowTerms(unsaid={"approach": "the column order is no order"}),
            "approach: the column order is no order",
        ),
        (
            "lengths", {"temperature": np.full(20, 21.5)}, RowTerms(),
            "lengths: the temperature never changes (21.5 degC)",
        ),
        (
            "lengths", {"temperature": 20 + np.linspace(0, 0.2, 20)}, RowTerms(),
            "lengths: temperature moves by 0.2 K, 3.7 um at the tip, below the noise",
        ),
        (
            "gear", {}, RowTerms(gear=((2000 * np.pi,),)), "gear: joint 1, 6283.19 waves a turn: "
            "all its values lie on a grid of 0.0573 deg, or of half of it",
        ),
    ],
)  # fmt: skip
def test_what_rows_do_not_say_is_not_offered_with_its_reason(name, columns, known, why):
    found = said(**columns)
    if known.gear:
        found = replace(found, q=np.round(found.q, 3))
    one = ladder(name, found, known)
    assert why in " ".join(one.why_not)
    assert len(one.levels) == 1


def test_torques_in_another_unit_are_told_by_those_of_gravity():
    from calib.geometry.gravity import Weight, guessed_moments

    own = Weight(tx60().chain, guessed_moments(tx60().chain)).torques(POOL[:20])[:, :, 2]
    for factor, fits in ((1.0, True), (0.2, True), (1000.0, False), (0.001, False)):
        one = ladder("torque", said(torque=factor * own))
        assert (len(one.levels) == 2) == fits
        assert ("another unit" in " ".join(one.why_not)) != fits
    currents = ladder("torque", said(torque=1000 * own), RowTerms(current=True))
    assert len(currents.levels) == 2


def test_joints_that_come_from_one_side_are_named():
    side = np.ones((20, 6))
    side[::2, 1] = -1
    one = ladder("approach", said(approach=side))
    assert one.levels[1].names == ("approach2",)
    assert one.why_not[:2] == tuple(
        f"approach: joint {i} always comes from one side" for i in (1, 3)
    )


def test_what_the_model_has_is_not_offered_again():
    found = said(temperature=np.linspace(20, 30, 20))
    first = choose(tx60(), found).climb
    assert [ladder.name for ladder in first.levels] == ["none"] * 6
    level = ladder("lengths", found).levels[1]
    assert level.mean.tolist() == [EXPANSION["steel"]]
    wide, _ = extended_by(
        tx60(), found, parameters_of(tx60()), [level], prior=weak_prior(parameters_of(tx60()))
    )
    (again,) = [one for one in row_ladders(wide, found) if one.name == "lengths"]
    assert again.why_not == ("lengths: the model has it already",)
    assert len(gear_terms(6, 2, 100.0)[0].weights) == 6


def test_a_belief_about_another_value_than_zero_is_zero_of_what_is_left():
    """Least squares about a mean is least squares about zero of readings less what it explains."""
    truth, q, rng = drawn(3)
    warmth = np.linspace(20.0, 30.0, len(q))
    found = table(warmed(truth, q, warmth), q, rng, temperature=warmth)
    level, parameters = ladder("lengths", found).levels[1], parameters_of(tx60())
    prior = weak_prior(parameters)
    system = normal_equations(tx60(), tx60(), found, parameters, [level.errors], prior)
    about = system.solved(level.errors, level.sd, level.mean, 1.5)
    column = system.A[:, :, system.names.index("lengths")]
    less = system._of(system.A, system.r - level.mean[0] * column, system.equations)
    zero = less.solved(level.errors, level.sd, None, 1.5)
    # sums of some 1e5, to rounding
    assert about.evidence == pytest.approx(zero.evidence, rel=1e-11)
    assert about.left == pytest.approx(zero.left, rel=1e-8)
    learned = system.learned(level.errors, level.sd, level.mean, 1.5)
    assert learned == pytest.approx(less.learned(level.errors, level.sd, None, 1.5), rel=1e-12)
    np.testing.assert_allclose(about.step[:-1], zero.step[:-1], rtol=1e-6, atol=1e-12)
    assert about.step[-1] == pytest.approx(zero.step[-1] + level.mean[0], rel=1e-9)
