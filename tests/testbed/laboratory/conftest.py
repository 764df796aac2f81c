"""The robot that most of these tests stand before, and what simulates it alone."""

import pytest

from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot, load_robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot("staubli_tx60")


@pytest.fixture(scope="module")
def simulator(robot: Robot) -> Simulator:
    return Simulator(robot, robot.model.chain)
