"""Turns by an axis and the angle about it, against scipy as the second implementation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.files.rotations import AXIS, in_form, rotations
from tests.testbed.files.made import ROBOT, columns, csv, made
from tests.testbed.proposal.test_session import proposed

M = 20
DATA = made(m=M)
VECTORS = Rotation.from_matrix(DATA.T[:, :3, :3]).as_rotvec()
ANGLES = np.linalg.norm(VECTORS, axis=1)
AXES = VECTORS / ANGLES[:, None]
PLACES = {name: column for name, column in columns(DATA).items() if name[:2] in ("q1", "q2", "q3",
          "q4", "q5", "q6", "x_", "y_", "z_")}  # fmt: skip
STATED = "[frames]\n[uncertainty]\nposition_um = 30\nrotation_mdeg = 10\n"


def table(names=("axis_x", "axis_y", "axis_z", "axis_angle_rad"), axes=AXES, angles=ANGLES):
    return csv(PLACES | dict(zip(names, (*axes.T, angles), strict=True)))


def read(folder, text):
    (folder / "a.csv").write_text(text)
    (folder / "s.toml").write_text(STATED)
    return read_session(folder / "a.csv", ROBOT, config=folder / "s.toml")


def test_an_axis_of_any_length_stands_before_its_angle():
    lengths = np.linspace(0.5, 2, M)[:, None]
    numbers = np.hstack([AXES * lengths, ANGLES[:, None]])
    np.testing.assert_allclose(rotations(AXIS, numbers), DATA.T[:, :3, :3], atol=1e-14)
    np.testing.assert_allclose(rotations(AXIS, -numbers), DATA.T[:, :3, :3], atol=1e-14)
    np.testing.assert_array_equal(rotations(AXIS, [[0.0, 0, 0, 0], [0, 0, 1, 0]]), [np.eye(3)] * 2)


def test_of_the_numbers_that_mean_the_same_those_nearest_to_the_old_ones_are_written():
    signs = np.where(np.arange(M) % 2, 1.0, -1.0)[:, None]
    turns = 2 * np.pi * (np.arange(M) % 3)[:, None]
    old = np.hstack([signs * AXES, signs * ANGLES[:, None] + turns])
    np.testing.assert_allclose(in_form(AXIS, old, DATA.T[:, :3, :3]), old, atol=1e-12)
    still = np.array([[0.0, 0.6, 0.8, 0.0]])
    np.testing.assert_array_equal(in_form(AXIS, still, np.eye(3)[None]), still)


@pytest.mark.parametrize(
    ("names", "factor"),
    [
        (("Axis X", "Axis Y", "Axis Z", "Angle [deg]"), 180 / np.pi),
        (("kx", "ky", "kz", "theta"), 1.0),
    ],
    ids=["in words", "letters and no unit"],
)
def test_an_axis_and_an_angle_are_proposed_as_they_were_meant(names, factor, tmp_path):
    (tmp_path / "a.csv").write_text(table(names, angles=ANGLES * factor))
    said, _ = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", ROBOT.name)
    assert "to fix" not in said
    assert ("unit of the angle; assumed: rad" in said) is (factor == 1)
    found = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert found.is_pose.all()
    np.testing.assert_allclose(found.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.position, DATA.T[:, :3, 3], rtol=0, atol=1e-13)


def test_what_is_no_axis_is_refused_or_left_aside(tmp_path):
    with pytest.raises(InputError, match=r"a\.csv:4: the axis has length 0\.5; it should be 1"):
        read(tmp_path, table(axes=AXES * np.where(np.arange(M) == 2, 0.5, 1.0)[:, None]))
    rounded = read(tmp_path, table(axes=AXES * 1.0002))
    assert any("axes have lengths off 1 by up to 2.0e-04; scaled" in w for w in rounded.warnings)
    gone = np.where(np.arange(M) == 2, 0.0, 1.0)[:, None]
    with pytest.raises(InputError, match="the axis has length 0;"):  # and turns about it
        read(tmp_path, table(axes=AXES * gone))
    for name in ("axis_x,axis_y", "axis_angle_rad"):
        with pytest.raises(InputError, match=r"there is a column axis_.* but none for axis_"):
            read(tmp_path, table().replace(name, ",".join("no" + one for one in name.split(","))))
    (tmp_path / "b.csv").write_text(table(("ax", "ay", "az", "angle"), axes=9.81 * AXES))
    said, written = proposed(tmp_path, [tmp_path / "b.csv"], "--robot", ROBOT.name)
    assert "[points]" in written
    assert "columns ax, ay, az, angle" in said  # accelerations, which are not used
