"""Joints that turn the other way, several at once: named before a left-handed frame."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.alternatives import Alternative, Interpretation
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.tried.joint_signs import other_signs
from testbed.files.tried.quarter_turns import QUARTER
from testbed.robots.catalog import load_robot
from testbed.robots.controller import AS_THE_ARM
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.files.tried.test_quarter_turns import read, table

M = 30
# an arm with a plane of symmetry at zero: axes 1, 4, 6 lie in it, 2, 3, 5 stand on it
LINKS = ((0, 400, 25, -90), (0, 0, 560, 0), (-90, 0, 35, -90), (0, 515, 0, 90), (0, 0, 0, -90),
         (0, 90, 0, 0))  # fmt: skip


def arm(folder, statements=(), zero=0.0):
    """Such an arm, with statements of its controller, and theta of joint 3 off by `zero` [deg]."""
    rows = [
        f'[[joints]]\nkind = "revolute"\ntheta_deg = {theta - zero * (k == 2)}\nd_mm = {d}\n'
        f"a_mm = {a}\nalpha_deg = {alpha}\nlower_deg = -200\nupper_deg = 200\n"
        for k, (theta, d, a, alpha) in enumerate(LINKS)
    ]
    if statements:
        rows.append(f"[controller]\njoints = [{', '.join(map(repr, statements))}]\n")
    file = folder / "robot.toml"
    file.write_text('format = 1\nname = "arm"\n' + "\n".join(rows))
    return load_robot(file)


def seen(robot, signs, tip=(0.03, -0.02, 0.12), *, m=M, zero=0.0):
    """Joints of a controller that turns some the other way, and points by its arm [rad, m]."""
    rng = np.random.default_rng(5)
    J = rng.uniform(-1.4, 1.4, (m, 6))
    q = J * signs
    q[:, 2] += np.radians(zero)
    T = robot.model.poses(q)
    points = T[:, :3, :3] @ tip + T[:, :3, 3]
    return J, points + rng.normal(0, 3e-5, points.shape)


def session(folder, robot, J, points):
    """Those as a session."""
    columns = {f"q{k + 1}_deg": np.degrees(J[:, k]) for k in range(6)}
    columns |= {f"{axis}_mm": 1e3 * points[:, k] for k, axis in enumerate("xyz")}
    (folder / "d.csv").write_text(csv(columns))
    (folder / "session.toml").write_text(
        '[joints]\nfile = "d.csv"\n[points]\nfile = "d.csv"\n[uncertainty]\nposition_um = 30\n'
    )
    return read_session(folder, robot)


KUKA = np.array([-1, 1, 1, -1, 1, -1])
LINE = 'joints = ["q1 = -J1", "q4 = -J4", "q6 = -J6"]'


def refused(folder, robot, J, points):
    with pytest.raises(InputError) as caught:
        probe(robot, session(folder, robot, J, points)).raise_if_wrong()
    return str(caught.value)


@pytest.mark.parametrize("m", [10, M])
def test_signs_are_named_before_a_left_handed_frame(m, tmp_path):
    """It blamed the export alone; who mirrored it got a mirrored robot."""
    robot = arm(tmp_path)
    J, points = seen(robot, KUKA, m=m)
    said = refused(tmp_path, robot, J, points)
    assert "if joints 1, 4 and 6 turn the other way, which points show in the same way as a" in said
    assert f"write {LINE} under [controller] in its robot.toml; check the axes" in said
    # with that line the same table is read
    mended = arm(tmp_path, ("q1 = -J1", "q4 = -J4", "q6 = -J6"))
    probe(mended, session(tmp_path, mended, J, points)).raise_if_wrong()


def test_a_mirrored_export_is_named_first_where_the_signs_are_stated(tmp_path):
    robot = arm(tmp_path, ("q1 = -J1", "q4 = -J4", "q6 = -J6"))
    J, points = seen(robot, KUKA)
    said = refused(tmp_path, robot, J, points * [1, -1, 1])
    assert "if one of x, y, z has the other sign or two are swapped, or if joints 1, 4" in said
    assert "check the axes of the export; or, if it is right-handed, take" in said
    assert 'take "q1 = -J1", "q4 = -J4" and "q6 = -J6" out of [controller]' in said


@pytest.mark.parametrize("zero", [90.0, -90.0, 180.0])
def test_signs_and_the_zero_of_one_joint_are_found_together(zero, tmp_path):
    """There was no help at all: "none of the interpretations fits"."""
    J, points = seen(arm(tmp_path), KUKA)
    robot = arm(tmp_path, zero=zero)
    said = refused(tmp_path, robot, J, points)
    assert f"the zero of joint 3 is turned by {zero:+.0f} deg; write {LINE}" in said
    assert f"add {zero:+.0f} deg to theta_deg of joint 3 there" in said
    mended = arm(tmp_path, ("q1 = -J1", "q4 = -J4", "q6 = -J6"))
    probe(mended, session(tmp_path, mended, J, points)).raise_if_wrong()


def test_a_sign_that_no_reading_tells_is_said_to_be_so(tmp_path):
    """A reflector on the last axis does not move with that joint."""
    robot = arm(tmp_path)
    said = refused(tmp_path, robot, *seen(robot, KUKA, tip=(0.0, 0.0, 0.12)))
    assert "joints 1, 4 and 6 turn the other way (of joint 6 these readings do not tell it)" in said


def test_signs_that_no_reading_tells_are_not_guessed(tmp_path):
    """A reflector in the center of the wrist moves with no joint of it."""
    robot = arm(tmp_path)
    mirror = Alternative("mirror", "if x has the other sign", "check the axes", "M20", "x")

    def found(height):
        """What is said of a reflector so high on the last axis [m]."""
        J, points = seen(robot, KUKA, tip=(0.0, 0.0, height))
        return other_signs(robot.model, AS_THE_ARM, Interpretation(J, points, None), mirror)

    assert found(-0.09) is None
    assert found(0.12)[0].code == "M20"  # of the last alone nothing is told


def test_an_arm_without_a_plane_of_symmetry_has_a_left_handed_frame(tmp_path):
    robot = load_robot("universal_ur10")
    J, points = seen(robot, np.ones(6))
    said = refused(tmp_path, robot, J, points * [1, -1, 1])
    assert "if one of x, y, z has the other sign or two are swapped" in said
    assert "turn the other way" not in said


def test_nothing_is_found_where_joints_and_points_have_nothing_in_common(tmp_path):
    robot = arm(tmp_path)
    J, points = seen(robot, np.ones(6))
    for seed in range(5):
        mixed = points[np.random.default_rng(seed).permutation(M)]
        rows = Interpretation(J, mixed, None)
        assert other_signs(robot.model, AS_THE_ARM, rows, None) is None
    few = Interpretation(J[:11] * KUKA + QUARTER * np.eye(6)[2], points[:11], None)
    assert other_signs(robot.model, AS_THE_ARM, few, None) is None


def test_full_poses_tell_signs_from_a_frame(tmp_path):
    """Rotations have no mirror image: two joints that turned the other way were no help at all."""
    found = table([0] * 6, poses=True)
    found["q4_deg"], found["q6_deg"] = -found["q4_deg"], -found["q6_deg"]
    with pytest.raises(InputError, match=r"if joints 4 and 6 turn the other way; write joints"):
        probe(ROBOT, read(tmp_path, found)).raise_if_wrong()
