"""Names of joints and rotations that stand in real files, each read as it was meant."""

import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from testbed.files.tried.own_file import with_robot_toml
from testbed.robots.catalog import load_robot
from testbed.studies import load_scenario
from tests.command import call
from tests.testbed.files.made import made
from tests.testbed.proposal.test_odd_files import UR10
from tests.testbed.proposal.test_session import proposed

M = 16
DATA = made(5, M, robot=UR10)
DEG, MM = np.degrees(DATA.q), 1e3 * DATA.T[:, :3, 3]
TURNED = DATA.T[:, :3, :3]
WXYZ = Rotation.from_matrix(TURNED).as_quat(scalar_first=True)
BY_COLUMNS = TURNED.transpose(0, 2, 1).reshape(M, 9)
COUNTED = [f"q{k}" for k in range(1, 7)]
PLACE = ["x", "y", "z"]

FILES = {
    "q0 beside qx is no joint": (
        [*COUNTED, *PLACE, "q0", "qx", "qy", "qz"], [DATA.q, MM / 1e3, WXYZ],
    ),
    "normal, orientation, approach": (
        [*COUNTED, *(f"{c}{a}" for c in "noap" for a in "xyz")], [DEG, BY_COLUMNS, MM],
    ),
    "a matrix as MATLAB counts": (
        [*(f"J{k}" for k in range(1, 7)), *"XYZ",
         *(f'"R({i},{j})"' for i in "123" for j in "123")],
        [DEG, MM, TURNED.reshape(M, 9)],
    ),
    "joints counted in words": ([f"第{c}轴" for c in "一二三四五六"] + PLACE, [DEG, MM]),
    "vectors as OpenCV counts": (
        [*COUNTED, *(f"{word}_{k}" for word in ("tvec", "rvec") for k in range(3))],
        [DEG, MM, Rotation.from_matrix(TURNED).as_rotvec()],
    ),
    "axes and what they mean in one word": (
        [*COUNTED, *(f"{axis}{word}" for word in ("cmd", "Meas") for axis in "XYZ")],
        [DEG, np.hstack([MM[::-1], MM])],
    ),
    "joints counted behind the word": ([f"关节{c}" for c in "一二三四五六"] + PLACE, [DEG, MM]),
}  # fmt: skip


@pytest.mark.parametrize(("head", "blocks"), FILES.values(), ids=FILES)
def test_columns_are_what_their_names_say(head, blocks, tmp_path):
    rows = [",".join(f"{v:.11f}" for v in row) for row in np.hstack(blocks)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(head), *rows]), encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert "to fix" not in said
    assert "Not used" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-10)
    assert table.is_pose.all() == (len(blocks) == 3)
    if len(blocks) == 3:
        np.testing.assert_allclose(table.rotation, TURNED, rtol=0, atol=1e-9)


def forked(folder):
    """A URDF of two ends, and measurements of a point at one of them."""
    joints = ["base", *(f"link{k}" for k in range(1, 4))]
    text = "".join(f'<link name="{name}"/>' for name in (*joints, "probe", "lamp"))
    axes, places = ("0 0 1", "0 1 0", "0 1 0"), ("0 0 0.3", "0 0 0.2", "0.4 0 0")
    for k, (axis, place) in enumerate(zip(axes, places, strict=True)):
        text += (
            f'<joint name="j{k + 1}" type="revolute"><parent link="{joints[k]}"/>'
            f'<child link="{joints[k + 1]}"/><origin xyz="{place}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )
    for end in ("probe", "lamp"):
        text += (
            f'<joint name="to_{end}" type="fixed"><parent link="link3"/><child link="{end}"/>'
            f'<origin xyz="0.3 0 {0.05 if end == "lamp" else 0}"/></joint>'
        )
    (folder / "arm.urdf").write_text(f'<robot name="forked">{text}</robot>')
    arm = load_robot(str(folder / "arm.urdf"), tip="probe")
    q = np.random.default_rng(3).uniform(-1, 1, (20, 3))
    rows = np.hstack([np.degrees(q), 1e3 * arm.model.poses(q)[:, :3, 3]])
    lines = [",".join(f"{v:.9f}" for v in row) for row in rows]
    (folder / "a.csv").write_text("\n".join(["j1,j2,j3,x,y,z", *lines]))
    return folder / "arm.urdf", folder / "a.csv"


def test_an_arm_of_several_ends_is_told_apart_by_its_tip(tmp_path):
    arm, data = forked(tmp_path)
    out = tmp_path / "session.toml"
    done = call("new", "session", data, "--robot", arm, "--out", out)
    assert done.exit_code == 2
    assert "--tip LINK" in done.stderr
    said, text = proposed(tmp_path, [data], "--robot", arm, "--tip", "probe")
    for told in (said, text):
        assert "session.toml --tip probe" in " ".join(told.replace("#", "").split())
    for file, more in ((arm, ()), (out, ("--robot", arm))):
        done = call("check", file, *more)
        assert done.exit_code == 2
        assert "--tip LINK" in done.stderr
        done = call("check", file, *more, "--tip", "probe")
        assert done.exit_code == 0, done.stderr


@pytest.mark.parametrize(
    ("without", "said"),
    [("mount", "; if mount_joint stood still, name a link before it as --tip"), ("elbow", "")],
)
def test_columns_named_as_all_joints_but_one_are_no_table_without_joints(tmp_path, without, said):
    """Of an arm that ends in a mount which nobody turned, "not known" were all other joints."""
    names = ("lift", "elbow", "mount")
    arm, data = forked(tmp_path)
    text, table = arm.read_text(), data.read_text()
    for k, name in enumerate(names, start=1):
        text = text.replace(f'"j{k}"', f'"{name}_joint"')
        # what is no joint of this arm is no column of its joints
        table = table.replace(f"j{k}", "remark" if name == without else f"{name}_joint")
    arm.write_text(text)
    data.write_text(table)
    out = tmp_path / "s.toml"
    done = call("new", "session", data, "--robot", arm, "--tip", "probe", "--out", out)
    assert done.exit_code == 2
    assert done.stderr.strip() == (
        f"{data}: has columns for 2 joints, and none for {without}_joint; forked has 3 joints; "
        f"give all of them, or another ROBOT{said}. [M35]"
    )
    assert not out.exists()


def test_one_column_with_the_name_of_a_joint_is_no_table_of_joints(tmp_path):
    """It may be anything: what is said is that the others are not known."""
    arm, data = forked(tmp_path)
    arm.write_text(arm.read_text().replace('"j2"', '"elbow"'))
    data.write_text(data.read_text().replace("j1", "a remark").replace("j2", "elbow"))
    data.write_text(data.read_text().replace("j3", "another"))
    done = call("new", "session", data, "--robot", arm, "--tip", "probe", "--out", tmp_path / "s")
    assert "has columns for 1 joint" not in done.output


def test_other_advice_is_not_about_robot_toml():
    own = SimpleNamespace(own_text=SimpleNamespace(path=Path("arm.urdf"), tip="probe"))
    other = SimpleNamespace(alternative=SimpleNamespace(fix="write -q2 for q2"))
    assert with_robot_toml(other, own) is other


def test_a_line_for_robot_toml_comes_with_how_a_urdf_becomes_one(tmp_path):
    """Of a large arm whose forearm is counted from the horizontal: its owner had a URDF alone."""
    arm, data = forked(tmp_path)
    head, *lines = data.read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    rows[:, 2] -= rows[:, 1]
    written = [",".join(f"{v:.9f}" for v in row) for row in rows]
    data.write_text("\n".join([head, *written]))
    asked = ("new", "session", data, "--out", tmp_path / "session.toml", "--robot")
    said = call(*asked, arm, "--tip", "probe").stderr
    assert 'write joints = ["q3 = J3 + J2"] under [controller] in its robot.toml; arm.urdf' in said
    (command,) = re.findall(r"truebed (new robot \S+ --tip probe) writes a robot.toml to", said)
    # as it says
    assert call(*shlex.split(command), "--out", tmp_path / "folder").exit_code == 0
    with (tmp_path / "folder" / "robot.toml").open("a") as file:
        file.write('\n[controller]\njoints = ["q3 = J3 + J2"]\n')
    done = call(*asked, tmp_path / "folder" / "robot.toml")
    assert done.exit_code == 0, done.stderr


def test_meshes_that_are_elsewhere_play_no_part_before_anything_is_drawn(tmp_path):
    arm, data = forked(tmp_path)
    drawn = '<link name="link1"><visual><geometry><mesh filename="package://a/b.stl"/></geometry>'
    text = arm.read_text().replace('<link name="link1"/>', f"{drawn}</visual></link>")
    arm.write_text(text)
    assert "b.stl" in text
    tip = ("--robot", arm, "--tip", "probe")
    said, text = proposed(tmp_path, [data], *tip)
    for told in (said, text):
        command = "session.toml --tip probe --allow-missing-meshes"
        assert command in " ".join(told.replace("#", "").split())
    for file in (data, tmp_path / "session.toml"):
        done = call("check", file, *tip)
        assert done.exit_code == 0, done.stderr
    done = call("check", arm, "--tip", "probe")
    assert done.exit_code == 2
    assert "b.stl is missing" in done.stderr


def test_a_scene_takes_the_arm_that_its_tip_tells_apart(tmp_path):
    """A scenario names a file alone: the arm of the tip is written beside it."""
    arm, _ = forked(tmp_path)
    out = tmp_path / "scene.toml"
    done = call("new", "scene", arm, "--out", out)
    assert done.exit_code == 2
    assert "--tip LINK" in done.stderr
    assert not out.exists()
    done = call("new", "scene", arm, "--tip", "probe", "--out", out)
    assert done.exit_code == 0, done.stderr
    assert "Robot" in done.stdout
    named = load_robot(load_scenario(out).robot)
    q = np.random.default_rng(4).uniform(-1, 1, (20, 3))
    there = load_robot(str(arm), tip="probe").model.poses(q)
    np.testing.assert_allclose(named.model.poses(q), there, rtol=0, atol=1e-12)
    assert np.abs(there - load_robot(str(arm), tip="lamp").model.poses(q)).max() > 0.04


@pytest.mark.parametrize(
    ("names", "euler"),
    [
        ("Rot X|Rot Y|Rot Z", "XYZ"),
        ("Rot. X [°]|Rot. Y [°]|Rot. Z [°]", "XYZ"),
        ("RotationX|RotationY|RotationZ", "xyz"),
        ("EulerZ|EulerY|EulerX", "ZYX"),
        ("theta_x|theta_y|theta_z", "xyz"),
        ("Winkel X|Winkel Y|Winkel Z", "XYZ"),
        ("rvec_x|rvec_y|rvec_z", ""),
    ],
)
def test_turns_about_axes_are_no_second_places(names, euler, tmp_path):
    """They left no place at all, or were the place themselves."""
    R = Rotation.from_matrix(TURNED)
    turns = R.as_euler(euler, degrees=True) if euler else R.as_rotvec()
    head = ",".join([*(f"J{k}" for k in range(1, 7)), *"XYZ", *names.split("|")])
    rows = np.hstack([DEG, MM, turns])
    np.savetxt(tmp_path / "a.csv", rows, "%.11f", ",", header=head, comments="", encoding="utf-8")
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", UR10.name)
    assert "unused" not in said
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(table.rotation, TURNED, rtol=0, atol=1e-10)
