"""Files without names: a controller's poses beside places, and what is not that."""

import numpy as np
import pytest

from calib.geometry.frames import exp_so3, target_points, transform
from testbed.proposal.data import look_at
from testbed.proposal.fits.poses_for_joints import poses_for_joints
from tests.command import call
from tests.testbed.files.made import ROBOT

LEVER = np.array([0.05, 0.0, 0.1])
TURN, SHIFT = exp_so3(np.array([0.0, 0.0, 0.7])), np.array([3.0, 1.0, 0.2])
LOW, HIGH = np.tile([-1.2, -1.0, 0.4], (13, 1)), np.tile([0.1, -0.4, 2.6], (13, 1))
"""Rotation vectors whose last number might be a distance [rad]."""
NO_JOINTS = "has where a controller says that the tool is, and no joints"


def lines(rows):
    """Text of rows of numbers with commas."""
    return "".join(",".join(f"{v:.6g}" for v in row) + "\n" for row in rows)


@pytest.mark.parametrize("numbered", [False, True])
def test_poses_of_a_controller_beside_places_are_no_joints_and_distances(tmp_path, numbered):
    """With a number before them, these were taken for joint 1 and the last angle for distances:
    thirteen of at most 2.6 mm fitted, and the tracker's places were not used."""
    rng = np.random.default_rng(0)
    place, turn = rng.uniform([-0.8, -0.4, 0.1], [0.4, 0.7, 0.9], (13, 3)), rng.uniform(LOW, HIGH)
    poses = np.hstack([place, turn])
    places = 1e3 * (target_points(transform(exp_so3(turn), place), LEVER) @ TURN.T + SHIFT)
    if numbered:
        poses, places = (np.column_stack([np.arange(1, 14), one]) for one in (poses, places))
    (tmp_path / "a.txt").write_text(lines(poses))
    (tmp_path / "b.txt").write_text(lines(places))
    done = call("new", "session", tmp_path / "a.txt", tmp_path / "b.txt", "--robot",
                "universal_ur10", "--out", tmp_path / "session.toml")  # fmt: skip
    assert done.exit_code == 2
    assert NO_JOINTS in done.stderr


def test_places_that_hardly_differ_make_no_poses_of_joints(tmp_path):
    """Of a ball that a scanner on the flange sees within 20 mm, any six numbers leave as little:
    joints of small angles were said to be poses."""
    rng = np.random.default_rng(0)
    (tmp_path / "a.txt").write_text(lines(rng.normal(0, 10, (40, 6))))
    (tmp_path / "b.txt").write_text(lines(rng.normal([0, 0, 20], 6, (40, 3))))
    looks = look_at([tmp_path / "a.txt", tmp_path / "b.txt"], tmp_path)
    assert poses_for_joints(looks, ROBOT) is None
