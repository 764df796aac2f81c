"""The terms beyond geometry, sag and gear: each is its formula, and none moves another."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import rot_x
from calib.geometry.model import RobotModel
from testbed.laboratory.simulator import grown
from testbed.laboratory.truth.budget import truth_budget
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.setting import in_turn, journey
from testbed.laboratory.truth.terms import (
    GRAVITY,
    TERM_KEYS,
    gravity_loads,
    last_moves,
    only,
    terms_of,
)
from testbed.robots.catalog import Robot
from testbed.robots.placements import link_poses
from testbed.streams import stream
from tests.reference import DEG, pool_r, tx60
from tests.testbed.laboratory.outcomes import settings

Q = pool_r()[:200]
MDEG = 1e-3 * DEG
HOME = np.zeros((200, 6))
ALL = {
    "high_harmonic_mdeg": 2.5,
    "transmission_mdeg": 3.0,
    "encoder_mdeg": 0.5,
    "gear_mdeg": 2.0,
    "backlash_mdeg": 8.0,
    "thermal_k": 2.0,
    "frame_sd_mm": 0.1,
    "joint_repeatability_mdeg": 0.8,
}
"""Every term at once, but for the springs, which take the place of gravity."""


def offsets(robot: Robot, seed: int = 7, **changes):
    """Joint offsets (m, 6) of a truth that has no geometric error [rad]."""
    true = draw_truth(robot, settings("rigid", angle_sd_deg=0, length_sd_mm=0, **changes), seed)
    dq = true.model.joint_errors.offsets(Q)
    play = true.unmodelled.backlash
    return dq if play is None else dq + play.offsets(Q, np.sign(Q))


def test_high_harmonics_are_three_and_seven_times_a_turn(robot):
    phi3, phi7 = stream(7, "truth", "high harmonics").uniform(0, 2 * np.pi, (6, 2)).T
    expected = 2.5 * MDEG * (np.sin(3 * Q + phi3) + 0.6 * np.sin(7 * Q + phi7))
    # offsets of 1e-4 rad; phases up to 30 rad are rounded to 4e-15
    np.testing.assert_allclose(offsets(robot, high_harmonic_mdeg=2.5), expected, atol=1e-18)


def test_a_transmission_errs_at_all_its_waves_and_no_other(robot):
    truth = settings("rigid", transmission_mdeg=[8, 8, 4, 4, 0, 2], transmission_waves=[12, 30])
    turn = np.arange(256) / 256 * 2 * np.pi
    drawn = np.array(
        [
            draw_truth(robot, truth, seed).model.joint_errors.offsets(
                np.repeat(turn[:, None], 6, axis=1)
            )
            for seed in range(40)
        ]
    )
    wave = np.abs(np.fft.rfft(drawn, axis=1)) / 128
    outside = [k for k in range(129) if not 12 <= k <= 30]
    assert wave[:, outside].max() < 1e-17  # rounding of 1e-4 rad
    assert (wave[:, 12:31, [0, 1, 2, 3, 5]] > 0).all()
    assert not drawn[:, :, 4].any()
    # one standard deviation anywhere on the turn; 1520 coefficients a joint give 1.8 %, four times
    sd = np.sqrt((drawn**2).mean(axis=(0, 1)))
    np.testing.assert_allclose(sd / MDEG, [8, 8, 4, 4, 0, 2], rtol=0.073)


def test_the_encoder_repeats_its_error_at_every_return(robot):
    size = [1.0, 2.0, 0.0, 0.5, 3.0, 1.5]
    found = offsets(robot, encoder_mdeg=size, encoder_periods=512)
    phase = stream(7, "truth", "encoder").uniform(0, 2 * np.pi, (6, 1))[:, 0]
    # 512 q is 2400 rad at most, rounded to 2e-13 of a full wave of 5e-5 rad
    np.testing.assert_allclose(found, np.array(size) * MDEG * np.sin(512 * Q + phase), atol=1e-16)
    # between two poses it looks like noise: white over 200 poses, with the rms of a sine
    assert np.sqrt((found[:, 4] ** 2).mean()) == pytest.approx(3 * MDEG / np.sqrt(2), rel=0.2)
    neighbors = np.corrcoef(found[:-1, 4], found[1:, 4])[0, 1]
    assert abs(neighbors) < 4 / np.sqrt(200)


def test_a_gear_errs_once_and_twice_a_turn_of_its_motor_whole_ratio_or_not(robot):
    size, ratio = np.array([6.0, 5.0, 4.0, 0.0, 2.0, 1.0]), np.array([101, 81, 60.5, 50.4, 50.4, 3])
    found = offsets(robot, gear_mdeg=tuple(size), gear_ratio=tuple(ratio))
    once, twice = stream(7, "truth", "gear").uniform(0, 2 * np.pi, (6, 2)).T
    turns = np.sin(ratio * Q + once) + 0.5 * np.sin(2 * ratio * Q + twice)
    # 202 q is 1000 rad at most, rounded to 1e-13 of a full wave of 1e-4 rad
    np.testing.assert_allclose(found, size * MDEG * turns, rtol=0, atol=1e-16)
    one = offsets(robot, gear_mdeg=2.0, gear_ratio=50.4)
    # a turn of the joint is no whole number of waves
    true = draw_truth(robot, settings("gears"), 7).model.joint_errors
    assert np.abs(true.offsets(Q) - true.offsets(Q + 2 * np.pi))[:, 4].max() > 1e-5
    assert (np.abs(one).max(axis=0) <= 3 * MDEG).all()


def test_play_goes_by_the_direction_of_the_last_move(robot):
    width = [8.0, 4.0, 2.0, 0.0, 6.0, 1.0]
    true = draw_truth(robot, settings("rigid", backlash_mdeg=width), 0)
    step = np.array([0.1, -0.2, 0.3, 0.4, 0.0, -1e-9])
    half = np.array(width) / 2 * MDEG
    play = true.unmodelled.backlash.offsets(Q, np.sign(Q - (Q - step)))
    np.testing.assert_array_equal(play, np.tile(half * [1, -1, 1, 1, 0, -1], (200, 1)))
    # reached from both sides, a posture differs by the whole play
    there, back = (true.poses(Q[:1], previous=Q[:1] + side) for side in (0.5, -0.5))
    stiff = draw_truth(robot, settings("rigid"), 0)
    np.testing.assert_allclose(there, stiff.poses(Q[:1] - half), atol=1e-12)
    np.testing.assert_allclose(back, stiff.poses(Q[:1] + half), atol=1e-12)
    np.testing.assert_array_equal(true.poses(Q), true.poses(Q, previous=HOME))


def test_a_joint_that_stays_keeps_the_side_it_came_from():
    """Also where others move: as the rows say, which `approaches` reads off them."""
    q = np.array([[0.0, 1.0], [0.5, 1.0], [0.5, 1.0], [0.5, 0.4], [0.3, 0.4]])
    moves = last_moves(q)
    np.testing.assert_array_equal(moves, [[0, 1], [1, 1], [1, 1], [1, -1], [-1, -1]])
    np.testing.assert_array_equal(moves, in_turn(q).approach)
    assert last_moves(q[:0]).shape == (0, 2)
    drawn = np.random.default_rng(0).uniform(-1, 1, (50, 6))
    before = np.vstack([np.zeros(6), drawn[:-1]])
    np.testing.assert_array_equal(last_moves(drawn), np.sign(drawn - before))


def test_the_arm_stays_in_its_play_while_one_joint_turns_alone(robot):
    true = draw_truth(robot, settings("rigid", backlash_mdeg=8.0), 0)
    q = np.tile([0.3, -0.4, 1.2, 0.5, 0.7, 0.0], (4, 1))
    q[:, 5] = [0.1, 0.2, 0.3, 0.4]
    way = journey(q, 0.0, 10.0)
    stiff = draw_truth(robot, settings("rigid"), 0)
    half = 4 * MDEG * np.array([1, -1, 1, 1, 1, 1])
    np.testing.assert_allclose(true.poses(q, **way._asdict()), stiff.poses(q + half), atol=1e-12)


def test_play_goes_by_posture_as_specified(robot):
    expected = np.zeros((200, 6))
    expected[:, 2] = 4 * MDEG * np.tanh(20 * np.sin(Q[:, 1] + Q[:, 2]))
    expected[:, 4] = 4 * MDEG * np.sign(np.cos(Q[:, 3]) * np.sin(Q[:, 4]))
    found = offsets(robot, backlash_mdeg=[0, 0, 8, 0, 8, 0], backlash_side="posture")
    np.testing.assert_allclose(found, expected, atol=1e-18)


def potential(robot: Robot, q):
    """Potential energy (m,) of the bodies [J]."""
    bodies = link_poses(robot.model.chain, q)[:, 1:]
    places = bodies[:, :, :3, 3] + (bodies[:, :, :3, :3] @ robot.centers[:, :, None])[..., 0]
    return GRAVITY * places[:, :, 2] @ robot.masses


def test_the_load_of_a_joint_is_how_fast_its_weight_falls(robot):
    h, load = 1e-5, gravity_loads(robot.model.chain, robot.masses, robot.centers, Q)
    for i, e in enumerate(np.eye(6)):
        slope = (potential(robot, Q + h * e) - potential(robot, Q - h * e)) / (2 * h)
        # central differences of energies of 200 J: rounding 5e-9, truncation 1e-8
        np.testing.assert_allclose(load[:, i], -slope, atol=1e-7)
    slider = Chain([[0, 0.3, 0, 0, 0]], ("prismatic",), T_world_base=rot_x(np.pi))
    falls = gravity_loads(slider, np.array([2.0]), np.zeros((1, 3)), np.zeros((1, 1)))
    assert falls[0, 0] == pytest.approx(2 * GRAVITY)  # its axis points down


def test_play_goes_by_the_load_where_gravity_decides(robot):
    true = draw_truth(robot, settings("rigid", backlash_mdeg=8.0, backlash_side="load"), 0)
    side = true.unmodelled.backlash.sides(Q, np.sign(Q))
    load = gravity_loads(robot.model.chain, robot.masses, robot.centers, Q)
    assert not side[:, 0].any()  # nothing pulls a vertical axis
    assert not side[:, 5].any()  # nor one with its mass on it
    for i in (1, 2, 4):
        heavy = np.abs(load[:, i]) > 0.15 * true.unmodelled.backlash.largest[i]
        np.testing.assert_allclose(side[heavy, i], np.sign(load[heavy, i]), atol=0.006)  # tanh 3
    # where it hangs over, joint 3 rests on the side towards which the closed form droops
    assert np.corrcoef(side[:, 2], np.sin(Q[:, 1] + Q[:, 2]))[0, 1] > 0.8


def test_the_robot_grows_while_it_warms_up(robot):
    settings_ = settings("rigid", thermal_k=2.0, angle_sd_deg=0, length_sd_mm=0)
    true = draw_truth(robot, settings_, 0)
    time = np.array([0.0, 600.0, 3600.0, 1e9])
    q = np.repeat(np.zeros((1, 6)), 4, axis=0)
    z = true.poses(q, time=time)[:, 2, 3]
    growth = 23e-6 * 2 * (1 - np.exp(-time / 3600))
    # the candle: everything above axis 2 stands on top of each other, 670 mm; 31 um in the end
    np.testing.assert_allclose(z, 0.670 * (1 + growth), atol=1e-15)
    assert 1e6 * (z[3] - z[0]) == pytest.approx(30.8, abs=0.05)
    np.testing.assert_array_equal(true.poses(q), true.poses(q, time=np.zeros(4)))
    # any posture, against the kinematics of the longer chain
    chain = grown(robot.model.chain, growth[2])
    np.testing.assert_allclose(
        true.poses(Q, time=np.full(200, 3600.0)), RobotModel(chain).poses(Q), atol=1e-12
    )
    # a pose does not know what was asked before
    np.testing.assert_array_equal(true.poses(Q[:3], time=time[:3])[:1], true.poses(Q[:1]))


def test_a_preset_has_the_magnitudes_of_the_specification():
    soft, unmodelled, elastic = (settings(name) for name in ("soft", "unmodelled", "elastic"))
    assert soft.gravity_mdeg == (25.0, 15.0, 30.0)
    assert soft.harmonic_mdeg == (5.0, 5.0, 5.0, 8.0, 8.0, 8.0)
    assert terms_of(soft) == ("geometry", "frames", "gravity", "harmonics")
    base = settings("wen2022")
    for key in ("gravity_mdeg", "harmonic_mdeg", "angle_sd_deg", "length_sd_mm", "frame_sd_mm"):
        assert getattr(unmodelled, key) == getattr(base, key)
    assert terms_of(unmodelled) == (
        "geometry", "gravity", "harmonics", "high_harmonics", "backlash",
    )  # fmt: skip
    assert terms_of(elastic) == ("geometry", "frames", "harmonics", "elastic")
    assert terms_of(settings("moving")) == (*terms_of(elastic), "motion")
    assert terms_of(settings("drives")) == ("geometry", "frames", "harmonics", "transmission")
    assert terms_of(settings("rigid")) == ("geometry",)
    assert terms_of(settings("rigid", joint_repeatability_mdeg="robot"))[-1] == "repeatability"


def test_a_soft_robot_has_the_stated_spread(robot):
    truth = settings("soft", harmonic_mdeg=0.0, gravity_mdeg=[0, 0, 0])
    step = tx60().step_to
    steps = np.array([step(draw_truth(robot, truth, seed).model) for seed in range(100)])
    sd = {"theta": 0.032 * DEG, "alpha": 0.0096 * DEG, "beta": 0.0096 * DEG}
    sd |= {"a": 0.12e-3, "d": 0.064e-3, "base.x": 0.1e-3, "tool.rz": 0.01 * DEG}
    for k, name in enumerate(tx60().names):
        said = sd.get(name, sd.get(name.rstrip("123456"), 0.0))
        if steps[:, k].any():
            if said:
                # sd from 100 numbers: 7.1 %; the worst of 36 within 4 of those
                assert steps[:, k].std() == pytest.approx(said, rel=0.28), name
        else:
            assert name in ("d2", *(f"beta{i}" for i in (1, 3, 4, 5, 6)))


def draws(robot: Robot, truth):
    """All that a truth has drawn and set, by term."""
    true = draw_truth(robot, truth, 5)
    terms = dict(
        zip(true.model.joint_errors.names, true.model.joint_errors.coefficients, strict=True)
    )
    return true.model.chain.links, true.model.chain.T_world_base, terms, true.unmodelled


@pytest.mark.parametrize("term", TERM_KEYS)
def test_switching_a_term_off_moves_no_other(robot, term):
    base = settings({"elastic": "elastic", "motion": "moving"}.get(term, "wen2022"), **ALL)
    assert term in terms_of(base)
    without = only(base, *(name for name in TERM_KEYS if name != term))
    assert set(terms_of(base)) - set(terms_of(without)) == {term}
    links, T, terms, beyond = draws(robot, base)
    links_, T_, terms_, beyond_ = draws(robot, without)
    if term != "geometry":
        np.testing.assert_array_equal(links, links_)
    if term != "frames":
        np.testing.assert_array_equal(T, T_)
    assert all(terms[name] == value for name, value in terms_.items())
    lost = {name.split(".")[0].rstrip("123456") for name in set(terms) - set(terms_)}
    gone = {"gravity": {"gravity"}, "encoder": {"encoder"}, "gear": {"gear"}}
    gone |= {name: {"harmonic"} for name in ("harmonics", "high_harmonics", "transmission")}
    assert lost == gone.get(term, set())
    fields = {"backlash": "backlash", "thermal": "thermal", "elastic": "springs"}
    for name, field in (fields | {"motion": "motion"}).items():
        if term != name:
            assert (getattr(beyond, field) is None) == (getattr(beyond_, field) is None)


def test_a_rigid_or_wen2022_robot_has_nothing_beyond_its_model(robot):
    for preset in ("rigid", "wen2022"):
        true = draw_truth(robot, settings(preset), 1)
        assert (true.unmodelled.backlash, true.unmodelled.thermal, true.unmodelled.springs) == (
            None,
        ) * 3
        np.testing.assert_array_equal(true.poses(Q), true.poses(Q, time=np.arange(200) * 1e3))


@pytest.mark.parametrize(
    ("preset", "poses"), [("wen2022", 50), ("soft", 50), ("elastic", 50), ("moving", 6)]
)
def test_terms_alone_add_up_to_all_of_them_together(robot, preset, poses):
    truth, q = settings(preset, **ALL), Q[:poses]
    time = np.arange(poses) * 240.0
    budget = truth_budget(robot, truth, 3, q, time=time)
    assert budget.names == terms_of(truth)
    assert len(budget.displacement_mm) == len(budget.names) - 1  # repeatability scatters
    # what two displacements of 1e-3 rad do to each other is 1e-3 of them
    assert 0 < budget.interaction_mm < 2e-3 * budget.together_rms_mm
    # one term twice as large contributes twice as much; the others stay
    twice = truth_budget(robot, truth.model_copy(update={"thermal_k": 4.0}), 3, q, time=time)
    ratio = twice.rms_mm / budget.rms_mm
    np.testing.assert_allclose(
        ratio, [2.0 if name == "thermal" else 1.0 for name in budget.names], rtol=1e-4
    )


def test_the_budget_names_the_scatter_of_the_joints(robot):
    truth = settings("rigid", joint_repeatability_mdeg=0.8)
    budget = truth_budget(robot, truth, 3, Q[:20])
    true = draw_truth(robot, only(truth, "repeatability"), 3)
    many = np.repeat(Q[:20], 500, axis=0)
    moved = true.poses(many, rng=np.random.default_rng(0)) - robot.model.poses(many)
    seen = 1e3 * np.sqrt((moved[:, :3, 3] ** 2).sum(axis=1).mean())
    # 10 000 lengths of six numbers each: relative sd about .6 %, four of them
    assert budget.rms_mm[-1] == pytest.approx(seen, rel=0.025)
    assert budget.together_rms_mm == pytest.approx(np.hypot(*budget.rms_mm), rel=1e-12)


def test_a_truth_that_is_the_nominal_robot_has_an_empty_budget(robot):
    budget = truth_budget(robot, settings("rigid", angle_sd_deg=0, length_sd_mm=0), 0, Q[:5])
    assert budget.names == ()
    # MuJoCo and own kinematics round apart
    assert budget.together_rms_mm < 1e-11


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"harmonic_mdeg": [1.0, 2.0]}, "harmonic_mdeg has 2 entries; staubli_tx60 has 6 joints"),
        ({"drive_nm_per_mrad": [90.0]}, "drive_nm_per_mrad has 1 entry; staubli_tx60 has 6"),
    ],
)
def test_a_list_has_one_number_per_joint(robot, changes, message):
    with pytest.raises(InputError, match=message):
        draw_truth(robot, settings("rigid", **changes), 0)


def other(robot: Robot, **changes) -> Robot:
    return replace(robot, model=RobotModel(replace(robot.model.chain, **changes)))


def test_springs_and_given_play_belong_to_turning_joints(robot):
    sliding = other(robot, kinds=("prismatic", *["revolute"] * 5))
    with pytest.raises(InputError, match=r"drive_nm_per_mrad is set, and joint 1 .* slides"):
        draw_truth(sliding, settings("elastic"), 0)
    with pytest.raises(InputError, match="gives play to joint 1 of staubli_tx60, a slide"):
        draw_truth(sliding, settings("rigid", backlash_mdeg=[1.0, 0, 0, 0, 0, 0]), 0)
    # one width for all joints leaves slides out
    play = draw_truth(sliding, settings("rigid", backlash_mdeg=4.0), 0).unmodelled.backlash
    np.testing.assert_allclose(play.half_width, 2 * MDEG * np.array([0, 1, 1, 1, 1, 1]))


def test_play_by_posture_belongs_to_upright_arms(robot):
    wall = other(robot, T_world_base=rot_x(0.1))
    with pytest.raises(
        InputError, match=r'"posture" does not fit this arm.*backlash_side = "load"'
    ):
        draw_truth(wall, settings("unmodelled", gravity_mdeg=[0, 0, 0]), 0)
