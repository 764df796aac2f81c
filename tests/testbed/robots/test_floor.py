"""Where an arm's base does not stand upright: no floor across its way, a tracker on its level."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.frames import inverse, transform
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot
from testbed.robots.robot import Robot, workspace_of_reach
from testbed.robots.room import BESIDE, from_arm, reach
from tests.testbed.robots.described_cases import ARMS, block, urdf

PART = (
    '<visual><geometry><mesh filename="block.stl"/></geometry></visual>'
    '<collision><geometry><mesh filename="block.stl"/></geometry></collision>'
)
ON_A_RAIL = urdf(
    "railed",
    [
        ("rail", "prismatic", "0 0 0.2", "0 0 0", "0 1 0", (-1, 1)),
        ("pan", "revolute", "0 0 0.3", "0 0 0", "0 0 1", (-2.9, 2.9)),
        ("lift", "revolute", "0 0 0.2", "0 0 0", "0 1 0", (-1.5, 1.5)),
        ("elbow", "revolute", "0 0 0.4", "0 0 0", "0 1 0", (-2, 2)),
        ("tip", "fixed", "0 0 0.4", "0 0 0", "1 0 0", None),
    ],
    parts=dict.fromkeys(("rail", "pan", "lift", "elbow"), PART),
).replace('<link name="base_link"/>', f'<link name="base_link">{PART}</link>')


@pytest.fixture
def railed(tmp_path) -> Robot:
    """An arm on a rail along y of the room, with bodies of 80 mm, its base's drawing too."""
    (tmp_path / "block.stl").write_bytes(block((0.08, 0.08, 0.08), (-0.04, -0.04, 0.0)))
    (tmp_path / "arm.urdf").write_text(ON_A_RAIL)
    return load_robot(tmp_path / "arm.urdf")


def test_no_floor_stands_across_a_rail(railed):
    """The base's z lies along the rail: a plane across it where the base ends cuts it in two."""
    assert railed.shapeless == ()
    q = np.zeros((5, 4))
    q[:, 0] = np.linspace(*railed.limits[0], 5)
    assert not Simulator(railed, railed.model.chain).contacts(q).floor.any()


def on_a_wall():
    """An upright arm's chain, turned so that its base's z is the room's x, 1.5 m above it."""
    robot = load_robot("staubli_tx60")
    wall = transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.0, 0.0, 1.5]))
    chain = replace(robot.model.chain, T_world_base=wall)
    return replace(robot, model=replace(robot.model, chain=chain), workspace=None)


def in_the_room(robot, place_mm):
    """A place of the base frame in the room [m]."""
    return (robot.model.chain.T_world_base @ [*np.array(place_mm) / 1e3, 1.0])[:3]


def test_a_tracker_is_proposed_on_the_level_of_an_arm_on_a_rail_or_a_wall(railed):
    for robot in (railed, on_a_wall()):
        place = workspace_of_reach(robot)
        station, center = (in_the_room(robot, at) for at in (place.station_mm, place.box_center_mm))
        assert station[2] == pytest.approx(center[2], abs=0.02)  # both rounded to 10 mm
        chain = robot.model.chain
        beam = (inverse(chain.T_world_base) @ [*station, 1.0])[:3]
        assert from_arm(chain, robot.limits, beam) >= reach(chain, robot.limits) + BESIDE
    # before the wall, not behind it
    assert station[0] > 1.0


def test_a_tracker_of_an_arm_that_hangs_stands_on_the_level_of_its_box_too():
    robot = on_a_wall()
    down = transform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))
    chain = replace(robot.model.chain, T_world_base=down)
    hung = replace(robot, model=replace(robot.model, chain=chain))
    place = workspace_of_reach(hung)
    station, center = (in_the_room(hung, at) for at in (place.station_mm, place.box_center_mm))
    assert station[2] == pytest.approx(center[2], abs=0.02)
    assert np.linalg.norm((station - center)[:2]) > 1.9  # 2 m, and roundings


def test_a_gantry_has_no_floor_where_its_beam_begins(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARMS["gantry"])
    robot = load_robot(tmp_path / "arm.urdf")
    at_zero = robot.model.poses(np.zeros((1, 6)))[0, :3, 3]
    assert Simulator(robot, robot.model.chain).above_floor(at_zero) > 1.0
