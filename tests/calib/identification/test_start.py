"""Frames from nothing: wherever robot, tool and fixtures are, the start lands where a fit works."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import exp_so3, inverse, log_so3, rot_z, transform
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, Status, identify
from calib.identification.start.alignment import start_problem
from calib.identification.start.closed_forms import (
    PointColumns,
    fitted_frame,
    hand_eye_rotations,
    lifted_arm,
    lifted_rotation,
    multilaterated,
    nearest_rotation,
)
from calib.identification.start.guesses import initial_guesses
from calib.identification.start.one_point import OnePoint
from calib.identification.start.start import Start, start_frames
from calib.measurement import tables
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from tests.calib.kinds import (
    ARMS,
    KINDS,
    OFFSET,
    anywhere,
    distances,
    joints,
    measured,
    points,
    poses,
    true_robot,
)
from tests.memory import peak_below

UR10_DATA = Path(__file__).parents[4] / "shared/data/ipa_ur10/Series_D/measurements_iso_cubes.csv"
LARGEST_MISFIT = 8e-3
"""Of links wrong by 0.3 mm and 0.1 deg per number over 1.5 m of reach [m]."""


def calibrated(start: RobotModel, table: Measurements, unknown: tuple[int, ...]) -> Identification:
    """All numbers identified but the anchors that are known."""
    known = {f"anchor{k + 1}" for k in range(len(start.fixtures.anchors)) if k not in unknown}
    free = [name for name in start.names if name.split(".")[0] not in known]
    return identify(start, table, parameters_of(start, free))


def lands(kind: str, arm: str, seed: int, m: int) -> None:
    """From nowhere and from the true frames, the full fit ends at the same robot."""
    rng = np.random.default_rng(seed)
    q = joints(arm, rng, m)
    true, nominal, table, unknown = measured(kind, arm, q, rng)
    start = start_frames(nominal, table, free_anchors=unknown)
    assert start.position_rms < LARGEST_MISFIT
    assert np.isnan(start.rotation_rms) == (not table.is_pose.any())
    links = replace(true.chain, links=ARMS[arm].links)
    ends = [calibrated(x, table, unknown) for x in (start.model, replace(true, chain=links))]
    assert {end.status for end in ends} == {Status.CONVERGED}
    # the two gauges differ, the fits do not: 1e-10 standard deviations from the minimum each, and
    # a sum of squares of 1e3 keeps 1e-10 of itself through the rounding of meters over micrometers
    assert ends[0].chi_square == pytest.approx(ends[1].chi_square, rel=1e-7)
    other = measured(kind, arm, joints(arm, np.random.default_rng(seed + 1), 10),
                     np.random.default_rng(seed))[2]  # fmt: skip
    if kind != "unknown anchor":  # where anchors are shared, the worlds are the same
        apart = predict(ends[0].model, other).residual - predict(ends[1].model, other).residual
        # far below the noise of 20 um; weak directions see the minimum's rounding the most
        assert np.abs(apart).max() < 1e-8


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arm", ARMS)
def test_a_fit_from_nothing_ends_where_one_from_the_true_frames_ends(kind: str, arm: str):
    lands(kind, arm, seed=1, m=60)


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arm", ARMS)
def test_twenty_five_robots_of_each_kind_land(kind: str, arm: str):
    for seed in range(100, 125):
        lands(kind, arm, seed, m=60)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arm", ["tx60", "scara"])
def test_exact_nominal_links_and_no_noise_give_the_frames_to_rounding(kind: str, arm: str):
    rng = np.random.default_rng(2)
    q = joints(arm, rng, 40)
    true, nominal, table, unknown = measured(kind, arm, q, rng)
    true = replace(true, chain=replace(true.chain, links=ARMS[arm].links))
    table = exact(true, table)
    start = start_frames(nominal, table, free_anchors=unknown)
    # meters in double precision, over the condition of a few distances
    assert start.position_rms < 1e-9
    if table.is_pose.any():
        assert start.rotation_rms < 1e-9
    if kind == "poses" and arm == "tx60":
        assert np.abs(start.model.chain.T_world_base - true.chain.T_world_base).max() < 1e-9
        assert np.abs(start.model.chain.T_flange_tool - true.chain.T_flange_tool).max() < 1e-9


def exact(true: RobotModel, table: Measurements) -> Measurements:
    """What the true robot shows without noise."""
    seen = predict(true, table).residual
    far = table.is_distance
    back = exp_so3(-seen[:, 3:])
    return replace(
        table,
        position=table.position - np.where(far[:, None], 0.0, seen[:, :3]),
        rotation=np.where(table.is_pose[:, None, None], back @ table.rotation, table.rotation),
        distance=table.distance - np.where(far, seen[:, 0], 0.0),
    )


@pytest.mark.parametrize(
    ("kind", "fewest"),
    [
        ("poses", 3),
        ("one point", 4),
        ("three reflectors", 3),
        ("known anchor", 7),
        ("unknown anchor", 7),
        ("four anchors", 4),
    ],
)
def test_the_fewest_poses_do_and_one_less_is_refused_with_the_need(kind: str, fewest: int):
    for seed in range(2):
        rng = np.random.default_rng(30 + seed)
        q = joints("tx60", rng, fewest)
        true, nominal, table, unknown = measured(kind, "tx60", q, rng)
        true = replace(true, chain=replace(true.chain, links=ARMS["tx60"].links))
        start = start_frames(nominal, exact(true, table), free_anchors=unknown)
        assert start.position_rms < 1e-3
        with pytest.raises(InputError, match=f"measure at least {fewest}") as caught:
            start_frames(nominal, table.rows(table.pose_id < fewest - 1), free_anchors=unknown)
        assert caught.value.code == "M27"


def found(arm: str, table: Measurements, fixtures: Fixtures | None = None, **more) -> Start:
    return start_frames(RobotModel(ARMS[arm], fixtures=fixtures or Fixtures()), table, **more)


def test_a_held_tool_stays_to_the_last_bit_and_points_then_need_three_poses():
    rng = np.random.default_rng(4)
    true = true_robot("tx60", rng)
    tool = true.chain.T_flange_tool
    nominal = RobotModel(replace(ARMS["tx60"], T_flange_tool=tool))
    for make in (poses, points):
        table = make(true, joints("tx60", rng, 6), rng)
        start = start_frames(nominal, table, free_tool=False)
        assert np.array_equal(start.model.chain.T_flange_tool, tool)
        assert start.position_rms < LARGEST_MISFIT
        assert "the tool stays where the model has it" in start.notes[1]


def test_a_tool_seen_by_one_reflector_keeps_the_nominal_rotation_and_says_so():
    rng = np.random.default_rng(5)
    true = true_robot("ur10", rng)
    start = found("ur10", points(true, joints("ur10", rng, 30), rng))
    # what a shift of the tool says as well is not looked for; rounding of a product or two
    assert np.abs(log_so3(start.model.chain.T_flange_tool[:3, :3])).max() < 1e-15
    reflector = start.model.chain.T_flange_tool @ [*OFFSET, 1]
    # a nominal robot wrong by millimeters finds the reflector to a few of them
    assert np.linalg.norm(reflector - true.chain.T_flange_tool @ [*OFFSET, 1]) < 0.01
    assert any(note.startswith("tool.rz cannot be told from") for note in start.notes)


def test_one_orientation_in_all_poses_holds_the_tool_and_warns():
    turn = np.pi / 2
    links = [[0, 0, 0, turn, 0], [turn, 0, 0, turn, 0], [0, 0.1, 0, 0, 0]]
    chain = Chain(links, ("prismatic",) * 3)
    rng = np.random.default_rng(6)
    true = RobotModel(
        replace(chain, T_world_base=anywhere(rng, 3.0), T_flange_tool=anywhere(rng, 0.1))
    )
    q = rng.uniform(-0.5, 0.5, (20, 3))
    for table in (poses(true, q, rng), points(true, q, rng)):
        start = start_frames(RobotModel(chain), table)
        assert np.abs(start.model.chain.T_flange_tool[:3, 3]).max() < 1e-15
        assert start.position_rms < 1e-4
        assert any("the tool keeps one orientation" in note for note in start.notes)


def test_an_unknown_anchor_alone_leaves_the_base_where_it_was_as_the_world():
    rng = np.random.default_rng(7)
    _, nominal, table, _ = measured("unknown anchor", "iiwa", joints("iiwa", rng, 60), rng)
    start = start_frames(nominal, table, free_anchors=[0])
    assert np.array_equal(start.model.chain.T_world_base, nominal.chain.T_world_base)
    assert "the base stays where the model has it" in start.notes[1]


def test_known_anchors_stay_to_the_last_bit():
    rng = np.random.default_rng(8)
    true, nominal, table, _ = measured("four anchors", "ur10", joints("ur10", rng, 40), rng)
    start = start_frames(nominal, table)
    assert np.array_equal(start.model.fixtures.anchors, true.fixtures.anchors)
    assert np.abs(start.model.chain.T_world_base - true.chain.T_world_base).max() < 0.02


def test_all_kinds_together_find_everything_at_once():
    rng = np.random.default_rng(9)
    true = true_robot("tx60", rng)
    q = joints("tx60", rng, 30)
    table = joined(
        [
            poses(true, q, rng),
            points(true, q[:10], rng, reflector=0, station=1),
            points(true, q[10:20], rng, reflector=1),
            points(true, q[:10], rng, reflector=2),
            *(distances(true, q, rng, anchor=k, reflector=0) for k in range(4)),
        ]
    )
    anchors = np.concatenate([true.fixtures.anchors[:3], np.zeros((1, 3))])
    nowhere = Fixtures(np.zeros((3, 3)), anchors, [np.eye(4)])
    start = found("tx60", table, nowhere, free_anchors=[3])
    assert start.position_rms < LARGEST_MISFIT
    got, want = start.model.fixtures, true.fixtures
    # a nominal robot wrong by millimeters places things to a centimeter or so
    assert np.abs(got.reflectors - want.reflectors).max() < 0.02
    assert np.abs(got.anchors - want.anchors).max() < 0.02
    assert np.abs(got.stations - want.stations).max() < 0.02
    end = calibrated(start.model, table, (3,))
    assert end.status is Status.CONVERGED
    assert abs(end.chi_square - end.dof) < 4 * np.sqrt(2 * end.dof)


@pytest.mark.parametrize("seed", [5, 11, 12])  # two of 40 that only turned bases solve, one more
def test_a_few_distances_to_each_of_many_known_points_will_do(seed: int):
    rng = np.random.default_rng(seed)
    true = true_robot("tx60", rng)
    true = replace(true, chain=replace(true.chain, links=ARMS["tx60"].links))
    anchors = rng.normal(size=(6, 3)) * 2
    true = replace(true, fixtures=replace(true.fixtures, anchors=anchors))
    q = joints("tx60", rng, 18)
    table = joined([distances(true, q[3 * k : 3 * k + 3], rng, anchor=k) for k in range(6)])
    start = found("tx60", table, Fixtures(anchors=anchors))
    # exact links: nothing but the noise is left
    assert start.position_rms < 1e-4


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_opening_is_exact_before_anything_is_polished(kind: str):
    rng = np.random.default_rng(21)
    q = joints("tx60", rng, 60)
    true, nominal, table, unknown = measured(kind, "tx60", q, rng)
    true = replace(true, chain=replace(true.chain, links=ARMS["tx60"].links))
    table = exact(true, table)
    F = forward(ARMS["tx60"], table.q)
    rig = next(initial_guesses(start_problem(nominal, F, table, True, unknown)))
    seen = rig.predict(table)
    # rounding over the condition of the lifts, below 1e6
    assert seen.misses.max() < 1e-8
    assert seen.turns.max() < 1e-8


@pytest.mark.parametrize("shared", [True, False])
def test_a_reflector_that_only_the_further_station_sees_is_placed_by_it(shared: bool):
    """By the station found from a reflector that both see, or from its own readings alone."""
    rng = np.random.default_rng(23)
    true = true_robot("tx60", rng)
    true = replace(
        true, chain=replace(true.chain, links=ARMS["tx60"].links),
        fixtures=Fixtures(true.fixtures.reflectors, stations=true.fixtures.stations),
    )  # fmt: skip
    q = joints("tx60", rng, 40)
    seen = [(0, 0), (1, 0), (1 if shared else 2, 1), (2, 1)]
    table = exact(
        true, joined([points(true, q, rng, reflector=r, station=s) for r, s in dict.fromkeys(seen)])
    )
    nominal = RobotModel(ARMS["tx60"], fixtures=Fixtures(np.zeros((3, 3)), stations=[np.eye(4)]))
    problem = start_problem(nominal, forward(ARMS["tx60"], table.q), table, True, ())
    # rounding over the condition of the lifts, below 1e6
    assert next(initial_guesses(problem)).predict(table).misses.max() < 1e-8
    assert start_frames(nominal, table).position_rms < 1e-9


def test_joint_errors_of_the_model_are_taken_into_account():
    rng = np.random.default_rng(11)
    errors = JointErrors(gravity_terms(6), np.array([0.01, -0.008, 0.02]))
    true = true_robot("tx60", rng)
    true = RobotModel(replace(true.chain, links=ARMS["tx60"].links), errors)
    table = poses(true, joints("tx60", rng, 20), rng)
    start = start_frames(RobotModel(ARMS["tx60"], errors), table)
    assert start.model.joint_errors is errors
    # noise of 20 um per axis and nothing else; 20 poses leave it known to 10 %
    assert start.position_rms < 60e-6


@pytest.mark.parametrize("kind", ["poses", "one point"])
def test_the_memory_for_2700_poses_grows_with_their_number_alone(kind: str):
    rng = np.random.default_rng(12)
    _, nominal, table, _ = measured(kind, "ur10", joints("ur10", rng, 2700), rng)
    with peak_below(40e6):  # 9 MB; all pairs of poses, one number each, would be 58
        start_frames(nominal, table)


@pytest.mark.parametrize("wrong", ["millimeters", "mirrored", "inverse", "shifted"])
def test_a_file_read_wrongly_gives_a_large_misfit_and_no_mishap(wrong: str):
    rng = np.random.default_rng(13)
    _, nominal, table, _ = measured("poses", "tx60", joints("tx60", rng, 30), rng)
    right = start_frames(nominal, table)
    if wrong == "millimeters":
        table = replace(table, position=1000 * table.position)
    elif wrong == "mirrored":
        table = replace(table, position=table.position * [1, -1, 1])
    elif wrong == "inverse":
        back = inverse(transform(table.rotation, table.position))
        table = replace(table, position=back[:, :3, 3], rotation=back[:, :3, :3])
    else:
        table = replace(table, q=np.roll(table.q, 1, axis=0))
    start = start_frames(nominal, table)
    # every wrong reading of MATH's 60 virtual robots: 20 mm or more
    assert start.position_rms > max(0.02, 5 * right.position_rms)


def test_the_start_does_not_depend_on_the_frames_of_the_nominal_model():
    rng = np.random.default_rng(14)
    _, nominal, table, _ = measured("poses", "iiwa", joints("iiwa", rng, 30), rng)
    chain = replace(
        nominal.chain, T_world_base=anywhere(rng, 5.0), T_flange_tool=anywhere(rng, 1.0)
    )
    one, other = start_frames(nominal, table), start_frames(RobotModel(chain), table)
    assert one.position_rms == pytest.approx(other.position_rms, rel=1e-6)
    apart = one.model.poses(table.q) - other.model.poses(table.q)
    # the damping: misfits of millimeters, a weight of 1e-4 against 30 poses
    assert np.abs(apart).max() < 1e-6


@pytest.mark.skipif(not UR10_DATA.exists(), reason="the measured UR10 is not beside the checkout")
def test_a_real_robot_and_tracker_are_put_together_from_nothing():
    """UR10 and Leica T-Mac (Landgraf et al. 2021), series D; mm, degrees, decimal commas."""
    lines = UR10_DATA.read_text(encoding="utf-8-sig").replace(",", ".").splitlines()
    head = lines[0].split(";")
    data = np.array([[float(cell) for cell in line.split(";")] for line in lines[1:]])
    q = data[:, head.index("shoulder_pan_joint") : head.index("wrist_3_joint") + 1]
    seen = data[:, [head.index(f"measurement_{axis}") for axis in ("x", "y", "z")]] / 1e3
    euler = data[:, [head.index(f"measurement_r{axis}") for axis in ("x", "y", "z")]]
    T = transform(Rotation.from_euler("XYZ", euler, degrees=True).as_matrix(), seen)
    table = tables.poses(q, T, sd=(1e-4, 1e-4))
    start = start_frames(RobotModel(ARMS["ur10"]), table)
    # what its publishers reach with a fit of base and tool alone: 0.72 mm and about 0.1 degrees
    assert predict(start.model, table).misses.mean() == pytest.approx(0.72e-3, rel=0.02)
    assert np.degrees(start.rotation_rms) < 0.15
    # positions alone fit as well: they leave out rotations, which pull hardly at all
    alone = start_frames(RobotModel(ARMS["ur10"]), tables.points(q, seen, sd=np.eye(3) * 1e-8))
    assert 0.98 < alone.position_rms / start.position_rms <= 1.0


def test_anchors_that_the_model_does_not_have_are_refused():
    rng = np.random.default_rng(15)
    _, nominal, table, _ = measured("known anchor", "tx60", joints("tx60", rng, 20), rng)
    with pytest.raises(InputError, match="free_anchors names anchor 3"):
        start_frames(nominal, table, free_anchors=[3])


# the closed forms, each against what it should find


@pytest.mark.parametrize("m", [3, 4, 30])
def test_hand_eye_rotations_are_found_exactly_from_three_poses(m: int):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        X, Y = anywhere(rng, 1.0)[:3, :3], anywhere(rng, 1.0)[:3, :3]
        F = np.array([anywhere(rng, 1.0) for _ in range(m)])
        found = hand_eye_rotations(F, X @ F[:, :3, :3] @ Y)
        # three random rotations are far enough apart for a condition below 1e3
        np.testing.assert_allclose(found[0], X, atol=1e-11)
        np.testing.assert_allclose(found[1], Y, atol=1e-11)


def test_hand_eye_rotations_about_one_axis_or_none_are_not_guessed():
    rng = np.random.default_rng(22)
    X, Y = anywhere(rng, 1.0)[:3, :3], anywhere(rng, 1.0)[:3, :3]
    for angles in (np.zeros(8), rng.uniform(-2, 2, 8)):
        F = transform(exp_so3(np.outer(angles, [0.6, 0.0, 0.8])), np.zeros((8, 3)))
        assert hand_eye_rotations(F, X @ F[:, :3, :3] @ Y) is None


def test_the_lift_of_points_finds_rotation_shift_and_every_arm():
    rng = np.random.default_rng(16)
    F = np.array([anywhere(rng, 0.5) for _ in range(12)])
    X, c, t = anywhere(rng, 1.0)[:3, :3], rng.normal(size=(2, 3)) * 0.1, rng.normal(size=3) * 3
    target = np.arange(12) % 2
    seen = (np.einsum("mij,mj->mi", F[:, :3, :3], c[target]) + F[:, :3, 3]) @ X.T + t
    free = np.zeros(2, dtype=bool)
    found = lifted_rotation(F, seen, target, np.zeros((2, 3)), free)
    np.testing.assert_allclose(found, X, atol=1e-12)
    shift, arms = PointColumns.of(F, target, free).shift_and_arms(X, seen, np.zeros((2, 3)))
    np.testing.assert_allclose(shift, t, atol=1e-12)
    np.testing.assert_allclose(arms, c, atol=1e-12)


@pytest.mark.parametrize("still", [False, True])
def test_sums_over_poses_give_the_steps_that_the_poses_give(still):
    """Base and point in turn, by sums made once and by all rows: readings with errors of 0.1 m.

    Turns about a single axis leave a part of the point open.
    """
    rng = np.random.default_rng(23)
    F = np.array([anywhere(rng, 0.5) for _ in range(30)])
    if still:
        F[:, :3, :3] = exp_so3(np.outer(rng.uniform(-2, 2, 30), [0.6, 0.0, 0.8]))
    seen = F[:, :3, 3] @ anywhere(rng, 1.0)[:3, :3].T + rng.normal(size=(30, 3)) * 0.1
    target, free, about = np.zeros(30, dtype=int), np.zeros(1, dtype=bool), np.zeros((1, 3))
    sums, columns = OnePoint.of(F, seen), PointColumns.of(F, target, free)
    X = anywhere(rng, 1.0)[:3, :3]
    for _ in range(3):
        t, arms = columns.shift_and_arms(X, seen, about)
        arm = sums.arm(X)
        np.testing.assert_allclose(arm, arms[0], atol=1e-12)
        np.testing.assert_allclose(sums.shift(X, arm), t, atol=1e-12)
        known = F[:, :3, 3] + F[:, :3, :3] @ arm
        there = sums.rotation(arm, X)
        np.testing.assert_allclose(there, fitted_frame(seen, known, X)[:3, :3], atol=1e-12)
        X = there


def test_a_frame_is_fitted_to_one_two_or_more_points():
    rng = np.random.default_rng(17)
    T = anywhere(rng, 2.0)
    about = exp_so3(np.array([0.0, 0.0, 0.1])) @ T[:3, :3]
    known = rng.normal(size=(5, 3))
    for k in (1, 2, 3, 5):
        seen = known[:k] @ T[:3, :3].T + T[:3, 3]
        found = fitted_frame(seen, known[:k], about)
        np.testing.assert_allclose(known[:k] @ found[:3, :3].T + found[:3, 3], seen, atol=1e-8)
        if k > 2:
            np.testing.assert_allclose(found, T, atol=1e-8)  # the nudge, 1e-9 of the spread
    np.testing.assert_allclose(fitted_frame(known[:1], known[:1], about)[:3, :3], about, atol=1e-9)


def test_points_in_a_plane_are_never_mirrored():
    rng = np.random.default_rng(18)
    for _ in range(20):
        M = rng.normal(size=(3, 3))
        M[2] = M[0] + M[1]  # rank two
        R = nearest_rotation(M)
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)


def test_distances_find_the_point_they_were_measured_from():
    rng = np.random.default_rng(19)
    centers, x = rng.normal(size=(6, 3)), rng.normal(size=3) * 4
    found = multilaterated(centers, np.linalg.norm(centers - x, axis=1))
    np.testing.assert_allclose(found, x, atol=1e-11)


def test_the_lift_of_distances_finds_the_reflector():
    rng = np.random.default_rng(20)
    F = np.array([anywhere(rng, 0.5) for _ in range(60)])
    c, a = np.array([0.05, -0.1, 0.2]), rng.normal(size=(2, 3)) * 2
    anchor = np.arange(60) % 2
    p = F[:, :3, :3] @ c + F[:, :3, 3]
    found = lifted_arm(F, np.linalg.norm(p - a[anchor], axis=1), anchor, 2)
    np.testing.assert_allclose(found, c, atol=1e-11)


def test_the_lift_of_distances_of_an_arm_that_stays_in_a_plane_is_finite():
    """No pose leaves z = 0, so nothing in the rows goes with it: 0/0 stopped every planar arm."""
    rng = np.random.default_rng(21)
    F = np.tile(np.eye(4), (60, 1, 1))
    F[:, :2, 3] = rng.normal(size=(60, 2))
    for T, turn in zip(F, rng.uniform(-3, 3, 60), strict=True):
        T[:3, :3] = rot_z(turn)[:3, :3]
    c, a = np.array([0.05, -0.1, 0.0]), np.array([2.0, 1.0, 0.5])
    distance = np.linalg.norm(F[:, :3, :3] @ c + F[:, :3, 3] - a, axis=1)
    found = lifted_arm(F, distance, np.zeros(60, int), 1)
    # nothing tells the arm along z
    np.testing.assert_allclose(found[:2], c[:2], atol=1e-11)
