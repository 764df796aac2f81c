"""Where a statement applies: transfer against refits of wrong robots, and places that differ."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.jacobian import reflector_rows
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model
from calib.measurement import tables
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.applicability import (
    BEYOND,
    REFUSED,
    Applicability,
    lacking,
    proven_at,
)
from calib.uncertainty.statement.believe import believe
from calib.uncertainty.statement.places import reasons, steps_words
from calib.uncertainty.statement.steps import steps_of
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
TARGET = np.array([0.1, 0.02, 0.05])


def exact(true, q):
    """Poses of a robot without noise, with the usual covariance."""
    return tables.poses(q, true.poses(q), sd=(kinds.NOISE, kinds.TURN_NOISE))


def fitted(table):
    """All numbers identified that the poses show."""
    return identify(TX60, table, parameters_of(TX60))


def tips(model, q):
    """Where the target is (m, 3) [m]."""
    T = model.poses(q)
    return T[:, :3, 3] + T[:, :3, :3] @ TARGET


def test_what_is_left_is_what_a_calibration_leaves_of_each_wave():
    """A robot with one small wave, calibrated without it: its error at the target, by the fit."""
    rng = np.random.default_rng(1)
    q, there = kinds.joints("tx60", rng, 25), kinds.joints("tx60", rng, 6)
    fit = fitted(exact(TX60, q))
    proven = proven_at(fit, exact(TX60, q), q, target=TARGET)
    assert proven.wide.joint_errors.names == extended_model(TX60).joint_errors.names
    step, square = 1e-6, np.zeros(len(there))
    for k in range(len(proven.columns)):
        wave = np.zeros(proven.wide.n_numbers)
        wave[proven.columns[k]] = step
        true = proven.wide.moved(wave)
        error = (tips(true, there) - tips(fitted(exact(true, q)).model, there)) / step
        square += (error**2).sum(axis=1)
    # fits end within 1e-9 of u; a step of 1e-6 rad bends nothing more than 1e-5
    np.testing.assert_allclose(proven.left(there)[0], square, rtol=1e-4)


def test_what_is_left_of_a_foot_that_yields():
    """The base turned at every pose by p x up: what a calibration leaves of it."""
    rng = np.random.default_rng(2)
    q, there = kinds.joints("tx60", rng, 25), kinds.joints("tx60", rng, 6)
    proven = proven_at(fitted(exact(TX60, q)), exact(TX60, q), q, target=TARGET)
    step = 1e-6

    def yielded(q):
        """Tool poses of the arm, each turned about its foot by a little of p x up."""
        T = TX60.poses(q)
        turn = kinds.exp_so3(step * np.cross(T[:, :3, 3], [0.0, 0.0, 1.0]))
        out = T.copy()
        out[:, :3] = turn @ T[:, :3]
        return out

    seen = tables.poses(q, yielded(q), sd=(kinds.NOISE, kinds.TURN_NOISE))
    true = yielded(there)
    error = true[:, :3, 3] + true[:, :3, :3] @ TARGET - tips(fitted(seen).model, there)
    square = (error**2).sum(axis=1) / step**2
    np.testing.assert_allclose(proven.left(there)[1], square, rtol=1e-4)


def test_leverage_is_the_variance_of_the_target():
    rng = np.random.default_rng(3)
    q, there = kinds.joints("tx60", rng, 25), kinds.joints("tx60", rng, 6)
    fit = fitted(exact(TX60, q))
    proven = proven_at(fit, exact(TX60, q), q, target=TARGET)
    T, J = TX60.poses_and_jacobian(there)
    rows = reflector_rows(T, J, np.tile(TARGET, (6, 1)))[1]
    variance = np.trace(rows @ fit.full_covariance @ np.swapaxes(rows, 1, 2), axis1=1, axis2=2)
    np.testing.assert_allclose(proven.left(there)[2], variance, rtol=1e-9)


def test_the_mean_over_the_held_out_poses_is_one():
    rng = np.random.default_rng(4)
    q, held_out = kinds.joints("tx60", rng, 40), kinds.joints("tx60", rng, 20)
    proven = proven_at(fitted(exact(TX60, q)), exact(TX60, q), held_out)
    here = proven.applies(held_out)
    assert here.leverage.mean() == pytest.approx(1.0)
    assert (proven.left(held_out) / proven.usual[:, None]).mean(axis=1) == pytest.approx(1.0)
    assert here.reaches
    assert not here.beyond.any()
    assert (here.growth >= 1).all()


def test_the_other_side_of_the_room_is_not_inside():
    """Calibrated with joint 1 within 45 degrees, used beyond 70: warned of, grown, held."""
    rng = np.random.default_rng(5)
    q = kinds.joints("tx60", rng, 400)
    ahead, aside = q[np.abs(q[:, 0]) < 0.8], q[np.abs(q[:, 0]) > 1.2][:60]
    train_q, held_q, same_q = ahead[:60], ahead[60:100], ahead[100:]
    fit = fitted(exact(TX60, train_q))
    proven = proven_at(fit, exact(TX60, train_q), held_q)
    same, other = proven.applies(same_q), proven.applies(aside)
    assert np.median(same.transfer) < 1.5 < np.median(other.transfer)
    assert (same.place == "inside").mean() > 0.75
    assert (other.place == "inside").mean() < 0.25
    assert other.beyond[:, 0].any()
    assert not other.beyond[:, 1:].any(axis=1).all()
    assert "inside" in repr(same)


@pytest.mark.slow
def test_growth_holds_where_the_plain_rule_falls_short():
    """Sag and waves of half the noise, used with the other elbow; robots are the unit."""
    shares = []
    for robot in range(12):
        rng = np.random.default_rng([robot, 6])
        wide = extended_model(TX60)
        terms = wide.joint_errors
        draw = rng.normal(size=len(terms.terms)) * 25e-6
        true = RobotModel(TX60.chain, JointErrors(terms.terms, draw))
        q = kinds.joints("tx60", rng, 600)
        up, down = q[q[:, 2] > 0.7], q[q[:, 2] < -0.7][:60]
        train = kinds.poses(true, up[:60], rng)
        held_out = kinds.poses(true, up[60:100], rng)
        fit = fitted(train)
        belief = believe(fit, train, replace(held_out, pose_id=60 + np.arange(40)))
        points = true.poses(down)[:, :3, 3]
        shares.append(
            (belief.regions(down, growth=1.0).holds(points).mean(),
             belief.regions(down).holds(points).mean())
        )  # fmt: skip
    plain, grown = np.array(shares).T
    assert plain.mean() < 0.9
    # bar of `shift`: 92 %; twelve robots, so their own standard error is allowed for
    assert grown.mean() >= 0.92
    assert grown.mean() >= 0.95 - 3 * grown.std(ddof=1) / np.sqrt(12)


def test_a_set_that_lies_outside_is_not_reached():
    rng = np.random.default_rng(7)
    q = kinds.joints("tx60", rng, 300)
    near = q[(np.abs(q[:, :3]) < 0.7).all(axis=1)]
    near = np.concatenate([near, near + rng.uniform(-0.1, 0.1, near.shape)])[:30]
    proven = proven_at(fitted(exact(TX60, near)), exact(TX60, near), near)
    far = q[(np.abs(q[:, 0]) > 1.5) & (np.abs(q[:, 2]) > 1.0)]
    there = proven.applies(far)
    worst = np.maximum(there.transfer, there.leverage)
    assert ((there.place == "outside") == (worst > REFUSED)).all()
    assert not there.reaches
    assert proven.applies(near[:0]).reaches


@pytest.mark.parametrize(("outside", "reached"), [(5, True), (6, False)])
def test_a_statement_reaches_a_set_of_which_a_quarter_lies_outside(outside, reached):
    transfer = np.where(np.arange(20) < outside, 9.1, 8.9)
    found = Applicability(transfer, np.ones(20), np.zeros((20, 6), bool))
    assert (found.place == "outside").sum() == outside
    assert found.reaches is reached


def test_joints_beyond_their_range_are_named_one_by_one():
    rng = np.random.default_rng(8)
    q = kinds.joints("tx60", rng, 40)
    proven = proven_at(fitted(exact(TX60, q)), exact(TX60, q), q)
    probe = np.tile(q.mean(axis=0), (3, 1))
    probe[1, 3] = q[:, 3].max() + 1.01 * BEYOND
    probe[2, 3] = q[:, 3].min() - 0.99 * BEYOND
    beyond = proven.applies(probe).beyond
    assert beyond.sum() == 1
    assert beyond[1, 3]


def test_a_model_with_all_waves_lacks_the_next_ones():
    wide = extended_model(TX60)
    names = set(lacking(wide).joint_errors.names) - set(wide.joint_errors.names)
    assert names == {f"harmonic{i}.{wave}3" for i in range(1, 7) for wave in ("sin", "cos")}


def test_no_held_out_pose_proves_no_place():
    q = kinds.joints("tx60", np.random.default_rng(9), 20)
    with pytest.raises(InputError, match="no held-out pose"):
        proven_at(fitted(exact(TX60, q)), exact(TX60, q), np.zeros((0, 6)))


STEPS = np.radians(15.0)


def on_steps(rng, m):
    """Joints (m, 6) of a TX60 in whole steps of 15 degrees."""
    return np.round(kinds.joints("tx60", rng, m) / STEPS) * STEPS


@pytest.mark.parametrize("step", [2.0, 5.0, 7.5, 15.0, 360 / 7])
def test_the_step_that_values_keep_is_found_wherever_they_begin(step):
    """Read-back joints scatter by a few millidegrees; gaps may all be several steps wide."""
    rng = np.random.default_rng(10)
    places = np.concatenate([[0, 2, 5], rng.choice([0, 2, 5, 7, 9, 12], 40)])
    values = np.radians(13.3 + step * places + rng.normal(scale=0.003, size=len(places)))
    (found,) = np.degrees(steps_of(values[:, None], np.zeros(1)))
    # twelve steps, read to 3 mdeg
    assert found == pytest.approx(step, abs=0.001)
    (slide,) = steps_of(1e-3 * step * places[:, None], np.ones(1))
    assert slide == pytest.approx(1e-3 * step, rel=1e-9)


def test_values_drawn_at_random_keep_no_step():
    rng = np.random.default_rng(11)
    for m in (8, 20, 60, 400):
        assert not steps_of(rng.uniform(-2, 2, (m, 50)), np.zeros(50)).any()
    whole = np.radians(np.round(np.degrees(rng.uniform(-2, 2, (60, 50)))))
    assert not steps_of(whole, np.zeros(50)).any()  # steps of a degree hide no gear
    assert not steps_of(np.full((20, 1), 0.3), np.zeros(1)).any()


def test_between_steps_a_gear_may_do_what_no_reading_shows_and_it_is_said():
    """A wave of 24 a turn is a shift of its joint at all poses, held out or not."""
    on, between, words = [], [], []
    for robot in range(8):
        rng = np.random.default_rng([robot, 12])
        phase = rng.uniform(0, 2 * np.pi, 6)

        def true(q, phase=phase):
            return TX60.poses(q + 100e-6 * np.sin(24 * q + phase))

        def seen(q, rng=rng, true=true):
            T = true(q)
            T[:, :3, 3] += kinds.NOISE * rng.normal(size=(len(q), 3))
            return tables.poses(q, T, sd=(kinds.NOISE, kinds.TURN_NOISE))

        q = np.unique(on_steps(rng, 90), axis=0)
        rng.shuffle(q)
        train, test = seen(q[:40]), seen(q[40:60])
        found = judge(fitted(train), replace(test, pose_id=40 + np.arange(20)), train=train)
        words.append(found.trust.sentence)
        assert found.questions.combined > 1e-4
        off = kinds.joints("tx60", rng, 200)
        proven = found.belief.proven
        reach = proven.applies(off)
        assert not (reach.place == "inside").any()
        assert "was never proven between steps of 15 deg" in reasons(proven, reach, off)[0]
        assert not proven.between(q).any()
        for share, there in ((on, q[60:]), (between, off)):
            e = true(there)[:, :3, 3] - found.belief.model.poses(there)[:, :3, 3]
            share.append((np.linalg.norm(e, axis=1) <= found.point.radius_mean).mean())
    told = "Joints 1, 2, 3, 4, 5, 6 stood only at steps of 15 deg: no reading shows an error that"
    assert all(told in each for each in words)
    # the radius is what it promises at steps, and nothing like it between them
    assert np.mean(on) >= 0.95
    assert np.mean(between) < 0.9


def test_joints_that_keep_a_step_are_named_with_their_own():
    rng = np.random.default_rng(13)
    q = kinds.joints("tx60", rng, 40)
    proven = proven_at(fitted(exact(TX60, q)), exact(TX60, q), q)
    assert steps_words(proven) == ""
    q[:, 2] = on_steps(rng, 40)[:, 2]
    q[:, [1, 5]] = 2 * np.round(q[:, [1, 5]] * 18 / np.pi / 2) * np.pi / 18
    proven = proven_at(fitted(exact(TX60, q)), exact(TX60, q), q)
    said = "joints 2, 6 stood only at steps of 20 deg and joint 3 stood only at steps of 15 deg: "
    assert steps_words(proven).startswith(said)
