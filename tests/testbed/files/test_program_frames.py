"""The frame and the controller that a program is for: those of the robot's own file."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import log_so3
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.model import RobotModel
from testbed.files.programs.correct import correct_program
from testbed.robots.catalog import load_robot
from testbed.robots.write.identified import identified_robot
from testbed.robots.write.toml import robot_toml
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
