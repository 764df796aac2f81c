"""A robot.toml of link numbers and limits alone: what it leaves open is assumed, and said."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.robots.catalog import load_robot
from testbed.robots.file import RobotFile
from testbed.run.play import robot_of
from testbed.scenario.read import changed
from testbed.studies import load_scenario

LINK = '[[joints]]\nkind = "revolute"\ntheta_deg = 0\nd_mm = {}\na_mm = {}\nalpha_deg = {}\n'
LIMITS = "lower_deg = -180\nupper_deg = 180\n"


def robot_file(folder, *links, more=""):
    text = 'format = 1\nname = "plain"\n'
    text += "".join(LINK.format(*link) + LIMITS + more for link in links)
    (folder / "robot.toml").write_text(text)
    return folder / "robot.toml"


def test_link_numbers_and_limits_are_enough(tmp_path):
    robot = load_robot(robot_file(tmp_path, (200, 300, 0), (0, 400, 90)))
    # along x: 300 and 400 mm; the body of each joint begins at its axis
    np.testing.assert_allclose(
        robot.model.poses(np.zeros((1, 2)))[0, :3, 3], [0.7, 0, 0.2], atol=1e-15
    )
    lengths = np.array([np.hypot(0.2, 0.3), 0.4])
    np.testing.assert_allclose(robot.masses, 15 * lengths, rtol=1e-12)
    np.testing.assert_allclose(robot.centers, [[0.15, 0, 0.1], [0.2, 0, 0]], atol=1e-15)
    thin = robot.masses * (lengths**2 / 12 + 0.05**2 / 4)
    np.testing.assert_allclose(robot.inertias, np.repeat(thin[:, None], 3, 1), rtol=1e-12)
    assert robot.title == "plain"
    assert robot.notes == (
        "no mass is given for what joint 1, joint 2 moves: a rod to the next joint of 15 kg/m is "
        "assumed",
        "joints 1, 2 without a speed: 180 deg/s, or 1 m/s where it slides, is assumed",
        "joints 1, 2 without a repeatability: 14.5 urad, or 5 um, is assumed",
    )


def test_a_repeatability_that_no_joint_states_has_its_source_called_assumed(tmp_path):
    """Reports quote the source: what the program took is not the robot's description."""
    bare = load_robot(robot_file(tmp_path, (0, 400, 90)))
    assert bare.sources["repeatability"].startswith("assumed: 14.5 urad")
    stated = load_robot(robot_file(tmp_path, (0, 400, 90), more="repeatability_urad = 30\n"))
    assert "repeatability" not in stated.sources


def test_what_needs_masses_asks_for_them(tmp_path):
    file = robot_file(tmp_path, *[(100, 200, 90)] * 6)
    scenario = load_scenario("quick")
    with pytest.raises(InputError, match=r"motion is true, and of plain no mass is given for what"):
        robot_of(changed(scenario, {"robot": str(file), "truth.preset": "moving"}), "a.toml")


def test_half_a_body_is_none(tmp_path):
    with pytest.raises(
        InputError, match="mass_kg stands without center_mm and inertia_kg_m2; give"
    ):
        load_robot(robot_file(tmp_path, (0, 100, 0), more="mass_kg = 2\n"))


def test_the_schema_asks_for_nothing_else():
    wanted = {key for key, field in RobotFile.model_fields.items() if field.is_required()}
    assert wanted == {"format", "name", "joints"}
