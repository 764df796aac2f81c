"""A station is told where people can find it: in the root of the robot's own file."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import exp_so3, transform
from testbed.plan.folder import programs
from testbed.plan.plan import plan
from testbed.plan.words import headline_rows, reasons, terminal_text
from testbed.proposal.scene import scene_text
from testbed.robots.catalog import load_robot
from testbed.robots.file_frames import chain_words
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.units import DEG, MM
from tests.planned import BARE, ROBOT, quick_plan
from tests.testbed.files.test_program_frames import CLOCKWISE

ROOT = "the root link of clockwise.urdf"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A clockwise arm on a mount, and the scene that is proposed for it."""
    path = tmp_path_factory.mktemp("arm")
    (path / "clockwise.urdf").write_text(CLOCKWISE, encoding="utf-8")
    text = scene_text(load_robot(path / "clockwise.urdf"), "clockwise.urdf", "cell")
    (path / "cell.toml").write_text(text, encoding="utf-8")
    return path


def frame_in(text):
    """The frame (4, 4) of words about it [m]."""
    place, turn = (
        np.array([float(x) for x in numbers.split(", ")])
        for numbers in re.findall(r"\(([^()]*)\)(?= mm in| deg)", text)
    )
    return transform(exp_so3(turn / DEG), place / MM)


def test_the_base_of_the_chain_is_told_in_the_root_of_the_file(folder):
    robot = load_robot(folder / "clockwise.urdf")
    said = chain_words(robot)
    # six digits are written
    np.testing.assert_allclose(frame_in(said), robot.model.chain.T_world_base, atol=1e-5)
    assert f" mm in {ROOT}, turned by" in said
    assert f"# base frame: on the first joint axis, {said}\n" in (folder / "cell.toml").read_text()
    assert chain_words(ROBOT) == ""


def test_a_station_is_told_in_the_root_of_the_file(folder):
    changes = {key: value for key, value in BARE.items() if key.startswith(("pool.s", "plan"))}
    goal = {"plan.target_um": 0.0, "plan.poses": 14, "plan.goal.poses": 10}
    made = plan(changed(load_scenario(folder / "cell.toml"), changes | goal))
    row = next(row for row in headline_rows(made) if row[0] == "tracker station")
    base = load_robot(folder / "clockwise.urdf").model.chain.T_world_base
    place = base @ [*(np.array(made.scenario.tracker.station_mm) / MM), 1.0]
    told = re.fullmatch(rf"\((.*)\) mm in {ROOT}", row[2].replace("−", "-"))
    # written in whole millimeters
    np.testing.assert_allclose([float(x) for x in told[1].split(", ")], MM * place[:3], atol=0.51)
    assert any(f"first joint axis, {made.base[1]}" in one for one in reasons(made))
    assert f"first joint axis, {made.base[1]}" in " ".join(terminal_text(made).split())
    row = next(row for row in headline_rows(quick_plan()) if row[0] == "tracker station")
    assert row[2].endswith(" mm in the base frame")


def test_programs_name_the_robot_by_its_file():
    """A URDF was called by the folder in which it lies."""
    quick = quick_plan()
    for robot, name in (("cell/arm.urdf", "arm"), ("cell/mine/robot.toml", "mine")):
        scenario = quick.scenario.model_copy(update={"robot": robot})
        for text in programs(replace(quick, scenario=scenario)).values():
            assert f"robot {name}: " in text
            assert f"those of robot {name}, not of this controller" in text
