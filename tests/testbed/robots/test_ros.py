"""Joint origins for ROS: evaluated in the drivers' convention by numpy alone, MuJoCo and truth."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from calib.geometry.chain import Chain
from calib.geometry.frames import step_transform
from calib.geometry.model import RobotModel
from testbed.robots.catalog import load_robot
from testbed.robots.placements import rpy
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.ros import HASH, KINEMATICS, ORIGINS, UR_LINKS, joint_origins, ros_files
from tests.truth.foreign import UR5, ForeignArm, candidates
from tests.truth.foreign_cells import UR5_LINKS

PROVEN = 1e-9
DRIVER = {
    "shoulder": (0, 0, 0.089159, 0, 0, 0),
    "upper_arm": (0, 0, 0, np.pi / 2, 0, 0),
    "forearm": (-0.425, 0, 0, 0, 0, 0),
    "wrist_1": (-0.39225, 0, 0.10915, 0, 0, 0),
    "wrist_2": (0, -0.09465, 0, np.pi / 2, 0, 0),
    "wrist_3": (0, 0.0823, 0, np.pi / 2, np.pi, np.pi),
}
"""x, y, z, roll, pitch, yaw of a UR5 as its maker's description ships them [m, rad]."""


def about(axis, angle):
    """A turn about x, y or z as a matrix (4, 4)."""
    c, s, T = np.cos(angle), np.sin(angle), np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)]["xyz".index(axis)]
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def origin(numbers):
    """What a URDF's <origin> means: first roll, then pitch, then yaw, about axes that stay."""
    x, y, z, roll, pitch, yaw = numbers
    T = about("z", yaw) @ about("y", pitch) @ about("x", roll)
    T[:3, 3] = x, y, z
    return T


def entries(text):
    """Names and six numbers of each joint, and what a comment says of base and tool."""
    joints, ends, name = {}, [], ""
    for line in text.splitlines():
        key, _, value = line.strip().partition(": ")
        if line.startswith("# ") and ": x: " in line:
            cells = line.split(": ", 1)[1].split(", ")
            ends.append([float(cell.split(": ")[1]) for cell in cells])
        elif line.startswith("#"):
            continue
        elif key.endswith(":"):
            name = key[:-1] if key not in ("kinematics:", "kinematic:") else name
        elif key in ("x", "y", "z", "roll", "pitch", "yaw"):
            joints.setdefault(name, []).append(float(value))
    return joints, ends


def driven(text, q, kinds):
    """Tool poses (m, 4, 4) as a driver has them: origin, then the joint about its own z."""
    joints, (base, tool) = entries(text)
    poses = []
    for row in q:
        T = origin(base)
        for k, numbers in enumerate(joints.values()):
            T = T @ origin(numbers)
            if k < len(row):
                slid = np.eye(4)
                slid[2, 3] = row[k]
                T = T @ (about("z", row[k]) if kinds[k] == "revolute" else slid)
        poses.append(T @ origin(tool))
    return np.array(poses)


def wrong(robot, seed, size=1.0):
    """The robot with every number off, base and tool far away."""
    rng, chain = np.random.default_rng(seed), robot.model.chain
    sd = size * np.array([3e-3, 1e-3, 1e-3, 3e-3, 3e-3])
    other = Chain(
        chain.links + sd * rng.normal(size=chain.links.shape), chain.kinds,
        step_transform(rng.normal(size=6)), step_transform(0.2 * rng.normal(size=6)),
    )  # fmt: skip
    return replace(robot, model=RobotModel(other))


def joints_of(robot, seed, count=40):
    low, high = robot.limits.T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


@pytest.mark.parametrize("name", ["universal_ur10", "staubli_tx60", "kuka_iiwa7"])
def test_origins_have_the_poses_of_the_robot_in_the_convention_of_xacro(name):
    robot = wrong(load_robot(name), 1)
    text, words = ros_files(robot)[ORIGINS]
    q = joints_of(robot, 2)
    assert list(entries(text)[0]) == [f"joint{k}" for k in range(1, len(robot.limits) + 2)]
    assert np.abs(driven(text, q, robot.model.chain.kinds) - robot.model.poses(q)).max() < PROVEN
    assert "as joint origins for xacro" in words


def test_a_slide_is_an_origin_like_any():
    chain = Chain(
        [[0.1, 0.3, 0.2, 0.5, 0.0], [0.2, 0.1, 0.3, -0.4, 0.1]], ("prismatic", "revolute")
    )
    robot = replace(
        load_robot("staubli_tx60"), model=RobotModel(chain), limits=np.array([[-0.2, 0.3], [-2, 2]])
    )
    text, _ = ros_files(robot)[ORIGINS]
    q = joints_of(robot, 3)
    assert np.abs(driven(text, q, chain.kinds) - robot.model.poses(q)).max() < PROVEN


def test_the_file_of_a_nominal_ur5_is_the_one_that_its_maker_ships(ur5):
    found, ends = entries(ros_files(ur5)[KINEMATICS][0])
    assert tuple(found) == UR_LINKS
    for name, numbers in DRIVER.items():
        # wrist_3's turn is written in another way
        np.testing.assert_allclose(origin(found[name]), origin(numbers), atol=1e-15)
    np.testing.assert_allclose(ends, np.zeros((2, 6)), atol=1e-15)


def test_the_driver_moves_a_nominal_ur5_as_an_arm_of_other_formulas_moves(ur5):
    """Products of exponentials about the axes of the home pose."""
    text, _ = ros_files(ur5)[KINEMATICS]
    q = candidates(np.random.default_rng(4), 50, UR5)
    there = driven(text, q, ["revolute"] * 6)
    truth = ForeignArm(UR5, tool=np.zeros(3)).poses(q)[0]
    np.testing.assert_allclose(there[:, :3, 3], truth, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_a_calibrated_ur_has_its_poses_in_the_drivers_file_and_numbers_near_nominal(seed, ur5):
    robot = wrong(ur5, seed)
    text, words = ros_files(robot)[KINEMATICS]
    q = joints_of(robot, seed)
    assert np.abs(driven(text, q, ["revolute"] * 6) - robot.model.poses(q)).max() < PROVEN
    found, _ = entries(text)
    for name, numbers in DRIVER.items():
        near, shipped = origin(found[name]), origin(numbers)
        # some milliradians on a meter, and where axes all but meet
        assert np.abs(near - shipped).max() < 0.03, name
    assert f"hash: {HASH}" in text
    assert "the hash of a controller cannot be made here" in words


def test_mujoco_drives_the_same_poses_from_the_drivers_file(ur5):
    robot = wrong(ur5, 7)
    found, (base, tool) = entries(ros_files(robot)[KINEMATICS][0])

    def placed(numbers, inside):
        T = origin(numbers)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, T[:3, :3].ravel())
        places = (" ".join(repr(float(v)) for v in part) for part in (T[:3, 3], quaternion))
        return '<body pos="{}" quat="{}">'.format(*places) + inside + "</body>"

    solid = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    text = placed(tool, solid)
    for numbers in reversed(found.values()):
        text = placed(numbers, f'<joint type="hinge" axis="0 0 1"/>{solid}{text}')
    world = f"<worldbody>{placed(base, solid + text)}</worldbody>"
    model = mujoco.MjModel.from_xml_string(f'<mujoco><compiler angle="radian"/>{world}</mujoco>')
    data = mujoco.MjData(model)
    for q in joints_of(robot, 8, 10):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        expected = robot.model.poses(q[None])[0]
        assert np.abs(data.xpos[-1] - expected[:3, 3]).max() < PROVEN
        assert np.abs(data.xmat[-1].reshape(3, 3) - expected[:3, :3]).max() < PROVEN


def test_a_ur_read_from_its_urdf_has_the_drivers_file_too():
    """There the base is turned by half a turn, and the links have other numbers."""
    toml = load_robot("universal_ur10")
    read = load_robot(toml.folder / "universal_ur10.urdf")
    one, two = (entries(ros_files(robot)[KINEMATICS][0])[0] for robot in (toml, read))
    for name in UR_LINKS:
        np.testing.assert_allclose(origin(one[name]), origin(two[name]), atol=1e-9)


@pytest.mark.parametrize("name", ["staubli_tx60", "kuka_iiwa7"])
def test_other_arms_have_no_file_of_a_ur(name):
    assert list(ros_files(load_robot(name))) == [ORIGINS]


def test_a_file_that_has_other_poses_is_never_written(ur5, monkeypatch, tmp_path):
    monkeypatch.setattr("testbed.robots.write.ros.rpy", lambda _: (0.0, 0.0, 0.0))
    with pytest.raises(RuntimeError, match="differs from the robot by"):
        write_robot_folder(ur5, tmp_path / "robot")
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def ur5():
    chain = Chain(UR5_LINKS)
    return replace(load_robot("universal_ur10"), name="ur5", model=RobotModel(chain), visuals=())


@pytest.mark.parametrize("off", [0.0, 1e-15, 2.05e-10, 1e-9, 1e-8, 1e-6, 1e-3])
def test_origins_near_a_pitch_of_a_quarter_turn_keep_every_digit(off, tmp_path):
    """Of 1.570796327, as many URDFs have it, half pi is 2.05e-10 away."""
    small = load_robot("staubli_tx60")
    quarter = np.pi / 2 + off
    links = np.tile([quarter, 0.2, 0.3, quarter, 0.0], (6, 1)) * [[1], [1], [-1], [1], [1], [-1]]
    links[3:, 4] = quarter
    chain = replace(small.model.chain, links=links)
    robot = replace(small, model=RobotModel(chain), visuals=())
    # each file is read again and compared; what is said is shortened below 1e-12
    told = write_robot_folder(robot, tmp_path / "out")
    assert all("< 1e-12 m and < 1e-12 rad" in one for one in told[:1] + told[4:])
    pitched = [rpy(T) for T in joint_origins(chain)]
    # six products of matrices round to some 1e-16 each
    for T, angles in zip(joint_origins(chain), pitched, strict=True):
        np.testing.assert_allclose(origin((0, 0, 0, *angles))[:3, :3], T[:3, :3], atol=2e-14)
    assert any(np.cos(pitch) < 1.1 * off + 1e-15 for _, pitch, _ in pitched)
