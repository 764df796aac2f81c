"""Two places in a row, one where the robot was sent and one where it was seen: which is read?

Truth: the files are written here; where the robot was sent is the forward kinematics of the nominal
one, to the last digit that a file has.
"""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from tests.command import call
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.proposal.test_session import ARM, M, data, joints, places, points, proposed

FLANGE = ROBOT.model.poses(data().q)
SENT = (FLANGE[:, :3, 3] + FLANGE[:, :3, :3] @ ARM) * 1e3
"""In the base of the robot [mm]."""
BASE = data().truth.chain.T_world_base


def nominal():
    """Where a nominal robot at the same base has the reflector that was measured [mm]."""
    T = FLANGE @ data().truth.chain.T_flange_tool
    return ((T[:, :3, 3] + T[:, :3, :3] @ ARM) @ BASE[:3, :3].T + BASE[:3, 3]) * 1e3


def named(form, label, values):
    return places(*(form.format(label=label, axis=axis) for axis in "XYZ"), values=values)


J = tuple(f"J{k}" for k in range(1, 7))
LABELS = {
    "Dutch": ("Gemeten", "Nominaal"),
    "Polish": ("Zmierzone", "Nominalne"),
    "Finnish": ("Mitattu", "Nimellinen"),
    "letters": ("M", "N"),
}


@pytest.mark.parametrize("sent", [nominal, lambda: SENT], ids=["in the room", "in the base"])
@pytest.mark.parametrize("labels", LABELS.values(), ids=LABELS)
def test_where_the_robot_was_sent_is_no_second_target_whatever_it_is_called(labels, sent, tmp_path):
    seen, wished = labels
    table = joints(*J) | named("{label} {axis}", wished, sent())
    table |= named("{label} {axis}", seen, points())
    (tmp_path / "a.csv").write_text(csv(table), encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert f"{wished} X, {wished} Y, {wished} Z are not used" in said
    assert "too close to tell them apart" not in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert len(table) == M
    # fifteen digits are written
    np.testing.assert_allclose(table.position, points() / 1e3, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["joints first", "joints last"])
def test_without_a_head_the_places_that_were_measured_are_read(order, tmp_path):
    values = list((joints(*J) | places("a", "b", "c", values=nominal())).values())
    seen = list(places("x", "y", "z").values())
    table = values + seen if order == "joints first" else values[6:] + seen + values[:6]
    np.savetxt(tmp_path / "a.txt", np.column_stack(table), fmt="%.12f")
    proposed(tmp_path, [tmp_path / "a.txt"], "--robot", ROBOT.name)
    read = read_session(tmp_path / "session.toml", ROBOT).measurements
    # twelve decimals of a millimeter are written, and the joints read back in float64
    np.testing.assert_allclose(read.position, points() / 1e3, rtol=0, atol=1e-12)


def test_two_readings_of_one_reflector_are_told_and_one_is_taken(tmp_path):
    again = points() + np.random.default_rng(3).normal(0, 0.02, (M, 3))
    table = joints(*J) | named("{label} {axis}", "raw", points())
    table |= named("{label} {axis}", "fit", again)
    (tmp_path / "a.csv").write_text(csv(table), encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "from each other, where no two reflectors can, and are not used" in said
    assert "too close to tell them apart" in said
    assert len(read_session(tmp_path / "session.toml", ROBOT).measurements) == M


TWO = """
[joints.columns]
{joints}
[points.targets]
A = ["A X", "A Y", "A Z"]
B = ["B X", "B Y", "B Z"]
[uncertainty]
position_um = 30
"""


def session_of(folder, other):
    table = joints(*J) | named("{label} {axis}", "A", points())
    table |= named("{label} {axis}", "B", other)
    (folder / "a.csv").write_text(csv(table), encoding="utf-8")
    own = "\n".join(f'q{k}_deg = "J{k}"' for k in range(1, 7))
    text = 'format = 1\njoints.file = "a.csv"\npoints.file = "a.csv"\n' + TWO.format(joints=own)
    (folder / "session.toml").write_text(text)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (nominal, "from each other, where no two reflectors can"),
        (lambda: SENT, "do not stay together: how far they lie apart varies by"),
    ],
    ids=["in the room", "in the base"],
)
def test_identify_refuses_targets_that_cannot_be_on_one_tool(other, why, tmp_path):
    session_of(tmp_path, other())
    done = call("identify", ROBOT.name, tmp_path / "session.toml", "--out", tmp_path / "r")
    assert done.exit_code == 2
    message = " ".join(done.stderr.split())
    assert f'targets "A" and "B" {"lie" if "from" in why else ""}'.strip() in message
    assert why in message
    assert "keep what was measured" in message


def test_a_target_elsewhere_on_the_tool_that_a_controller_made_is_named(tmp_path):
    flange = (FLANGE[:, :3, 3] @ BASE[:3, :3].T + BASE[:3, 3]) * 1e3
    session_of(tmp_path, flange)
    done = call("check", tmp_path / "session.toml", "--robot", ROBOT.name)
    assert "target B: base and tool explain the positions to" in " ".join(done.stdout.split())


def test_reflectors_on_one_tool_stay_targets_whichever_shots_were_missed(tmp_path):
    other = (data().T[:, :3, 3] + data().T[:, :3, :3] @ (ARM + np.array([0.0, 0.02, 0.0]))) * 1e3
    other[::5] += 400.0  # another nest
    session_of(tmp_path, other)
    done = call("check", tmp_path / "session.toml", "--robot", ROBOT.name)
    assert "do not stay together" not in done.stdout + done.stderr


@pytest.mark.parametrize("names", [("m", "o"), ("z", "o")])
def test_a_file_of_where_the_robot_was_sent_is_left_aside(names, tmp_path):
    tables = {"j": joints(*J), names[0]: places(*"XYZ"), names[1]: places(*"XYZ", values=SENT)}
    for name, table in tables.items():
        (tmp_path / f"{name}.csv").write_text(csv(table))
    files = sorted(tmp_path.glob("*.csv"))
    said, _ = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert "o.csv, X, Y, Z are not used: they are a controller's own poses" in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.position, points() / 1e3, rtol=0, atol=1e-12)


@pytest.mark.parametrize("more", [False, True])
def test_a_station_whose_readings_a_controller_made_is_left_aside(more, tmp_path):
    """Beside one station, and beside two: the second one stands elsewhere."""
    own = {"id": np.arange(M)}
    tables = {"j": joints(*J), "m": places(*"XYZ"), "k": places(*"XYZ", values=nominal())}
    if more:
        tables["n"] = places(*"XYZ", values=points() @ BASE[:3, :3] + [10.0, 20.0, 30.0])
    for name, table in tables.items():
        (tmp_path / f"{name}.csv").write_text(csv(own | table))
    said, _ = proposed(tmp_path, sorted(tmp_path.glob("*.csv")), "--robot", ROBOT.name)
    assert "k.csv is left aside: it has a controller's own poses" in said
    (left,) = re.findall(r"errors are ([\d.]+) mm", " ".join(said.split()))
    assert float(left) > 0.01  # those of the tracker, not what rounding leaves of the controller's
    assert ("stations: each file is one" in said) is more
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert len(table) == M * (1 + more)
    np.testing.assert_allclose(table.position[:M], points() / 1e3, rtol=0, atol=1e-12)


def test_a_station_of_a_session_whose_readings_a_controller_made_is_named(tmp_path):
    own = {"pose_id": np.arange(M)}
    tables = {"j": joints(*(f"q{k}_deg" for k in range(1, 7)))}
    tables |= {"m": places("x_mm", "y_mm", "z_mm")}
    tables |= {"n": places("x_mm", "y_mm", "z_mm", values=nominal())}
    for name, table in tables.items():
        (tmp_path / f"{name}.csv").write_text(csv(own | table))
    (tmp_path / "session.toml").write_text(
        'format = 1\nmatch = "pose_id"\njoints.file = "j.csv"\npoints.files = ["m.csv", "n.csv"]\n'
        "uncertainty.position_um = 30\n"
    )
    done = call("check", tmp_path / "session.toml", "--robot", ROBOT.name)
    assert "station 2: base and tool explain the positions to" in " ".join(done.stdout.split())


def sent_log(ahead=2e-5):
    """What a controller logs: joints that it wanted and had, and where it was by these."""
    q = data().q
    log = {f"ROBOT_TARGET_JOINT_POSITIONS (J{k + 1})": q[:, k] + ahead for k in range(6)}
    log |= {f"ROBOT_ACTUAL_JOINT_POSITIONS (J{k + 1})": q[:, k] for k in range(6)}
    log |= {f"ROBOT_ACTUAL_JOINT_VELOCITIES (J{k + 1})": 1e-3 * np.sin(q[:, k]) for k in range(6)}
    return log | {f"ROBOT_CARTESIAN_COORD_TOOL ({a})": FLANGE[:, k, 3] for k, a in enumerate("xyz")}


def sent_screen():
    """Joints and places as a pendant shows them, with two decimals."""
    shown = {f"J{k + 1}": np.round(np.degrees(data().q[:, k]), 2) for k in range(6)}
    return shown | {a: np.round(1e3 * FLANGE[:, k, 3], 2) for k, a in enumerate("XYZ")}


@pytest.mark.parametrize("log", [sent_log, sent_screen], ids=["log", "screen"])
def test_places_that_a_controller_logs_beside_its_joints_do_not_replace_the_tracker(log, tmp_path):
    """They fitted best, of course: the file of the tracker was left aside without a word."""
    (tmp_path / "robot.csv").write_text(csv(log()))
    (tmp_path / "tracker.csv").write_text(
        csv({"Name": [f"P{k}" for k in range(M)]} | places(*"XYZ"))
    )
    files = [tmp_path / "robot.csv", tmp_path / "tracker.csv"]
    said, _ = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert "are not used: they are a controller's own poses" in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.position, points() / 1e3, rtol=0, atol=1e-12)


def of_controller(turned, scale):
    """Where a controller has the flange: a place and three numbers of a rotation."""
    R = Rotation.from_matrix(FLANGE[:, :3, :3])
    return np.column_stack([scale * FLANGE[:, :3, 3], turned(R)])


POSES = {
    "Universal Robots": of_controller(lambda R: R.as_rotvec(), 1.0),
    "KUKA": of_controller(lambda R: R.as_euler("ZYX", degrees=True), 1e3),
    "FANUC": of_controller(lambda R: R.as_euler("xyz", degrees=True), 1e3),
}


@pytest.mark.parametrize("poses", POSES.values(), ids=POSES)
@pytest.mark.parametrize("numbered", [pytest.param(True, marks=pytest.mark.slow), False])
def test_poses_of_a_controller_in_place_of_joints_are_told(poses, numbered, tmp_path):
    """It was asked whether this was the robot that was measured."""
    tables = {"pose.txt": poses, "lt.txt": points()}
    for name, rows in tables.items():
        rows = np.column_stack([np.arange(1, M + 1), rows]) if numbered else rows
        np.savetxt(tmp_path / name, rows, delimiter=",", fmt="%.9f")
    files = [tmp_path / name for name in tables]
    done = call("new", "session", *files, "--robot", ROBOT.name, "--out", tmp_path / "s.toml")
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "pose.txt: has where a controller says that the tool is, and no joints" in said


@pytest.mark.slow
def test_joints_of_another_arm_are_no_poses(tmp_path):
    np.savetxt(tmp_path / "a.txt", np.random.default_rng(0).uniform(-90, 90, (M, 6)), fmt="%.6f")
    np.savetxt(tmp_path / "b.txt", points(), fmt="%.6f")
    files = [tmp_path / "a.txt", tmp_path / "b.txt"]
    said, _ = proposed(tmp_path, files, "--robot", ROBOT.name)
    assert "is it the robot that was measured?" in said


@pytest.mark.slow
@pytest.mark.parametrize("order", ["joints first", "joints last"])
def test_a_pose_of_the_controller_between_joints_and_what_was_seen_is_left_aside(order, tmp_path):
    """Twelve numbers and a place that the tracker saw: the pose was read, with a warning."""
    q, poses = np.degrees(data().q), POSES["KUKA"]
    blocks = [q, poses, points()] if order == "joints first" else [poses, points(), q]
    np.savetxt(tmp_path / "a.txt", np.column_stack(blocks), fmt="%.9f")
    said, _ = proposed(tmp_path, [tmp_path / "a.txt"], "--robot", ROBOT.name)
    assert "these are a controller's own poses" not in said
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(table.position, points() / 1e3, rtol=0, atol=1e-12)
