"""Which numbers of a robot the estimators of a scenario may move, before reduction."""

from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import Mode
from calib.identification.joint_models import with_joint_terms
from testbed.robots.catalog import Robot
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import PAPER_SET


def free_parameters(scenario: Scenario, robot: Robot, mode: Mode) -> Parameters:
    """Parameters that the estimator `mode` may move.

    The paper's estimator always identifies the robot's set ``wen2022`` with base and tool fixed.
    """
    table = parameters_of(robot.model)
    if mode == "paper":
        return table.freeing(robot.free_sets[PAPER_SET])
    wanted = scenario.identification.free
    if isinstance(wanted, str):
        names = table.names if wanted == "identifiable" else robot.free_sets[wanted]
    else:
        names = wanted
    fixed = tuple(
        f"{frame}."
        for frame, state in (
            ("base", scenario.identification.base),
            ("tool", scenario.identification.tool),
        )
        if state == "fixed"
    )
    return table.freeing(name for name in names if not name.startswith(fixed or ("\0",)))


def default_parameters(scenario: Scenario, robot: Robot) -> Parameters:
    """Every number that the default estimator may move, joint terms included where it may climb."""
    free = free_parameters(scenario, robot, "whitened")
    if scenario.identification.model == "geometric":
        return free
    return with_joint_terms(robot.model, free)[1]
