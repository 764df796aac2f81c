"""What nobody says of a pose, against joint errors propagated by the Jacobian."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.jacobian import joint_columns, reflector_rows
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.operating import AS_USUAL, OperatingConditions, approaches
from testbed.identify.applies.unsaid import unsaid_spread
from tests.calibrated import robot
from tests.reference import DEG, pool_r

POINT = np.array([0.02, -0.03, 0.1])
GIVE = np.array([3, 2, 4, 8, 8, 20]) * 1e-3 * DEG
"""Play of each joint to a side [rad], or what it gives for each N m [rad/(N m)]."""


def following(wave, reference=0.0):
    """The shipped arm with one term on each joint that follows what a row says."""
    one = np.eye(6)
    terms = tuple(JointTerm(f"{wave}{k + 1}", k, wave, tuple(one[k]), reference) for k in range(6))
    return replace(robot().model, joint_errors=JointErrors(terms, GIVE))


def turned(model, q):
    """Columns (m, 3, 6) of the point that the joints turn [m/rad]."""
    T, J = model.poses_and_jacobian(q)
    _, rows = reflector_rows(T, J, np.broadcast_to(POINT, (len(q), 3)))
    return rows[:, :, joint_columns(model.chain)]


def test_torques_that_nobody_knows_vary_as_those_of_the_rows():
    model, q = following("torque", reference=5.0), pool_r(4)
    rng = np.random.default_rng(3)
    load = 5.0 + rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6))  # they go together
    seen = OperatingConditions(torque=load)
    found = unsaid_spread(model, q, AS_USUAL, seen, POINT)
    J, away = turned(model, q), (load - 5.0) * GIVE
    linear = J @ (away.T @ away / 40) @ np.swapaxes(J, 1, 2)
    # joints give up to a millirad: what is not linear is of that size beside it
    np.testing.assert_allclose(found, linear, atol=5e-3 * np.abs(linear).max())
    at = OperatingConditions(torque=load[:4])
    assert not unsaid_spread(model, q, at, seen, POINT).any()


def test_a_warmth_that_nobody_knows_is_as_likely_up_to_that_of_the_furthest_row():
    """Cold starts: most rows are of the warm arm, a program may run in the first minutes."""
    lengths = JointErrors((JointTerm("growth", -1, "lengths", (0.0,) * 6, 27.0),), np.array([2e-5]))
    model, q = replace(robot().model, joint_errors=lengths), pool_r(6)
    degrees = np.r_[22.0, 26.0, np.full(30, 28.0)]
    found = unsaid_spread(model, q, AS_USUAL, OperatingConditions(temperature=degrees), POINT)
    T = model.poses(q)
    cold = model.poses(q, OperatingConditions(temperature=np.full(6, 22.0)))
    away = (T[:, :3, :3] - cold[:, :3, :3]) @ POINT + T[:, :3, 3] - cold[:, :3, 3]
    np.testing.assert_allclose(found, away[:, :, None] * away[:, None] / 3, rtol=1e-9)
    # 1.96 standard deviations reach the furthest row
    assert (1.96 * np.sqrt(np.einsum("mii->m", found)) > np.linalg.norm(away, axis=1)).all()
    # most rows far away: their mean square is more
    degrees = np.r_[np.full(30, 22.0), 27.0]
    found = unsaid_spread(model, q, AS_USUAL, OperatingConditions(temperature=degrees), POINT)
    mean = away[:, :, None] * away[:, None] * 30 / 31
    np.testing.assert_allclose(found, mean, rtol=1e-9)


def test_a_side_that_nobody_knows_is_either_side():
    model, q = following("approach"), pool_r(5)
    at = OperatingConditions(approach=approaches(q))
    seen = OperatingConditions(approach=np.ones((20, 6)))
    found = unsaid_spread(model, q, at, seen, POINT)
    J = turned(model, q)
    linear = J @ np.diag(GIVE**2) @ np.swapaxes(J, 1, 2)
    np.testing.assert_allclose(found[0], linear[0], atol=5e-3 * np.abs(linear).max())
    assert not found[1:].any()  # all joints have moved
    unknown = unsaid_spread(model, q, AS_USUAL, seen, POINT)
    np.testing.assert_allclose(unknown, linear, atol=5e-3 * np.abs(linear).max())


@pytest.mark.parametrize("seen", [AS_USUAL, OperatingConditions(payload=np.arange(4.0))])
def test_a_model_that_follows_nothing_is_as_certain_as_ever(seen):
    assert not unsaid_spread(robot().model, pool_r(3), AS_USUAL, seen, POINT).any()
