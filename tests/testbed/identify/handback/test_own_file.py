"""The user's own file as a calibration hands it back: from which fit, in which frames, said how."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from calib.geometry.frames import turn_angle
from testbed.identify.handback import own_file
from testbed.identify.handback.own_file import deliver_own_file, own_file_name
from testbed.identify.handback.states import handed_robot, in_own_frames
from testbed.robots.catalog import load_robot
from testbed.robots.write.mjcf import frames_of, mjcf_poses
from testbed.robots.write.own.places import NotCorrectableError
from tests.calibrated import real, robot, sound
from tests.reference import pool_r
from tests.testbed.robots.robot_cases import yourdfpy_poses

FILE = robot().folder / "staubli_tx60.urdf"
PROVEN = 1e-9
"""What is promised of every file [m, 1]."""


@cache
def arm(tip="tool0"):
    return load_robot(FILE, tip=tip)


@pytest.fixture
def folder(tmp_path):
    for name in ("robot", "robot_geometric"):
        (tmp_path / name).mkdir()
    return tmp_path


def test_the_file_has_the_robot_that_corrected_programs_are_computed_for(folder):
    found, q = sound(), pool_r(30, seed=9)
    name, said = deliver_own_file(found, arm(), folder)
    assert name == "robot/staubli_tx60_corrected.urdf"
    T = yourdfpy_poses(folder / name, q)
    assert np.abs(T - in_own_frames(found).poses(q)).max() < PROVEN
    assert said[0].startswith(
        "robot/staubli_tx60_corrected.urdf is staubli_tx60.urdf with the origins of 5 joints "
        "corrected (by up to "
    )
    assert said[1] == (
        "in it the base is world and the tool is tool0 as your programs know them: it has the "
        "identified links, not the places of instrument and target"
    )
    # what base and tool stand for, found from nothing, is not in it
    old, new = FILE.read_text(), (folder / name).read_text()
    for joint in ("world_base", "joint_1", "link_6_flange", "flange_tool0"):
        start = old.index(f'<joint name="{joint}"')
        assert old[start : old.index("</joint>", start)] in new


def test_joint_terms_cannot_be_in_it_so_that_it_is_the_geometric_fit(folder):
    found, q = real(), pool_r(30, seed=9)
    assert found.choice.chosen == "extended"
    name, said = deliver_own_file(found, arm(), folder)
    assert said[0].endswith("; no URDF has joint terms, so that it is the geometric fit")
    assert name == "robot_geometric/staubli_tx60_corrected.urdf"
    T = yourdfpy_poses(folder / name, q)
    assert np.abs(T - in_own_frames(found, found.fits[0]).poses(q)).max() < PROVEN


def test_in_the_frames_of_the_robot_it_has_base_and_tool_where_they_were_found(folder):
    found, q = replace(sound(), own_frames=True), pool_r(30, seed=9)
    name, said = deliver_own_file(found, arm(), folder)
    T = yourdfpy_poses(folder / name, q)
    assert np.abs(T - handed_robot(found).model.poses(q)).max() < PROVEN
    assert said[1] == "in it world is the frame of the measurements, and tool0 the identified tool"
    _, said = deliver_own_file(found, arm("link_6"), folder)
    tool = handed_robot(found).model.chain.T_flange_tool
    shift, turn = 1e3 * np.linalg.norm(tool[:3, 3]), np.degrees(turn_angle(tool[:3, :3]))
    assert said[1].endswith(
        "; but link_6 moves with joint joint_6, whose axis stands in it, and so "
        f"lies {shift:.0f} mm and {turn:.0f} deg from where it was identified: a link that is "
        "fixed to it, stated as --tip, can lie there"
    )


def test_an_mjcf_comes_back_as_a_urdf_does(folder):
    """Proven by MuJoCo from the file as it lies there."""
    found, q = sound(), pool_r(30, seed=9)
    mjcf = load_robot(FILE.with_suffix(".xml"), tip="tool")
    name, said = deliver_own_file(found, mjcf, folder)
    assert name == "robot/staubli_tx60_corrected.xml"
    model = mujoco.MjModel.from_xml_string((folder / name).read_text(), assets(mjcf))
    T = mjcf_poses(model, [*range(6)], frames_of(model)["tool"], q)
    assert np.abs(T - in_own_frames(found).poses(q)).max() < PROVEN
    assert said[0].startswith(
        "robot/staubli_tx60_corrected.xml is staubli_tx60.xml with the places of 5 bodies corrected"
    )
    assert (
        "; robot/staubli_tx60_corrected.xml (MuJoCo) has the robot's poses to < 1e-12 m" in said[0]
    )
    assert said[1].startswith("in it the base is world and the tool is tool as your programs know")
    moving = load_robot(FILE.with_suffix(".xml"), tip="link6")
    _, said = deliver_own_file(replace(found, own_frames=True), moving, folder)
    assert said[1].endswith(": a site or body fixed to it, stated as --tip, can lie there")


def assets(robot):
    """Meshes of a robot by the paths that its MJCF has."""
    return {
        part.file.relative_to(robot.folder).as_posix(): part.file.read_bytes()
        for part in robot.visuals
    }


def test_a_file_that_cannot_be_taken_apart_is_named_and_others_have_no_copy(folder, monkeypatch):
    assert deliver_own_file(sound(), robot(), folder) == ("", ())

    def refuse(*_):
        raise NotCorrectableError("of this\nand that")

    monkeypatch.setattr(own_file, "corrected_urdf", refuse)
    name, (said,) = deliver_own_file(sound(), arm(), folder)
    told = "staubli_tx60.urdf is not handed back corrected, because of this\\x0aand that"
    assert (name, said) == ("", told)
    assert not list(folder.rglob("*.urdf"))


def test_a_calibration_that_frees_no_link_hands_no_copy_back(folder, monkeypatch):
    monkeypatch.setattr(own_file, "in_own_frames", lambda *_: arm().model)
    said = ("staubli_tx60.urdf stays as it is: no number that it has was identified anew",)
    assert deliver_own_file(sound(), arm(), folder) == ("", said)
    assert not list(folder.rglob("*.urdf"))


def test_its_name_is_one_that_a_folder_can_hold():
    assert own_file_name(Path("x/arm.v2.urdf")) == "arm.v2_corrected.urdf"
    assert own_file_name(Path("arm.XML")) == "arm_corrected.xml"
    assert len(own_file_name(Path("\u00e4" * 120 + ".urdf")).encode()) < 255
