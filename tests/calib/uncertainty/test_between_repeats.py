"""Visits of the same poses: a drift goes with time, joints scatter."""

from dataclasses import replace

import numpy as np
import pytest

from calib.measurement.prediction import tool_poses
from calib.uncertainty.drift.between_repeats import repeat_drift
from calib.uncertainty.statement.repeats import joint_scatter
from tests.calibrated import robot, table_of, true_model
from tests.reference import SIGMA_POSITION, pool_r

JOINTS = robot().repeatability


def visits(count=45, rounds=2, *, seed=7, shift=0.0, of_tool=False, tour=False, joints=1.0):
    """Poses visited in rounds while the readings, or the tool, drift by so much [m]."""
    rng, model, pool = np.random.default_rng(seed), true_model(seed), pool_r(400)
    q = pool[rng.choice(len(pool), count, replace=False)]
    which = [np.arange(count) if tour else rng.permutation(count) for _ in range(rounds)]
    pose = np.concatenate(which)
    moved = q[pose] + joints * JOINTS * rng.standard_normal((len(pose), len(JOINTS)))
    table = table_of(
        model, moved, seed=seed + 1000, pose_id=pose, repeat=np.repeat(np.arange(rounds), count)
    )
    way = rng.standard_normal(3)
    drift = np.linspace(0, shift, len(pose))[:, None] * way / np.linalg.norm(way)
    if of_tool:
        drift = np.einsum("mij,mj->mi", tool_poses(model, table)[:, :3, :3], drift)
    return replace(table, q=q[pose], position=table.position + drift)


def asked(table, seed=7):
    return repeat_drift(true_model(seed), table, np.arange(len(table)))


@pytest.mark.parametrize("tour", [False, True])
@pytest.mark.parametrize("of_tool", [False, True])
def test_a_drift_is_seen_with_its_size_and_what_drifts(of_tool, tour):
    found = asked(visits(shift=100e-6, of_tool=of_tool, tour=tour))
    assert found.of_tool == of_tool
    assert not found.or_else
    assert found.p_value < 1e-3
    # noise of 17 um per axis in 90 rows: some 6 um
    assert abs(found.size - 100e-6) < 20e-6
    assert ("the tool drifted by" in found.sentence) == of_tool


def test_joints_that_come_back_badly_are_no_drift():
    """Of 200 campaigns at most one in a hundred, however large the scatter; measured 0 of 400."""
    said = sum(
        asked(visits(20 + k % 30, 2 + k % 2, seed=k, tour=k % 2 == 0, joints=(0.3, 1, 3, 8)[k % 4]),
              k) is not None
        for k in range(200)
    )  # fmt: skip
    assert said <= 2


def test_what_a_drift_explains_is_no_scatter_of_the_joints():
    table = visits(shift=150e-6)
    own = np.broadcast_to(SIGMA_POSITION**2 * np.eye(3), (len(table), 3, 3))
    # as large as the instrument: what it has per axis and joint is told by nothing else here
    blamed = joint_scatter(true_model(7), table, own, own)
    freed = joint_scatter(true_model(7), table, own, own, asked(table).shift)
    steady = joint_scatter(true_model(7), visits(), own, own)
    assert blamed[0] > 2 * steady[0]
    assert freed[0] == pytest.approx(steady[0], rel=0.2)
    assert asked(visits()) is None
