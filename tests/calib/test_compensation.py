"""Corrected targets: the identified robot does what the nominal one was meant to do."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from calib.compensation import compensate, corrected_poses
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import log_so3
from calib.geometry.inverse import inverse_kinematics, joint_jacobian, spread
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from tests.calib.geometry.test_inverse import ARMS, TX60, limits_of, wrong

LEFT = 1e-9
"""What a correction may leave [m, rad]."""


def case(name, count=60):
    """Nominal arm, what it really is, and targets well inside the limits."""
    chain, rng = ARMS[name], np.random.default_rng(3)
    real = wrong(chain, rng)
    soft = RobotModel(
        real.chain, type(real.joint_errors)(real.joint_errors.terms,
                                            real.joint_errors.coefficients * 0.05)
    )  # fmt: skip
    return RobotModel(chain), soft, spread(0.8 * limits_of(chain), count), limits_of(chain)


@pytest.mark.parametrize("name", ARMS)
def test_the_identified_robot_has_the_nominal_poses_at_the_corrected_joints(name):
    nominal, real, q, limits = case(name)
    found = compensate(nominal, real, q, limits)
    ok = found.corrected
    assert ok.mean() > 0.9
    want, have = nominal.poses(q), real.poses(found.q)
    assert np.abs(want[ok, :3, 3] - have[ok, :3, 3]).max() < LEFT
    turn = log_so3(np.swapaxes(want[:, :3, :3], 1, 2) @ have[:, :3, :3])
    assert np.abs(turn[ok]).max() < LEFT
    # without it, it would be off by what the errors are
    assert np.median(found.position_before) > 1e-4
    assert len(found.status) == len(found.q) == len(q)  # nothing is dropped
    named = "".join(found.sentences)
    assert all(one in ("reached", "singular", "limits", "out of reach") for one in found.status)
    assert bool(named) == (not ok.all())


def test_to_first_order_the_correction_is_one_newton_step():
    nominal, real, q, limits = case("six turns", 40)
    found = compensate(nominal, real, q, limits)
    T, J = joint_jacobian(real, q)
    want = nominal.poses(q)
    turn = log_so3(want[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2))
    off = np.hstack([want[:, :3, 3] - T[:, :3, 3], turn])
    step = np.linalg.solve(J, off[:, :, None])[..., 0]
    ok = found.corrected & (found.condition < 20)
    assert ok.sum() > 10
    # curvature: the square of steps of some mrad, times the condition
    np.testing.assert_allclose(found.step[ok], step[ok], atol=20 * np.abs(step[ok]).max() ** 2)


def test_a_robot_without_errors_needs_no_correction():
    nominal, _, q, limits = case("six turns")
    found = compensate(nominal, nominal, q, limits)
    assert (found.step == 0).all()


@pytest.mark.parametrize("name", ["six turns", "three slides"])
def test_a_controller_that_keeps_its_nominal_model_is_told_other_poses(name):
    nominal, real, q, limits = case(name)
    T = nominal.poses(q)
    found = corrected_poses(nominal, real, T, q, limits)
    ok = found.corrected
    assert ok.mean() > 0.9
    # the controller: its own inverse kinematics, from where it would be for the old target
    taken = inverse_kinematics(nominal, found.T[ok], q[ok], limits).q
    assert np.abs(real.poses(taken)[:, :3] - T[ok][:, :3]).max() < LEFT
    np.testing.assert_allclose(taken, found.q[ok], atol=1e-7)
    # both ways out are one: the joints are those of the joint correction
    direct = compensate(nominal, real, q, limits)
    both = ok & direct.corrected
    np.testing.assert_allclose(found.q[both], direct.q[both], atol=1e-7)


def test_a_target_at_a_joint_limit_is_listed_and_stays_inside():
    nominal, real, q, limits = case("six turns", 40)
    good = compensate(nominal, real, q, limits)
    k = int(np.flatnonzero(good.corrected)[0])
    joint = int(np.abs(good.step[k]).argmax())
    tight = limits.copy()
    edge = q[k, joint]
    # the target itself is just allowed, its correction is not
    tight[joint] = (edge, limits[joint, 1]) if good.step[k, joint] < 0 else (limits[joint, 0], edge)
    found = compensate(nominal, real, q[k : k + 1], tight)
    assert found.status == ("limits",)
    assert tight[joint, 0] <= found.q[0, joint] <= tight[joint, 1]
    assert found.position_error[0] <= found.position_before[0] + 1e-4
    assert "1 of 1 targets is reached only outside the joint limits" in found.sentences[0]


def test_a_wrist_in_line_is_named_for_its_large_moves():
    nominal, real, _, limits = case("six turns")
    q = np.array([[0.4, 0.6, 0.8, 0.3, 0.0005, -0.2], [0.4, 0.6, 0.8, 0.3, 0.7, -0.2]])
    found = compensate(nominal, real, q, limits)
    assert found.status == ("singular", "reached")
    assert np.abs(found.step[0]).max() > np.radians(5) or found.condition[0] > 1e3
    assert "(target 1)" in found.sentences[0]


def test_a_pose_out_of_reach_is_no_correction():
    nominal, real, q, limits = case("six turns", 2)
    T = nominal.poses(q).copy()
    T[1, :3, 3] = [2.0, 0, 0]
    found = corrected_poses(nominal, real, T, q, limits)
    assert found.status[1] == "out of reach"
    assert found.position_error[1] > 1.0
    assert len(found.T) == 2


def test_two_different_arms_are_refused():
    with pytest.raises(InputError, match="differ in their joints"):
        compensate(RobotModel(TX60), RobotModel(Chain(TX60.links[:5])), np.zeros((1, 6)), [])


def one_joint():
    """An arm of one turning joint, and the same with its zero off by a milliradian."""
    return (RobotModel(Chain([[theta, 0, 0.3, 0, 0]])) for theta in (0.0, 1e-3))


@pytest.mark.parametrize("target", [3.2, 6.0, 9.3, -3.2, -9.3])
def test_a_target_beyond_a_limit_is_no_target_a_turn_away(target):
    nominal, real = one_joint()
    found = compensate(nominal, real, [[target], [3.0]], [[-np.pi, np.pi]])
    assert found.status == ("limits", "reached")
    np.testing.assert_allclose(found.q[:, 0], [np.copysign(np.pi, target), 2.999], atol=1e-12)
    assert found.position_error[0] > 1e-3  # the tool is not there, and the numbers say so


@pytest.mark.parametrize("target", [1234.5, -1234.5, 5000.0])
def test_without_limits_joints_may_have_turned_many_times(target):
    nominal, real = one_joint()
    found = compensate(nominal, real, [[target], [0.3]])
    assert found.status == ("reached", "reached")
    # float64 of thousands of radians carries 1e-12
    np.testing.assert_allclose(found.step, -1e-3, atol=1e-11)


def test_conditions_of_another_number_of_targets_are_refused():
    nominal, real, q, limits = case("six turns", 2)
    five = OperatingConditions(payload=np.arange(5.0))
    for compensated in (
        lambda: compensate(nominal, real, q, limits, five),
        lambda: corrected_poses(nominal, real, nominal.poses(q), q, limits, five),
        lambda: inverse_kinematics(real, nominal.poses(q), q, limits, at=five),
    ):
        with pytest.raises(InputError, match="one for each of 2 poses"):
            compensated()


SCARA = Chain(
    [[0, 0.4, 0.325, 0, 0], [0, 0, 0.275, np.pi, 0], [0, 0, 0, 0, 0], [0, 0.05, 0, 0, 0]],
    ("revolute", "revolute", "prismatic", "revolute"),
)
LONG = TX60.links + np.array([0, 0, 0.1, 0, 0])
FEW = {
    "SCARA": SCARA,
    "five turns": Chain(LONG[:5], TX60.kinds[:5]),
    "three turns": Chain(LONG[:3], TX60.kinds[:3]),
}


def bent_and_programmed(chain, count=60):
    """Arm as drawn, what it really is, and targets where no joint is stretched or folded."""
    rng = np.random.default_rng(8)
    limits = np.where(chain.prismatic[:, None] > 0, [-0.2, 0.2], [0.3, 1.4])
    real = RobotModel(chain.moved(rng.normal(size=chain.n_numbers) * 3e-4))
    return RobotModel(chain), real, spread(limits, count)


@pytest.mark.parametrize("name", FEW)
def test_an_arm_of_few_joints_is_brought_to_the_position_and_as_near_to_the_rotation_as_it_goes(
    name,
):
    nominal, real, q = bent_and_programmed(FEW[name])
    found = compensate(nominal, real, q)
    assert found.corrected.mean() > 0.9
    ok = found.corrected
    want, have = nominal.poses(q)[ok], real.poses(found.q)[ok]
    assert np.median(found.position_before) > 3e-4
    assert np.abs((have - want)[:, :3, 3]).max() < LEFT
    # a second way: among joints near by with that position, none turns the tool nearer
    for k in range(3):
        here = found.q[ok][k]

        def apart(x, k=k):
            T = real.poses(x[None])[0]
            turn = log_so3(want[k, :3, :3] @ T[:3, :3].T)
            return np.concatenate([1e6 * (want[k, :3, 3] - T[:3, 3]), turn])

        best = least_squares(apart, q[ok][k], xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=1e-3)
        left = np.linalg.norm(apart(here)[3:])
        # 1e6 to 1 in place of angles that take nothing, and the end of the search: parts in 1e4
        assert left <= np.linalg.norm(best.fun[3:]) * (1 + 1e-3) + 1e-9
        np.testing.assert_allclose(here, best.x, atol=2e-6)


def test_poses_of_an_arm_of_few_joints_go_through_its_nominal_controller():
    nominal, real, q = bent_and_programmed(SCARA)
    limits = np.array([[-3, 3], [-3, 3], [-0.5, 0.5], [-7, 7.0]])
    found = corrected_poses(nominal, real, nominal.poses(q), q, limits)
    assert found.corrected.all()
    np.testing.assert_allclose(found.q, compensate(nominal, real, q).q, atol=1e-9)
    assert np.abs((real.poses(found.q) - nominal.poses(q))[:, :3, 3]).max() < LEFT


def test_a_position_that_few_joints_do_not_reach_is_not_called_reached():
    nominal, real, q = bent_and_programmed(Chain([[0, 0, 0.3, 0, 0], [0, 0, 0.2, 0, 0]]))
    found = compensate(nominal, real, q)  # two axes side by side leave the height as it is
    assert not found.corrected.any()
    assert (found.position_error > 1e-5).mean() > 0.9


def test_a_target_that_is_reached_in_a_nearly_singular_posture_is_counted_as_reached():
    nominal, real, q = bent_and_programmed(ARMS["six turns"])
    q = np.where(np.arange(6) == 4, np.where(np.arange(len(q))[:, None] < 2, 3e-3, 1.0), q)
    found = compensate(nominal, real, q)
    look = [one == "singular" for one in found.status]
    assert look[:2] == [True, True]
    assert found.position_error[:2].max() < LEFT
    reached, count = sum(look) + sum(found.corrected), len(q)
    assert repr(found).startswith(
        f"Correction({reached} of {count} targets, {sum(look)} of them in a nearly singular posture"
    )
