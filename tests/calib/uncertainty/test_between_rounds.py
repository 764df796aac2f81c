"""Rounds that differ by turns of the joints: a warming arm, and approaches from another side."""

from dataclasses import replace

import numpy as np
import pytest

from calib.uncertainty.drift.between_rounds import SHOWN, visits_apart
from calib.uncertainty.statement.repeats import joint_scatter
from tests.calib.uncertainty.test_between_repeats import JOINTS, in_a_box, true_model, visits
from tests.reference import SIGMA_POSITION, pool_r
from tests.truth.measuring import measured


def warming(seed, turns, *, count=40, back=False, shots=1):
    """Two rounds, in the same order or back, while the joints turn by so much in all (n,) [rad]."""
    rng, model = np.random.default_rng(seed), true_model(seed)
    q = pool_r(400)[rng.choice(400, count, replace=False)]
    pose = np.concatenate([np.arange(count), np.arange(count)[:: -1 if back else 1]])
    warm = (1 - np.exp(-np.linspace(0, 2, 2 * count)))[:, None] * turns
    off = warm + JOINTS * rng.standard_normal((2 * count, 6))
    pose, off = np.repeat(pose, shots), np.repeat(off, shots, axis=0)
    table = measured(model, q[pose] + off, np.random.default_rng(seed + 1000))
    return replace(table, q=q[pose], pose_id=pose)


def asked(table, seed):
    return visits_apart(true_model(seed), table, np.arange(len(table)))


@pytest.mark.parametrize("back", [False, True])
def test_joints_that_warm_are_found_where_no_drift_of_the_readings_explains_them(back):
    turns = np.radians([0.008, -0.012, 0.01, 0.02, -0.016, 0.0])
    found = [asked(warming(seed, turns, back=back), seed) for seed in range(5)]
    assert all(one is not None for one in found)
    of_joints = [one for one in found if one.joints]
    assert of_joints
    for one in of_joints:
        assert one.p_value < SHOWN
        assert not one.shift.any()  # joints make it: a single move has it as their scatter
        assert "differ from round to round" in one.sentence
        assert one.size == pytest.approx(np.sqrt(6) * one.sd)


def test_how_far_rounds_stand_apart_is_told_beside_noise():
    """Half the square of twice what one round is turned by, over three axes."""
    table = in_a_box(3, 6 * JOINTS[0])
    found = asked(table, 3)
    away = np.linalg.norm(true_model(3).poses(table.q)[:, :2, 3], axis=1)
    # about the first axis, to either side; 40 pairs: some 10 %
    assert found.joints
    assert found.sd == pytest.approx(np.sqrt(2 / 3 * np.mean((6 * JOINTS[0] * away) ** 2)), rel=0.2)


@pytest.mark.parametrize(
    ("count", "most"), [(100, 4), pytest.param(300, 8, marks=pytest.mark.slow)]
)
def test_joints_that_scatter_are_said_to_differ_from_round_to_round_by_chance_alone(count, most):
    """At most as often as stated, however large the scatter and whichever joint has it."""
    said = 0
    for k in range(count):
        table = visits(20 + k % 20, 2 + k % 2, seed=k, tour=k % 2 == 0, joints=(0.3, 3, 8)[k % 3])
        said += asked(table, k) is not None
    # one of a hundred expected; more than 4 of 100, or 8 of 300, in one set in 250
    assert said <= most


def test_shots_of_one_stop_do_not_differ_from_round_to_round():
    """They share how the joints came: in another order they would be no round."""
    found = asked(warming(4, np.full(6, 2e-4), shots=3), 4)
    assert found is None or not found.joints


def test_rounds_that_differ_keep_their_scatter_in_a_single_move():
    table = in_a_box(3, 6 * JOINTS[0])
    own = np.broadcast_to(SIGMA_POSITION**2 * np.eye(3), (len(table), 3, 3))
    found = asked(table, 3)
    blamed = joint_scatter(true_model(3), table, own, own)
    assert joint_scatter(true_model(3), table, own, own, found.shift) == blamed
