"""The frame and the controller that a program is for: those of the robot's own file."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import inverse, log_so3
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.model import RobotModel
from testbed.files.programs.correct import correct_program
from testbed.files.programs.said import frame_words
from testbed.robots.catalog import load_robot
from testbed.robots.file_frames import chain_words
from testbed.robots.write.identified import identified_robot
from testbed.robots.write.toml import robot_toml
from tests.command import call
from tests.testbed.files.test_program import ROBOT, Q, cells, written
from tests.testbed.robots.described_cases import HALF, TURN, urdf
from tests.testbed.robots.robot_cases import yourdfpy_poses

JOINTS = [f"q{k}_deg" for k in range(1, 7)]
TURNS = [f"rv{axis}_deg" for axis in "xyz"]
PLACE = ["x_mm", "y_mm", "z_mm"]
CLOCKWISE = urdf(
    "clockwise",
    [
        ("mount", "fixed", "1 0.5 0.2", "0 0 0.3", "1 0 0", None),
        ("a1", "revolute", "0 0 0.45", "0 0 0", "0 0 -1", TURN),
        ("a2", "revolute", "0.15 0 0", "0 0 0", "0 1 0", TURN),
        ("a3", "revolute", "0.61 0 0", "0 0 0", "0 1 0", TURN),
        ("a4", "revolute", "0 0 0.02", "0 0 0", "-1 0 0", TURN),
        ("a5", "revolute", "0.66 0 0", "0 0 0", "0 1 0", TURN),
        ("a6", "revolute", "0.08 0 0", "0 0 0", "-1 0 0", TURN),
        ("tool0", "fixed", "0 0 0", f"0 {HALF} 0", "1 0 0", None),
    ],
)
"""On a mount in a cell, and turning clockwise: its chain begins in a frame that the file has not.
"""


@pytest.fixture(scope="module")
def clockwise(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "clockwise.urdf"
    path.write_text(CLOCKWISE, encoding="utf-8")
    return load_robot(path)


def moved(robot):
    """The robot as it really is."""
    chain = robot.model.chain
    rng = np.random.default_rng(1)
    own = chain.moved(rng.normal(size=chain.n_numbers) * 2e-4)
    # base and tool are those that programs know
    return RobotModel(
        replace(own, T_world_base=chain.T_world_base, T_flange_tool=chain.T_flange_tool)
    )


def poses_of(T):
    return np.hstack([1e3 * T[:, :3, 3], np.degrees(log_so3(T[:, :3, :3]))])


def test_poses_of_a_program_stand_in_the_root_of_the_file(tmp_path, clockwise):
    """What another reader of the file calls the pose of its tip."""
    q, real = Q - [0, np.pi / 2, 0, 0, 0, 0], moved(clockwise)
    T = yourdfpy_poses(clockwise.own_text.path, q, "tool0_link")
    head = [*PLACE, *TURNS, *JOINTS]
    path = written(tmp_path / "p.csv", head, np.hstack([poses_of(T), np.degrees(q)]).tolist())
    found = correct_program(path, clockwise, real, tmp_path / "out.csv")
    assert found.corrected.all()
    rows = cells(tmp_path / "out.csv")
    new = np.array([[float(row[name]) for name in head[:6]] for row in rows])
    told = T.copy()
    told[:, :3, 3] = new[:, :3] / 1e3
    # the controller takes the place from the program, and its own model to reach it
    assert np.abs(poses_of(T)[:, :3] - new[:, :3]).max() < 10.0
    same = correct_program(
        written(tmp_path / "j.csv", JOINTS, np.degrees(q).tolist()), clockwise, real,
        tmp_path / "j_out.csv",
    )  # fmt: skip
    sent = clockwise.model.poses(same.q)
    np.testing.assert_allclose(new, poses_of(sent), atol=1e-6)  # a search that ends at 1e-9 m
    taken = inverse_kinematics(clockwise.model, sent, q, clockwise.limits).q
    assert np.abs(real.poses(taken)[:, :3] - T[:, :3]).max() < 1e-9
    said = "the poses of the program are taken as those of the tool in the root link of "
    assert f"{said}clockwise.urdf" in found.sentences
    assert not any(one.startswith(said) for one in same.sentences)


def test_poses_for_a_robot_toml_stand_in_its_base(tmp_path):
    """However that stands in the room."""
    hung = replace(ROBOT.model.chain, T_world_base=np.diag([1.0, -1.0, -1.0, 1.0]))
    robot = replace(ROBOT, model=RobotModel(hung))
    T = ROBOT.model.poses(Q)
    rows = np.hstack([poses_of(T), np.degrees(Q)]).tolist()
    path = written(tmp_path / "p.csv", [*PLACE, *TURNS, *JOINTS], rows)
    found = correct_program(path, robot, moved(robot), tmp_path / "out.csv")
    assert found.corrected.all()
    assert not any("poses of the program" in one for one in found.sentences)


def test_a_robot_that_was_calibrated_before_is_said_to_be_the_controllers(tmp_path):
    """Its own program came back unchanged, with a radius that a nominal controller misses."""
    known = identified_robot(ROBOT, moved(ROBOT), name="mine")
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "robot.toml").write_text(robot_toml(replace(known, visuals=())), encoding="utf-8")
    known = load_robot(folder)
    path = written(tmp_path / "p.csv", JOINTS, np.degrees(Q).tolist())
    found = correct_program(path, known, known.model, tmp_path / "out.csv")
    assert found.sentences[1].startswith(
        "the numbers of mine were identified before, as its file says: the program is corrected "
        "for a controller that computes with these"
    )
    found = correct_program(path, ROBOT, known.model, tmp_path / "other.csv")
    assert not any("identified before" in one for one in found.sentences)


def test_the_robot_toml_of_a_urdf_has_a_base_of_its_own_and_that_is_said(tmp_path, monkeypatch):
    """The same program was for other places: those of another frame, in silence."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(CLOCKWISE, encoding="utf-8")
    own = load_robot("arm.urdf")
    done = call("new", "robot", "arm.urdf")
    stands = chain_words(own)
    assert stands.startswith("at (1000, 500, 650) mm in the root link of arm.urdf, turned by the")
    assert done.stdout.splitlines()[1:-1] == [
        f"  frames   programs for it state poses in its base, {stands}"
    ]
    made = load_robot("clockwise")
    q = Q - [0, np.pi / 2, 0, 0, 0, 0]
    rows = np.hstack(
        [poses_of(inverse(own.model.chain.T_world_base) @ own.model.poses(q)), np.degrees(q)]
    )
    path = written(tmp_path / "p.csv", [*PLACE, *TURNS, *JOINTS], rows.tolist())
    found = correct_program(path, made, moved(made), tmp_path / "out.csv")
    assert found.corrected.all()
    said = "the poses of the program are taken as those of the tool in the base of robot.toml"
    assert any(one.startswith(f"{said}, which is not the root of") for one in found.sentences)
    # where its root is its base, only its tip is no flange, but turned half way
    upright = CLOCKWISE.replace('"0 0 -1"', '"0 0 1"').replace('"1 0.5 0.2"', '"0 0 0"')
    upright = upright.replace('"0 0 0.3"', '"0 0 0"')
    beside = f'xyz="0 0 0.007" rpy="0 {HALF} 0"'  # of its last axis
    upright = upright.replace(f'xyz="0 0 0" rpy="0 {HALF} 0"', beside)
    (tmp_path / "up.urdf").write_text(upright, encoding="utf-8")
    done = call("new", "robot", "up.urdf", "--out", "up/robot.toml")
    (said,) = done.stdout.splitlines()[1:-1]
    assert said.startswith(
        "  frames   tools in use and payloads are stated at its flange, in which tool0_link is at "
        "(0, 0, 0) mm, turned by the rotation vector (0, 0, "
    )
    assert said.endswith("180) deg")
    assert frame_words(load_robot("up")) == ()


def test_a_folder_of_a_urdf_is_called_no_other_file_and_never_written_over(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(CLOCKWISE, encoding="utf-8")
    done = call("new", "robot", "arm.urdf", "--out", "arm.toml")
    assert done.exit_code == 2
    assert done.stderr == (
        "arm.toml: of a URDF or MJCF a folder is written, with its robot.toml; name one. [C40]\n"
    )
    assert not (tmp_path / "arm.toml").exists()
    call("new", "robot", "arm.urdf")
    done = call("new", "robot", "arm.urdf")
    assert done.stderr.endswith("more; choose another folder. [C40]\n")
