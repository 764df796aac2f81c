"""A calibration in one call: what is said of it, and the proof on other poses."""

import numpy as np
import pytest

import calib
from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.prior import Prior, own_prior
from calib.identification.result import values_and_uncertainties
from tests.calib.kinds import ARMS, KINDS, joints, measured, true_robot
from tests.reference import pool_r, tx60

SD, TURN_SD = 20e-6, 50e-6
TOOL = np.block([[np.eye(3), np.array([[0.1], [0.0], [0.1]])], [np.zeros(3), 1.0]])


def points_of(true, q, rng):
    """The tool point of a robot, seen with the stated noise."""
    return calib.points(q, true.poses(q)[:, :3, 3] + rng.normal(size=(len(q), 3)) * SD, sd=SD)


def poses_of(true, q, rng):
    """The tool of a robot, seen with the stated noise."""
    T = true.poses(q)
    T[:, :3, 3] += rng.normal(size=(len(q), 3)) * SD
    T[:, :3, :3] = exp_so3(rng.normal(size=(len(q), 3)) * TURN_SD) @ T[:, :3, :3]
    return calib.poses(q, T, sd=(SD, TURN_SD))


@pytest.mark.parametrize("see", [points_of, poses_of])
def test_a_robot_anywhere_is_calibrated_and_judged_by_other_poses(see):
    rng = np.random.default_rng(1)
    true = true_robot("tx60", rng)
    train, test = see(true, joints("tx60", rng, 100), rng).split(held_out=25, seed=3)
    result = calib.calibrate(calib.RobotModel(ARMS["tx60"]), train)
    # 0.001 on both sides: one wrong failure in 500 seeds
    assert 1e-3 < result.identification.p_value < 1 - 1e-3
    judged = result.judge(test)
    assert judged.trust.believe == "region"
    assert len(judged.held_out) == 25
    error = (result.model.poses(test.q) - true.poses(test.q))[:, :3, 3]
    assert np.linalg.norm(error, axis=1).max() < 2e-4  # links were wrong by 0.3 mm and 0.1 deg
    assert calib.judge(result.identification, test, train=train).held_out.chi_square == (
        judged.held_out.chi_square
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_measurement_is_calibrated_in_one_call(kind):
    rng = np.random.default_rng(4)
    _, nominal, table, unknown = measured(kind, "tx60", joints("tx60", rng, 60), rng)
    result = calib.calibrate(nominal, table, free_anchors=unknown)
    assert result.identification.status.name == "CONVERGED"
    assert 1e-3 < result.identification.p_value < 1 - 1e-3
    known = {f"anchor{k + 1}" for k in range(len(nominal.fixtures.anchors)) if k not in unknown}
    assert not known & {name.split(".")[0] for name in result.identification.names}


def test_what_only_carries_a_model_is_not_one():
    class Robot:
        model = calib.RobotModel(ARMS["tx60"])

    rng = np.random.default_rng(2)
    table = points_of(Robot.model, joints("tx60", rng, 40), rng)
    with pytest.raises(InputError, match=r"type Robot; a calib.RobotModel; .* robot.model"):
        calib.calibrate(Robot(), table)


def test_what_is_asked_to_stay_stays():
    rng = np.random.default_rng(5)
    true = true_robot("tx60", rng)
    table = poses_of(true, joints("tx60", rng, 40), rng)
    nominal = calib.RobotModel(ARMS["tx60"]).moved(np.zeros(42))
    held = calib.calibrate(nominal, table, free_tool=False).identification
    assert not [name for name in held.names if name.startswith("tool.")]
    few = calib.calibrate(nominal, table, free=["base.x", "theta2"]).identification
    assert few.names == ("base.x", "theta2")


def test_joint_errors_that_a_robot_has_already_are_held_near_their_values_by_a_prior():
    """Waves 1 to 4 of each joint, twenty poses: without it most of them would run away."""
    rng = np.random.default_rng(8)
    plain = calib.RobotModel(ARMS["tx60"])
    known = calib.RobotModel(
        plain.chain, JointErrors(harmonic_terms(6, (1, 2, 3, 4)), rng.normal(size=48) * 1e-5)
    )
    table = poses_of(known, joints("tx60", rng, 20), rng)
    result = calib.calibrate(known, table)
    found, own = result.identification, known.joint_errors.names
    assert found.prior.names == own
    moved = dict(zip(found.names, found.step, strict=True))
    assert all(abs(moved[name]) < 3 * sd for name, sd in zip(own, found.prior.sd, strict=True))
    assert "of the joint errors that the robot has already 48 free under a prior" in (
        result.summary()
    )
    # what is given stays; the rest has the usual one beside it, and what is held none
    given = Prior(np.zeros(1), np.array([1e-7]), own[:1])
    again = calib.calibrate(known, table, prior=given).identification.prior
    assert again.names == own
    assert again.sd[0] == 1e-7
    np.testing.assert_array_equal(again.sd[1:], found.prior.sd[1:])
    held = calib.calibrate(known, table, free=plain.names)
    assert held.identification.prior is None
    assert "already 48 held as they are" in held.summary()
    # the same fit by a prior that is written out
    start, all_free = result.start.model, parameters_of(known)
    by_hand = identify(start, table, all_free, prior=own_prior(all_free, start))
    np.testing.assert_array_equal(by_hand.step, found.step)


def test_the_summary_lists_values_with_their_uncertainty_and_what_cannot_be_told_apart():
    rng = np.random.default_rng(6)
    true = true_robot("tx60", rng)
    result = calib.calibrate(
        calib.RobotModel(ARMS["tx60"]), points_of(true, joints("tx60", rng, 80), rng)
    )
    text = result.summary()
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line}
    value, U, unit = rows["a2"]
    k = result.identification.names.index("a2")
    assert unit == "mm"
    assert float(value) == pytest.approx(1e3 * result.model.chain.links[1, 2], abs=0.5 * float(U))
    u = result.identification.standard_uncertainty[k]
    assert float(U) == pytest.approx(2e3 * u, rel=0.05)  # two digits
    assert rows["theta2"][2] == "deg"
    assert "d2 cannot be told from d3" in text
    assert "chi-square" in text
    assert "warning" not in text
    assert text.count("tool.rx has no effect") == 1


def test_poses_too_much_alike_are_warned_of():
    rng = np.random.default_rng(7)
    true = true_robot("tx60", rng)
    q = joints("tx60", rng, 40)
    q[:, 3:] = 0.3 + 0.002 * q[:, 3:]
    result = calib.calibrate(calib.RobotModel(ARMS["tx60"]), poses_of(true, q, rng))
    assert "warning: the poses are much alike" in result.summary()
    assert result.identification.names[result.identification.least_known] in result.summary()


def test_listed_values_and_uncertainties_are_those_of_the_frames_themselves():
    """Base and tool as position and rotation vector: the spread of virtual estimates agrees."""
    rng = np.random.default_rng(8)
    true = true_robot("tx60", rng)
    found = calib.calibrate(
        calib.RobotModel(ARMS["tx60"]), poses_of(true, joints("tx60", rng, 40), rng)
    ).identification
    values, u = values_and_uncertainties(found)
    names = list(found.model.names)
    assert values[:3] == pytest.approx(found.model.chain.T_world_base[:3, 3], abs=1e-15)
    assert values[names.index("a3")] == found.model.chain.links[2, 2]
    root = np.linalg.cholesky(found.covariance)
    drawn = []
    for _ in range(2000):
        step = found.parameters.expand(root @ rng.standard_normal(len(root)))
        moved = found.model.moved(step)
        drawn.append(np.concatenate([moved.chain.T_world_base[:3, 3],
                                     moved.chain.T_flange_tool[:3, 3]]))  # fmt: skip
    at = [names.index(f"{frame}.{axis}") for frame in ("base", "tool") for axis in "xyz"]
    # 2000 draws leave 1.6 %; five times that for six of them
    assert np.std(drawn, axis=0) == pytest.approx(u[at], rel=0.08)
    # the table shows these; the square roots of the covariance are of the base's own axes
    table = found.tables()["numbers"]
    k, R = slice(3), found.model.chain.T_world_base[:3, :3]
    own = found.covariance[k, k]
    assert found.standard_uncertainty[k] == pytest.approx(np.sqrt(np.diag(own)), rel=1e-12)
    assert table["U"][k] == pytest.approx(2e3 * np.sqrt(np.diag(R @ own @ R.T)), rel=1e-9)


def test_every_result_prints_as_one_line():
    rng = np.random.default_rng(9)
    true = true_robot("tx60", rng)
    train, test = points_of(true, joints("tx60", rng, 80), rng).split(held_out=20)
    result = calib.calibrate(calib.RobotModel(ARMS["tx60"]), train)
    judged = result.judge(test, rng=np.random.default_rng(0))
    corrected = calib.compensate(result.start.model, result.model, test.q)
    found = result.identification
    start = calib.uncertainty.freeze(result.model, train, found.parameters)
    noise = calib.uncertainty.RowNoise("tracker", train.covariance)
    shares = calib.uncertainty.budget(start, [noise])
    stated = calib.uncertainty.tool_statement(result.model, test.q, found.full_covariance)
    mapped = calib.uncertainty.tool_map(lambda _: stated, test.q, cell=0.5)
    drawn = calib.uncertainty.point_spread(
        result.model, test.q, found.full_covariance, np.random.default_rng(0), draws=100
    )
    again = calib.uncertainty.refit(start, train.position[None], train.rotation[None])
    results = (
        result, found, result.start, found.reduction, found.parameters, found.lack_of_fit,
        judged, judged.held_out, judged.discrepancy, judged.conformal, judged.bootstrap,
        judged.trust, corrected, train, shares, shares.sources[0],
        shares.at_tool(result.model, test.q), stated, mapped, drawn, again,
        calib.uncertainty.type_a([[1.0], [2.0]]),
    )  # fmt: skip
    for one in results:
        assert "\n" not in repr(one)
        assert len(repr(one)) < 400, repr(one)
    assert "converged" in repr(result)
    assert corrected.corrected.mean() > 0.8  # some stand nearly singular


def test_paper_mode_has_a_summary_too():
    rng = np.random.default_rng(10)
    true = true_robot("tx60", rng)
    table = poses_of(true, joints("tx60", rng, 40), rng)
    start = calib.calibrate(calib.RobotModel(ARMS["tx60"]), table).start.model
    free = ["theta2", "a2", "alpha3"]
    found = calib.identify(start, table, calib.parameters_of(start, free), mode="paper")
    assert "s^2" in found.summary()
    assert "s^2" in repr(found)


@pytest.mark.parametrize(("turn", "length"), [(1.0, 1e3), (180 / np.pi, 1.0), (1.0, 1e-3)])
def test_readings_in_other_units_are_refused_and_not_believed(turn, length):
    """Positions in millimeters or kilometers, joints in degrees."""
    model = tx60()
    table = points_of(model, pool_r(40), np.random.default_rng(1))
    other = calib.points(turn * table.q, length * table.position, sd=length * SD)
    with pytest.raises(InputError, match=r"nominal links miss the measurements by .* reaches"):
        calib.calibrate(model, other)
    assert calib.calibrate(model, table).identification.status.name == "CONVERGED"


def turned_back(table):
    """The same poses with transposed rotations."""
    T = np.tile(np.eye(4), (len(table), 1, 1))
    T[:, :3, 3], T[:, :3, :3] = table.position, np.swapaxes(table.rotation, -1, -2)
    return calib.poses(table.q, T, sd=(SD, TURN_SD))


def joints_of(table, change):
    """The same points with other joint values."""
    return calib.points(change(table.q), table.position, sd=SD)


@pytest.mark.parametrize(
    ("see", "change", "says"),
    [
        (points_of, lambda t: joints_of(t, lambda q: q[:, [0, 1, 2, 4, 3, 5]]), "miss"),
        (points_of, lambda t: joints_of(t, lambda q: q * [1, 1, 1, 1, 180 / np.pi, 1]), "miss"),
        (poses_of, turned_back, "nominal links miss the measured rotations"),
    ],
)
def test_readings_of_no_such_arm_are_refused_even_where_a_fit_comes_near(see, change, says):
    """Errors far below a tenth of the reach: joints swapped, a wrist in degrees, matrices turned.

    The tool point lies 0.1 m off the last axis, as without that its joint moves nothing.
    """
    model = calib.RobotModel(calib.Chain(tx60().chain.links, T_flange_tool=TOOL))
    table = see(model, pool_r(60), np.random.default_rng(1))
    assert calib.calibrate(tx60(), table).identification.p_value > 1e-3
    with pytest.raises(InputError, match=says) as caught:
        calib.calibrate(tx60(), change(table))
    assert caught.value.code == "M32"
    for word in ("order", "Craig's", "transposed", "rad", "sd in m"):
        assert word in caught.value.fix


def test_joints_swapped_on_a_larger_arm_are_refused_after_the_fit():
    """Nominal links miss by less than a tenth of the reach there, fitted ones by 3 % (61 mm)."""
    right = np.pi / 2
    links = [
        [0, 0.55, 0.12, -right, 0], [-right, 0, 0.61, 0, 0], [0, 0, 0.09, -right, 0],
        [0, 0.64, 0, right, 0], [0, 0, 0, -right, 0], [0, 0.11, 0, 0, 0],
    ]  # fmt: skip
    model, rng = calib.RobotModel(calib.Chain(links)), np.random.default_rng(0)
    q = rng.uniform(-1.8, 1.8, (80, 6))
    xyz = (model.poses(q) @ [0.02, 0.01, 0.03, 1.0])[:, :3] + rng.normal(scale=SD, size=(80, 3))
    assert calib.calibrate(model, calib.points(q, xyz, sd=SD)).identification.p_value > 1e-3
    with pytest.raises(InputError, match="even fitted links miss") as caught:
        calib.calibrate(model, calib.points(q[:, [0, 1, 2, 4, 3, 5]], xyz, sd=SD))
    assert caught.value.code == "M32"


def test_rotations_of_another_convention_are_refused_after_the_fit():
    """Turned by up to 14 deg each, as by a convention that differs a little from pose to pose."""
    model, rng = tx60(), np.random.default_rng(5)
    table = poses_of(model, pool_r(60), rng)
    T = np.tile(np.eye(4), (len(table), 1, 1))
    turns = exp_so3(0.25 * rng.uniform(-1, 1, (len(table), 3)))
    T[:, :3, 3], T[:, :3, :3] = table.position, table.rotation @ turns
    with pytest.raises(
        InputError, match="even fitted links miss most measured rotations"
    ) as caught:
        calib.calibrate(model, calib.poses(table.q, T, sd=(SD, TURN_SD)))
    assert caught.value.code == "M32"


def test_no_such_arm_is_asked_of_frames_alone_nor_of_small_arms_and_slides():
    """Joints mastered wrong by degrees, servos that come back to 1.5 deg, a scale of 3 m off."""
    rng = np.random.default_rng(4)
    table = points_of(tx60(), pool_r(60), rng)
    turned = joints_of(table, lambda q: q + np.radians([0, 3, 2, 0, 0, 0]))
    frames = [name for name in tx60().names if name.split(".")[0] in ("base", "tool")]
    assert calib.calibrate(tx60(), turned, free=frames).identification.status.name == "CONVERGED"
    links = tx60().chain.links.copy()
    links[:, 1:3] *= 0.35  # 0.3 m
    small = calib.RobotModel(calib.Chain(links))
    loose = points_of(small, pool_r(60), rng)
    loose = joints_of(loose, lambda q: q + np.radians(1.5) * rng.normal(size=q.shape))
    assert calib.calibrate(small, loose).identification.status.name == "CONVERGED"
    kinds = ("prismatic",) * 3 + ("revolute",) * 2
    axes = [[0, 0, 0, -np.pi / 2, 0], [-np.pi / 2, 0, 0, -np.pi / 2, 0], [0, 0, 0, 0, 0]]
    wrist = [[0, 0.05, 0, np.pi / 2, 0], [0, 0.05, 0.0, 0, 0]]
    gantry = calib.RobotModel(calib.Chain([*axes, *wrist], kinds))
    q = rng.uniform([0, 0, 0, -2, -2], [3, 2, 1, 2, 2], (60, 5))
    xyz = (gantry.poses(q * [1.002, 1, 1, 1, 1]) @ [0.05, 0.02, 0.03, 1.0])[:, :3]
    seen = calib.points(q, xyz + rng.normal(scale=SD, size=(60, 3)), sd=SD)
    assert calib.calibrate(gantry, seen).identification.status.name == "CONVERGED"


def test_few_wrong_readings_and_much_noise_are_no_other_arm():
    rng = np.random.default_rng(2)
    table = points_of(tx60(), pool_r(60), rng)
    off = np.where(np.arange(60)[:, None] % 10 == 3, 0.1, 0.0)
    wrong = calib.points(table.q, table.position + off, sd=SD)
    assert calib.calibrate(tx60(), wrong, loss="huber").identification.status.name == "CONVERGED"
    sd = 0.03  # a camera's: 4 % of the reach
    noisy = calib.points(table.q, table.position + sd * rng.normal(size=(60, 3)), sd=sd)
    assert calib.calibrate(tx60(), noisy).identification.p_value > 1e-3


def test_links_and_noise_in_no_meters_are_refused():
    """Links, positions and sd in mm agree with each other: only the size of the arm tells."""
    table = points_of(tx60(), pool_r(40), np.random.default_rng(3))
    links = tx60().chain.links * [1, 1e3, 1e3, 1, 1]
    millimeters = calib.points(table.q, 1e3 * table.position, sd=1e3 * SD)
    with pytest.raises(InputError, match=r"links add up to .* at most 100 m; .* mm"):
        calib.calibrate(calib.RobotModel(calib.Chain(links)), millimeters)
    with pytest.raises(InputError, match=r"sd is 15 m or more in every row; .* give sd in m"):
        calib.calibrate(tx60(), calib.points(table.q, table.position, sd=15.0))


def test_the_pose_of_one_wrong_reading_is_named():
    table = points_of(tx60(), pool_r(60), np.random.default_rng(4))
    off = np.where(np.arange(60)[:, None] == 7, 5e-3, 0.0)
    train = calib.points(table.q, table.position + off, sd=SD).rows(range(40))
    result, sound = (calib.calibrate(tx60(), one) for one in (train, table.rows(range(40))))
    assert "half of all squares" not in sound.summary()
    assert "one of 40 rows (pose 7) holds half of all squares" in result.summary().splitlines()[-1]
    named = calib.Circumstances(pose_names=[f"P{k + 1}" for k in range(60)])
    for known, name in ((None, "7"), (named, "P8")):
        judged = result.judge(table.rows(range(40, 60)), circumstances=known)
        assert f"one of 60 rows (pose {name}) holds half" in judged.trust.sentence
    assert judged.tails.poses == (7,)


def test_noise_that_is_stated_too_large_is_said_by_its_factor():
    table = points_of(tx60(), pool_r(80), np.random.default_rng(5))
    wide = calib.points(table.q, table.position, sd=5 * SD)
    for seen, too_large in ((wide, True), (table, False)):
        train, test = seen.split(held_out=20)
        said = calib.calibrate(tx60(), train).judge(test).trust.sentence
        assert ("contradicts the stated noise" in said) != too_large
        if too_large:
            factor = float(said.split("smaller than the stated noise, by a factor of ")[1][:3])
            # an estimate from 150 numbers: 0.06 of itself
            assert factor == pytest.approx(5, abs=1)
    exact = calib.points(table.q, tx60().poses(table.q)[:, :3, 3], sd=SD)
    train, test = exact.split(held_out=20)
    assert "factor of more than 1000" in calib.calibrate(tx60(), train).judge(test).trust.sentence
