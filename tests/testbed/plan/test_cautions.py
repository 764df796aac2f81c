"""What a plan did not test is in its mark, its warnings, its numbers and its programs."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import slide, transform
from testbed.laboratory.cell import Obstacle
from testbed.plan.cautions import mark, untested
from testbed.plan.folder import programs
from testbed.plan.plan import plan
from testbed.plan.results import plan_numbers
from testbed.plan.words import clearance_words, terminal_text
from testbed.robots.catalog import load_robot
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from tests.planned import quick_plan
from tests.testbed.robots.described_cases import ARMS

PLACE = {False: [0.0, 0.0, 0.0], True: [-2e3, 0.0, 0.0]}
SOLID = "<collision><geometry><{}/></geometry></collision></link>"
CONE, BALL = SOLID.format("cone"), SOLID.format('sphere radius="0.05"')


@pytest.mark.parametrize(
    ("shape", "sight"), [("</link>", False), (CONE, True)], ids=["none", "no known one"]
)
def test_an_arm_without_shapes_is_not_called_free_of_collisions(tmp_path, shape, sight):
    (tmp_path / "arm.urdf").write_text(ARMS["scara"].replace("</link>", shape))
    small = {
        "robot": str(tmp_path / "arm.urdf"), "plan.poses": 8, "plan.held_out": 0,
        "plan.goal.poses": 5, "pool.size": 30, "identification.estimators": ["whitened"],
        # where the arm stands: nothing could be free; or where it hides no target
        "cell.obstacle": [{"kind": "box", "size_mm": [3e3] * 3, "position_mm": PLACE[sight]}],
        "pool.line_of_sight": sight,
    }  # fmt: skip
    made, robot = plan(changed(load_scenario("quick"), small)), load_robot(tmp_path / "arm.urdf")
    assert made.shapeless == robot.shapeless == tuple(range(1, 5))
    assert "what it would hit is not tested" in " ".join(robot.notes)
    assert mark(made).startswith("! Every pose keeps to the joint limits; but whether the robot ")
    said = f"{mark(made)} {terminal_text(made)}"
    # an arm of four joints has no program to run
    for false in ("is free", "line of sight", "clearance", "mm or more from floor", "the program"):
        assert false not in said
    assert "whether the robot hits anything or hides the target was not tested" in said
    numbers = plan_numbers(made, robot)
    assert np.isnan(numbers["clearance_mm"]["smallest"])  # null in the file
    assert "add shapes" in numbers["untested"][0]


def test_an_arm_of_plain_shapes_is_tested_like_one_of_meshes(tmp_path):
    """No caution is left, its moves are free of a wall, and a link between its shapes is named."""
    (tmp_path / "arm.urdf").write_text(ARMS["scara"].replace("</link>", BALL))
    small = {
        "robot": str(tmp_path / "arm.urdf"), "plan.poses": 8, "plan.held_out": 0,
        "plan.goal.poses": 5, "pool.size": 30, "identification.estimators": ["whitened"],
        "cell.obstacle": [
            {"kind": "box", "size_mm": [1e2, 2e3, 2e3], "position_mm": [-6e2, 0.0, 0.0]}
        ],
    }  # fmt: skip
    made = plan(changed(load_scenario("quick"), small))
    assert made.shapeless == made.unread == ()
    assert all("acceptance_deg" in said for said in untested(made))  # of the scene alone
    assert mark(made).startswith("! Every pose is free of collisions")
    assert made.tour.clearance >= 0.01
    partly = replace(made, unread=(2,))
    said, _ = untested(partly)
    assert said.startswith("Warning: whether link 2 hits anything was tested in part only")
    assert "but whether link 2 hits anything was tested in part only and" in mark(partly)


@pytest.mark.parametrize(
    ("bare", "words"),
    [
        ((3,), "whether link 3 hits anything or hides the target was not tested, since the robot's "
               "file gives it a shape"),
        ((2, 5), "whether link 2 and link 5 hit anything or hide the target was not tested"),
        ((2, 3, 5), "whether link 2, link 3 and link 5 hit anything or hide the target was not "
                    "tested"),
    ],
)  # fmt: skip
def test_links_without_a_shape_are_named(bare, words):
    made = replace(quick_plan(), shapeless=bare)
    assert mark(made).startswith("! Every pose is free of collisions, ")
    assert words.partition(", since")[0] in mark(made)
    (said,) = untested(made)
    assert words.partition(" gives")[0] in said
    assert clearance_words(made)
    assert quick_plan().shapeless == untested(quick_plan()) == ()


def test_a_program_of_moves_that_were_not_tested_says_so():
    made = replace(quick_plan(), shapeless=tuple(range(1, 7)))
    for name, text in programs(made).items():
        assert "No move was checked for collisions" in text, name
    assert "No move was checked" not in "".join(programs(quick_plan()).values())


def test_an_arm_on_a_wall_is_not_said_to_clear_the_floor_of_the_room():
    """Its file's floor is the wall; a floor that the scenario states is tested."""
    made = quick_plan()
    model = made.nominal
    wall = transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.0, 0.0, 1.5]))
    chain = replace(model.chain, T_world_base=wall)
    hung = replace(made, nominal=replace(model, chain=chain))
    (said,) = untested(hung)
    assert "whether the robot hits the floor of the room was not tested" in said
    floor = Obstacle("obstacle 1", slide(0.5, 0.0, -0.05), np.array([4.0, 4.0, 0.1]))
    beside = Obstacle("obstacle 1", slide(3.0, 0.0, -0.05), np.array([4.0, 4.0, 0.1]))
    assert untested(replace(hung, obstacles=(floor,))) == ()
    assert untested(replace(hung, mounted=True)) == ()
    assert untested(replace(hung, obstacles=(beside,))) == untested(hung)
