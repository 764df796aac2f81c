"""The sprung arm at rest: against the rigid chain, its energy, its own motion, and K^-1 tau(q)."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.bodies import bent_forward
from calib.geometry.chain import Chain
from calib.geometry.frames import rot_x, rot_y, slide
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from testbed.laboratory.simulator import grown
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.springs import ElasticArm, elastic_names, elastic_spec
from testbed.laboratory.truth.terms import Springs, gravity_loads, only
from testbed.robots.catalog import load_robot
from testbed.robots.placements import link_poses
from tests.reference import TX60_LIMITS, pool_r, tx60
from tests.testbed.laboratory.outcomes import settings

ROBOT = load_robot("staubli_tx60")
CHAIN = tx60().chain
Q = pool_r()[:60]
DRIVE = np.array([9e4, 9e4, 4e4, 1.2e4, 1e4, 6e3])
BEARING = np.array([6e5, 5e5, 3e5, 1e5, 8e4, 5e4])


def springs(**changes) -> Springs:
    """Those of the preset, with changes."""
    values = {
        "masses": ROBOT.masses,
        "centers": ROBOT.centers,
        "inertias": ROBOT.inertias,
        "drive": DRIVE,
        "bearing": BEARING,
        "payload": 2.0,
        "payload_center": [0.0, 0.0, 0.05],
    }
    return Springs(**(values | changes))


@pytest.mark.parametrize("bearing", [BEARING, np.zeros(0)], ids=["bearings", "drives"])
def test_its_bends_put_the_stiff_chain_where_it_stands(bearing):
    arm = ElasticArm(perturbed(), springs(bearing=bearing))
    bends = arm.bends(Q)
    assert (bends[:, :, :2] != 0).any() == bool(len(bearing))
    np.testing.assert_allclose(bent_forward(perturbed(), Q, bends), arm.poses(Q), atol=1e-14)


def test_another_payload_hangs_as_on_an_arm_made_for_it_and_pulls_with_its_lever():
    arm, hung = ElasticArm(CHAIN, springs()), np.array([0.0, 5.0, 2.0, 0.5] * 15)
    found = arm.poses(Q, payload=hung)
    for mass in np.unique(hung):
        made = ElasticArm(CHAIN, springs(payload=mass)).poses(Q[hung == mass])
        np.testing.assert_allclose(found[hung == mass], made, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(arm.poses(Q), ElasticArm(CHAIN, springs()).poses(Q))
    # drives alone, to first order: the weight's work on each joint over its stiffness
    stiff = springs(bearing=np.zeros(0))
    load = RobotModel(replace(CHAIN, T_flange_tool=slide(0, 0, 0.05)))
    _, J = load.poses_and_jacobian(Q)
    falls = J[:, 2, joint_columns(CHAIN)] * -9.81 * 3.0 / DRIVE
    _, own = RobotModel(CHAIN).poses_and_jacobian(Q)
    expected = (own[:, :3, joint_columns(CHAIN)] @ falls[:, :, None])[:, :, 0]
    arm = ElasticArm(CHAIN, stiff)
    moved = arm.poses(Q, payload=np.full(60, 5.0)) - arm.poses(Q)
    assert np.abs(expected).max() > 1e-4
    # the springs stand a thousandth elsewhere
    np.testing.assert_allclose(moved[:, :3, 3], expected, atol=3e-3 * np.abs(expected).max())


def perturbed() -> Chain:
    return CHAIN.moved(np.random.default_rng(3).normal(0, 1e-2, 42))


def anywhere(m: int) -> Array:
    return np.random.default_rng(1).uniform(*TX60_LIMITS.T, (m, 6))


@pytest.mark.parametrize("chain", [CHAIN, perturbed()])
@pytest.mark.parametrize("bearing", [BEARING, ()])
def test_without_gravity_it_is_the_rigid_chain(chain, bearing):
    arm = ElasticArm(chain, springs(gravity=[0, 0, 0], bearing=bearing))
    q = anywhere(200)
    np.testing.assert_allclose(arm.poses(q), RobotModel(chain).poses(q), atol=1e-12)
    assert not arm.deflections(q).any()


def test_stiffer_springs_give_way_less_and_in_the_limit_not_at_all():
    rigid = tx60().poses(Q)
    droop = [
        np.abs(ElasticArm(CHAIN, springs(drive=s * DRIVE, bearing=s * BEARING)).poses(Q) - rigid)
        for s in (1.0, 10.0, 1e9)
    ]
    # to first order a tenth; the second order is the droop itself, 1e-3
    assert droop[1].max() == pytest.approx(droop[0].max() / 10, rel=5e-3)
    assert droop[2].max() < 1e-11


def test_at_rest_the_energy_of_weight_and_springs_is_lowest():
    import mujoco

    arm = ElasticArm(perturbed(), springs())
    model, names = arm.model, elastic_names(6, bearings=True)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data, at = mujoco.MjData(model), [model.joint(name).qposadr[0] for name in names]

    def energy(q: Array, angles: Array) -> float:
        data.qpos[: 6 * 4] = 0
        data.qpos[[model.joint(f"joint{i + 1}").qposadr[0] for i in range(6)]] = q
        data.qpos[at] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_energyPos(model, data)
        return float(data.energy[0])

    def slope(q: Array, rest: Array, step: Array) -> float:
        wide, narrow = (
            (energy(q, rest + s * step) - energy(q, rest - s * step)) / (2 * s) for s in (2, 1)
        )
        return (4 * narrow - wide) / 3  # third derivatives cancel

    h = 2e-3
    for q, rest in zip(Q[:20], arm.deflections(Q[:20]), strict=True):
        for e in np.eye(18):
            # energies of 200 J are rounded to 3e-14: 2e-11 N m after division by 2 h; the fifth
            # derivative of the weight, below 100 N m, leaves 100 h^4 / 30 = 5e-11 N m; torques: 90
            assert abs(slope(q, rest, h * e)) / h < 1e-9
            up, here, down = (energy(q, rest + s * h * e) for s in (1, 0, -1))
            assert up + down > 2 * here  # a lowest point, not only a flat one


def test_it_comes_to_rest_there_when_it_is_left_to_swing():
    import mujoco

    q = Q[7]
    arm = ElasticArm(CHAIN, springs())
    spec = elastic_spec(CHAIN, springs())
    for joint in spec.joints:
        if joint.name.startswith("joint"):
            joint.armature = 1e9  # the commanded hinges stand still
        else:
            joint.damping = [30.0, 0, 0]
    spec.option.integrator, spec.option.timestep = mujoco.mjtIntegrator.mjINT_DISCRETE, 1e-3
    model = spec.compile()
    data = mujoco.MjData(model)
    names = elastic_names(6, bearings=True)
    driven = [model.joint(f"joint{i + 1}").qposadr[0] for i in range(6)]
    sprung = [model.joint(name).qposadr[0] for name in names]
    for _ in range(4000):
        data.qpos[driven], data.qvel[driven] = q, 0.0
        mujoco.mj_step(model, data)
    rest = arm.deflections(q[None])[0]
    assert np.abs(data.qvel[sprung]).max() < 1e-9
    assert np.abs(rest).max() > 1e-4
    np.testing.assert_allclose(data.qpos[sprung], rest, rtol=0, atol=1e-9)


def loads(chain: Chain, q: Array) -> Array:
    """Torque (m, 6) of the weight of arm and payload about each axis [N m], by own kinematics."""
    flange = np.eye(4)
    flange[:3, :3], d = np.eye(3), 0.070  # the last body is turned as the flange, 70 mm below it
    masses = ROBOT.masses.copy()
    masses[5] += 2.0
    centers = ROBOT.centers.copy()
    centers[5] = (0.7 * centers[5] + 2.0 * np.array([0, 0, d + 0.05])) / 2.7
    return gravity_loads(chain, masses, centers, q)


def test_sprung_drives_alone_give_way_by_torque_over_stiffness_to_first_order():
    # the difference is second order: it falls with the square of the compliance
    off = []
    for s in (1.0, 10.0):
        found = ElasticArm(CHAIN, springs(bearing=(), drive=s * DRIVE)).deflections(Q)
        expected = loads(CHAIN, Q) / (s * DRIVE)
        off.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert off[0] < 3e-3
    assert off[1] == pytest.approx(off[0] / 10, rel=0.05)


def test_bearings_give_way_across_the_axis_by_torque_over_stiffness_to_first_order():
    stiff = np.full(6, 1e15)
    found = ElasticArm(CHAIN, springs(drive=stiff, payload=0.0)).deflections(Q).reshape(-1, 6, 3)
    bodies = link_poses(CHAIN, Q)[:, 1:]
    origins, R = bodies[:, :, :3, 3], bodies[:, :, :3, :3]
    places = origins + (R @ ROBOT.centers[:, :, None])[..., 0]
    for i in range(6):
        weight = np.array([0, 0, -9.81]) * ROBOT.masses[i:, None]
        torque = np.cross(places[:, i:] - origins[:, i, None], weight).sum(axis=1)
        along = (np.swapaxes(R[:, i], 1, 2) @ torque[:, :, None])[:, :, 0]  # body axes
        # second order: the droop itself, a few 1e-4, of the largest angle
        np.testing.assert_allclose(found[:, i, 1:], along[:, :2] / BEARING[i], atol=2e-7)
    assert np.abs(found[:, :, 1:]).max() > 1e-4
    assert np.abs(found[:, :, 0]).max() < 1e-12


def test_with_mass_on_the_arm_line_only_the_closed_form_holds_but_not_with_the_real_masses():
    """The two-sine form of a candle: dq2 = g1 sin q2 + g2 sin(q2+q3), dq3 = g3 sin(q2+q3)."""
    q = anywhere(50)
    centers = np.zeros((6, 3))
    centers[1] = [0.135, 0, 0]
    light = np.array([1e-9, 11.0, 1e-9, 1e-9, 5.0, 1e-9])  # the wrist center, 310 mm up

    def misfit(masses: Array, centers: Array) -> float:
        tau = gravity_loads(CHAIN, masses, centers, q)[:, 1]
        waves = np.stack([np.sin(q[:, 1]), np.sin(q[:, 1] + q[:, 2])], axis=1)
        rest = tau - waves @ np.linalg.lstsq(waves, tau, rcond=None)[0]
        return float(np.abs(rest).max() / np.abs(tau).max())

    assert misfit(light, centers) < 1e-9
    assert misfit(ROBOT.masses, ROBOT.centers) > 1e-3


def test_the_preset_droops_by_20_to_80_mdeg_at_axes_2_and_3():
    true = draw_truth(ROBOT, settings("elastic"), 0)
    droop = np.degrees(np.abs(true.simulator.deflections(pool_r()[:500]))).reshape(-1, 6, 3) * 1e3
    for axis in (1, 2):
        assert 20 < droop[:, axis, 0].max() < 80


def test_a_payload_pulls_by_its_weight_at_its_place():
    bare, loaded = (ElasticArm(CHAIN, springs(bearing=(), payload=m)) for m in (0.0, 3.0))
    added = loaded.deflections(Q) - bare.deflections(Q)
    T = tx60().poses(Q)
    p = T[:, :3, 3] + T[:, :3, 2] * 0.05
    J = tx60().poses_and_jacobian(Q)[1]
    turn = J[:, 3:, [6 + 5 * i for i in range(6)]]
    shift = J[:, :3, [6 + 5 * i for i in range(6)]] + np.cross(
        turn, (p - T[:, :3, 3])[:, :, None], axis=1
    )
    expected = -3.0 * 9.81 * shift[:, 2] / DRIVE
    np.testing.assert_allclose(added, expected, atol=3e-3 * np.abs(expected).max())


def test_the_order_of_poses_does_not_matter():
    arm = ElasticArm(CHAIN, springs())
    np.testing.assert_array_equal(arm.poses(Q), arm.poses(Q[::-1])[::-1])


def test_a_tilted_robot_droops_another_way():
    wall = replace(CHAIN, T_world_base=rot_y(np.pi / 2))
    # hanging from a wall, axis 1 is level and carries weight too
    assert np.abs(ElasticArm(wall, springs()).deflections(Q)[:, 0]).max() > 1e-5
    assert np.abs(ElasticArm(CHAIN, springs()).deflections(Q)[:, 0]).max() < 1e-18
    # turned with gravity it is the same arm
    R = rot_x(0.7)
    turned = replace(CHAIN, T_world_base=R)
    both = ElasticArm(turned, springs(gravity=R[:3, :3] @ [0, 0, -9.81]))
    np.testing.assert_allclose(
        both.deflections(Q), ElasticArm(CHAIN, springs()).deflections(Q), atol=1e-15
    )


def test_a_warm_sprung_arm_is_the_longer_sprung_arm():
    arm, longer = ElasticArm(CHAIN, springs()), ElasticArm(grown(CHAIN, 1e-3), springs())
    np.testing.assert_allclose(arm.poses(Q, growth=np.full(60, 1e-3)), longer.poses(Q), atol=1e-12)
    np.testing.assert_allclose(
        arm.poses(Q, growth=np.zeros(60)), ElasticArm(CHAIN, springs()).poses(Q), atol=1e-12
    )


def test_the_true_robot_is_the_sprung_arm_of_its_scenario():
    truth = only(settings("elastic"), "elastic")
    true = draw_truth(ROBOT, truth, 0)
    expected = ElasticArm(CHAIN, springs())
    np.testing.assert_allclose(true.poses(Q), expected.poses(Q), atol=1e-12)
    lower = true.poses(Q)[:, 2, 3] < ROBOT.model.poses(Q)[:, 2, 3]
    assert lower.mean() > 0.95  # it may rise a little where a wrist turns it up


def test_springs_that_cannot_carry_the_arm_are_refused():
    q = np.full((1, 6), 0.5)
    for share in (1e-2, 1e-3, 1e-5):  # bends too far; further; falls over
        with pytest.raises(InputError, match=r"gives way at q\[0\].*raise drive_nm_per_mrad"):
            ElasticArm(CHAIN, springs(drive=share * DRIVE)).poses(q)


def test_a_payload_that_was_too_much_does_not_stay_on_the_arm():
    arm = ElasticArm(CHAIN, springs())
    usual = arm.poses(Q)
    with pytest.raises(InputError, match="gives way"):
        arm.poses(Q, payload=np.full(60, 200.0))
    np.testing.assert_array_equal(arm.poses(Q), usual)
