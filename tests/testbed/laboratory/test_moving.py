"""The arm that moves: at rest it is the sprung arm, and between it is a second way of its own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from testbed.laboratory.simulator import grown
from testbed.laboratory.truth.moving import MovingArm
from testbed.laboratory.truth.moving_spec import RINGING
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.springs import ElasticArm
from testbed.laboratory.truth.terms import Approach, Springs
from testbed.robots.catalog import load_robot
from testbed.robots.placements import link_poses
from tests.reference import DEG, tx60
from tests.testbed.laboratory.outcomes import settings

ROBOT = load_robot("staubli_tx60")
CHAIN = tx60().chain
SPRINGS = draw_truth(ROBOT, settings("elastic"), 0).unmodelled.springs
STIFF_BEARINGS = replace(SPRINGS, bearing=np.zeros(0))
FRICTION = np.array([3.0, 3.0, 1.5, 0.5, 0.35, 0.2])
Q = np.random.default_rng(5).uniform(*(0.7 * ROBOT.limits.T), (4, 6))
UP = np.full_like(Q, 10 * DEG)


def motion(speed=60.0, **changes) -> Approach:
    """Every joint at `speed` [deg/s], with changes."""
    values = {
        "speeds": np.full(6, speed * DEG),
        "tool_speed": 0.0,
        "approach": 10 * DEG,
        "dwell": 1.0,
        "friction": FRICTION,
        "damping": 0.05,
    }
    return Approach(**(values | changes))


def still(**changes) -> Approach:
    return motion(friction=np.zeros(6), **changes)


def um(step):
    return 1e6 * np.linalg.norm(step, axis=-1)


@pytest.mark.parametrize("springs", [SPRINGS, STIFF_BEARINGS], ids=["bearings", "drives"])
def test_without_friction_it_comes_to_rest_as_the_sprung_arm(springs):
    arm = MovingArm(CHAIN, springs, still(dwell=3.0, damping=0.7))
    rest = ElasticArm(CHAIN, springs)
    # 1e-6 um; what swings has died down by exp(-100)
    np.testing.assert_allclose(arm.poses(Q, travel=UP), rest.poses(Q), rtol=0, atol=1e-12)
    # who does not move is at rest at once
    for look in arm.looks(Q, 0 * UP, (0.0, 0.01)):
        np.testing.assert_allclose(look, rest.poses(Q), rtol=0, atol=1e-12)
    (angles,) = arm.deflections(Q, UP, (3.0,))
    np.testing.assert_allclose(angles, rest.deflections(Q), rtol=0, atol=1e-12)


def test_another_payload_comes_to_rest_as_on_the_sprung_arm_and_hangs_no_longer_than_asked():
    arm = MovingArm(CHAIN, SPRINGS, still(dwell=4.0, damping=0.7))
    rest, hung = ElasticArm(CHAIN, SPRINGS), np.array([0.0, 5.0, 2.0, 1.0])
    found = arm.poses(Q, travel=UP, payload=hung)
    # the dampers are those of the usual payload
    np.testing.assert_allclose(found, rest.poses(Q, payload=hung), rtol=0, atol=1e-12)
    np.testing.assert_allclose(arm.poses(Q, travel=UP), rest.poses(Q), rtol=0, atol=1e-12)


def test_one_drive_swings_as_its_equation_says():
    """I x'' + c x' + k (x - u(t)) = 0 about an upright axis, by another integrator."""
    inertia, k, ratio = 2.0, 2e4, 0.1
    body = Springs(
        np.array([5.0]), np.zeros((1, 3)), np.array([[inertia] * 3]), np.array([k]), np.zeros(0),
        1e-6, np.zeros(3),
    )  # fmt: skip
    chain = Chain([[0, 0.3, 0.5, 0, 0]], ("revolute",))
    how = motion(damping=ratio, speeds=np.array([60 * DEG]), friction=np.zeros(1))
    arm = MovingArm(chain, body, how, step=2e-5)
    total = inertia + k / RINGING + 1e-6 * 0.25
    c, way = 2 * ratio * np.sqrt(k * total), 10 * DEG
    end = 1.875 * way / (60 * DEG)

    def rate(t, state):
        s = min(t / end, 1.0)
        pull = k * (way * s**3 * (10 - 15 * s + 6 * s * s) - state[0])
        return [state[1], (pull - c * state[1]) / total]

    dwells = np.array([0.0, 0.05, 0.2])
    path = solve_ivp(rate, (0, end + 0.2), [0, 0], t_eval=end + dwells, rtol=1e-9, atol=1e-12)
    angles = arm.deflections(np.array([[way]]), np.array([[way]]), tuple(dwells))[:, 0, 0]
    assert np.abs(angles).max() > 1e-4
    # first order in the step: two of them at 95 rad/s are 4e-3 of the swing
    np.testing.assert_allclose(angles, path.y[0] - way, rtol=0, atol=4e-3 * np.abs(angles).max())


def inertias(q):
    """Mass matrices (m, 6, 6) of the arm with payload and gears at q (m, 6), by own kinematics."""
    link = link_poses(CHAIN, q)[:, 1:]
    axes, origins = link[:, :, :3, 2], link[:, :, :3, 3]
    flange = RobotModel(replace(CHAIN, T_flange_tool=np.eye(4))).poses(q)
    center = SPRINGS.payload_center
    bodies = [
        (i, SPRINGS.masses[i], link[:, i], SPRINGS.centers[i], SPRINGS.inertias[i])
        for i in range(6)
    ]
    bodies.append((5, SPRINGS.payload, flange, center, np.full(3, 1e-3 * SPRINGS.payload)))
    out = np.tile(np.diag(SPRINGS.drive / RINGING), (len(q), 1, 1))
    for last, mass, T, place, moments in bodies:
        turn = axes * (np.arange(6) <= last)[:, None]
        arm = (T[:, :3, :3] @ place + T[:, :3, 3])[:, None] - origins
        shift, local = np.cross(turn, arm), turn @ T[:, :3, :3]
        out += mass * shift @ shift.transpose(0, 2, 1)
        out += (local * moments) @ local.transpose(0, 2, 1)
    return out


def test_six_drives_ring_out_in_the_modes_of_the_mass_matrix():
    """M x'' + C x' + K x = 0 about rest, with the matrix of another kinematics."""
    arm, h = MovingArm(CHAIN, STIFF_BEARINGS, still(damping=0.02)), 1e-3
    window = np.array([0.1, 0.11, 0.13, 0.15])
    dwells = tuple(sorted([window[0] - h, window[0] + h, *window]))
    looks = arm.deflections(Q, UP, dwells) - ElasticArm(CHAIN, STIFF_BEARINGS).deflections(Q)
    before, start, after, *later = looks
    turns = np.random.default_rng(1).uniform(-np.pi, np.pi, (500, 6))
    felt = np.einsum("mii->i", inertias(turns)) / 500
    C = np.diag(2 * 0.02 * np.sqrt(SPRINGS.drive * felt))
    for k, M in enumerate(inertias(Q)):
        rate = np.block(
            [
                [np.zeros((6, 6)), np.eye(6)],
                [-np.linalg.solve(M, np.diag(SPRINGS.drive)), -np.linalg.solve(M, C)],
            ]
        )
        state = np.concatenate([start[k], (after[k] - before[k]) / (2 * h)])
        for t, found in zip(window[1:] - window[0], later, strict=True):
            expected = (expm(rate * t) @ state)[:6]
            # speeds from differences over 2 ms at up to 300 rad/s are 1.5 % too low
            assert np.abs(found[k] - expected).max() < 0.03 * np.abs(start[k]).max() + 1e-7


def test_slowly_approached_each_drive_is_held_back_by_its_friction():
    # at 2 deg/s nothing swings: the springs hold up to the friction, on the side they came from
    arm = MovingArm(CHAIN, SPRINGS, motion(2.0, approach=1 * DEG))
    up, down = (arm.deflections(Q, side * UP, (0.5,))[0] for side in (1, -1))
    away = (down - up).reshape(-1, 6, 3)
    # less what is still unwound in its damper and slips while it is held: 5 %
    np.testing.assert_allclose(
        away[:, :, 0], np.tile(2 * FRICTION / SPRINGS.drive, (4, 1)), rtol=0.05
    )
    middle = (up + down) / 2 - ElasticArm(CHAIN, SPRINGS).deflections(Q)
    assert np.abs(middle).max() < 0.01 * np.abs(away).max()


def hysteresis(share: float, **changes):
    """How far (m,) both ways to a pose end apart with a share of the friction [um]."""
    arm = MovingArm(CHAIN, STIFF_BEARINGS, motion(friction=share * FRICTION, **changes))
    up, down = (arm.poses(Q, travel=side * UP)[:, :3, 3] for side in (1, -1))
    return um(up - down)


def test_hysteresis_doubles_with_friction():
    # slowly: swinging shakes some of it off, pose by pose
    slow = {"speeds": np.full(6, 5 * DEG), "approach": 3 * DEG, "dwell": 0.3}
    once, twice = (hysteresis(share, **slow) for share in (1.0, 2.0))
    assert once.mean() > 20
    np.testing.assert_allclose(twice / once, 2, rtol=0.1)


def test_dry_friction_holds_and_does_not_creep():
    arm = MovingArm(CHAIN, STIFF_BEARINGS, motion(5.0, approach=3 * DEG))
    up, down = (arm.looks(Q[:2], side * UP[:2], (0.2, 4.0))[..., :3, 3] for side in (1, -1))
    soon, late = um(up - down)
    # without noslip iterations half of it is gone
    assert (late > 0.97 * soon).all()


def test_without_friction_both_ways_end_at_one_place():
    assert hysteresis(0.0, damping=0.1).mean() < 0.1


def test_who_waits_sees_the_arm_come_to_rest():
    arm = MovingArm(CHAIN, STIFF_BEARINGS, motion(120.0, approach=20 * DEG))
    looks = arm.looks(Q, UP * 2 * np.array([1, -1, 1, 1, -1, 1]), (0.0, 0.3, 1.0, 4.0))
    away = um(looks[:3, :, :3, 3] - looks[3, :, :3, 3]).mean(axis=1)
    assert away[0] > 20
    assert (np.diff(away) <= 0).all()
    assert away[2] < 1


@pytest.mark.parametrize("springs", [SPRINGS, STIFF_BEARINGS], ids=["bearings", "drives"])
def test_a_tenth_of_the_step_ends_at_the_same_place(springs):
    ends = [
        MovingArm(CHAIN, springs, motion(dwell=0.5), step=step).poses(Q[:2], travel=UP[:2])
        for step in (1e-3, 1e-4)
    ]
    assert um(ends[0][:, :3, 3] - ends[1][:, :3, 3]).max() < 1.5


def test_an_approach_knows_nothing_of_those_before():
    how, travel = motion(dwell=0.1), UP * [[1.0], [-1.0], [0.5], [0.0]]
    first = MovingArm(CHAIN, SPRINGS, how).poses(Q, travel=travel)
    other = MovingArm(CHAIN, SPRINGS, how)
    warm = other.poses(Q, travel=travel, growth=np.full(4, 1e-4))
    fresh = MovingArm(CHAIN, SPRINGS, how)
    fresh.poses(Q[:1], travel=-travel[:1], growth=np.full(1, 2e-4))
    np.testing.assert_array_equal(fresh.poses(Q[::-1], travel=travel[::-1])[::-1], first)
    np.testing.assert_array_equal(other.poses(Q, travel=travel), first)
    assert (warm != first).any()


def test_scatter_and_warmth_leave_the_bends_alone():
    """What is added after the approach against the approach played there: much less than noise."""
    arm, off = MovingArm(CHAIN, SPRINGS, motion(2.0, approach=1 * DEG)), np.full_like(Q, 2e-5)
    added = arm.poses(Q, travel=UP, scatter=off)[:, :3, 3]
    assert um(added - arm.poses(Q + off, travel=UP)[:, :3, 3]).max() < 0.05
    longer = MovingArm(grown(CHAIN, 5e-5), SPRINGS, arm.motion).poses(Q, travel=UP)
    warm = arm.poses(Q, travel=UP, growth=np.full(4, 5e-5))
    assert um(warm[:, :3, 3] - longer[:, :3, 3]).max() < 0.05
    assert um(warm[:, :3, 3] - arm.poses(Q, travel=UP)[:, :3, 3]).min() > 5


def test_an_approach_is_as_fast_as_joints_and_tool_may_be():
    speeds = np.array([60, 60, 60, 5, 60, 60]) * DEG
    travel = UP * [3, -1, 2, 0.2, 1, 0]  # the last third of the way: 10 deg of joint 1
    arm = MovingArm(CHAIN, SPRINGS, motion(speeds=speeds))
    np.testing.assert_allclose(arm.durations(Q, travel), 1.875 / 6, rtol=1e-12)  # joint 1
    alone = np.zeros_like(UP)
    alone[:, 3] = UP[:, 3]
    np.testing.assert_allclose(arm.durations(Q, alone), 1.875 * 2, rtol=1e-12)
    np.testing.assert_array_equal(arm.durations(Q, 0 * UP), 0)
    slow = MovingArm(CHAIN, SPRINGS, motion(speeds=speeds, tool_speed=0.0625))
    share = np.linspace(0, 1, 2001)[:, None]
    for k, seconds in enumerate(slow.durations(Q, travel)):
        path = RobotModel(CHAIN).poses(Q[k] - travel[k] / 3 * share)[:, :3, 3]
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        # 16 chords of an arc of 10 deg a joint, 30 deg in all: (0.5 / 16)^2 / 24 shorter
        assert seconds == pytest.approx(1.875 * length / 0.0625, rel=1e-4)


def test_springs_that_break_and_moves_without_end_are_refused():
    soft = replace(SPRINGS, drive=SPRINGS.drive / 100)
    with pytest.raises(InputError, match=r"gives way at q\[0\].*raise drive_nm_per_mrad"):
        MovingArm(CHAIN, soft, motion()).poses(Q, travel=UP)
    stuck = motion(friction=np.full(6, 1e5))
    with pytest.raises(InputError, match=r"gives way at q\[0\]"):
        MovingArm(CHAIN, SPRINGS, stuck).poses(Q, travel=UP)
    with pytest.raises(
        InputError, match=r"the approach to q\[\d\] takes .* s; expected at most 60 s"
    ):
        MovingArm(CHAIN, SPRINGS, motion(tool_speed=1e-4)).poses(Q, travel=UP)


def test_the_true_robot_moves_as_its_scenario_says():
    rest, calm = (
        draw_truth(ROBOT, settings(preset, **changes), 3)
        for preset, changes in (
            ("elastic", {}),
            ("moving", {"friction_nm": 0.0, "damping": 0.7, "dwell_s": 3.0}),
        )
    )
    before = Q - UP
    np.testing.assert_allclose(
        calm.poses(Q[:1], previous=before[:1]), rest.poses(Q[:1]), rtol=0, atol=1e-12
    )
    changes = {"speed_mm_s": 62.5, "approach_deg": 2.0, "joint_repeatability_mdeg": 0.8}
    truth = settings("moving", **changes)
    true, again = draw_truth(ROBOT, truth, 3), draw_truth(ROBOT, truth, 3)
    found = true.unmodelled.motion
    np.testing.assert_allclose(found.friction, FRICTION)
    assert (found.dwell, found.tool_speed, found.damping) == (1.0, 0.0625, 0.05)
    assert (found.speeds == np.minimum(60 * DEG, ROBOT.speeds)).all()
    there = true.poses(Q, previous=before)
    np.testing.assert_array_equal(again.poses(Q, previous=before), there)
    # each way has its own end, and every approach its own scatter about it
    assert um((there - true.poses(Q, previous=Q + UP))[:, :3, 3]).min() > 5
    off = true.poses(Q, previous=before, rng=np.random.default_rng(0)) - there
    assert 1 < um(off[:, :3, 3]).mean() < 50
