"""What the studies of many robots ask of theirs: an arm that can be of every kind listed."""

from typing import TYPE_CHECKING

from testbed.checks_truth import truth_faults
from testbed.mistakes import Fault
from testbed.settings_coverage import TruthName, coverage_truth
from testbed.settings_robot import PAPER_SET

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot
    from testbed.settings import Scenario

SAGGING = ("wen2022", "soft", "unmodelled")
"""Kinds of robots whose joints sag by the closed form of an upright arm."""


def coverage_faults(scenario: "Scenario", robot: "Robot") -> list[Fault]:
    """Faults of the lists of truths that this robot cannot have; none if the studies are off."""
    coverage, again, loop = scenario.coverage, scenario.reexamined, scenario.compensation
    faults = []
    if coverage.robots:
        faults += truths_faults(scenario, robot, "coverage", coverage.truths)
    if loop.robots:
        faults += truths_faults(scenario, robot, "compensation", loop.truths)
    if again.robots:
        faults += truths_faults(scenario, robot, "reexamined", again.truths)
        if PAPER_SET not in robot.free_sets:
            faults.append(
                Fault(
                    ("reexamined", "robots"),
                    f"[reexamined] robots is {again.robots}, but {robot.name} has no free set "
                    f'"{PAPER_SET}", the numbers that the paper identifies',
                    fix="write robots = 0",
                    value=again.robots,
                )
            )
    return faults


def truths_faults(
    scenario: "Scenario", robot: "Robot", table: str, truths: tuple[TruthName, ...]
) -> list[Fault]:
    """Faults of one table's list of truths that this robot cannot have."""
    from calib.identification.extended import gravity_quarters

    faults = []
    quarters = gravity_quarters(robot.model.chain)
    for truth in truths:
        upright = truth == "unmodelled"  # its play goes by the closed form of an upright arm
        if truth in SAGGING and (quarters is None or (upright and quarters != (0, 0))):
            stands = "stands upright" if upright else "stands upright or lies level"
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "{truth}", whose joints sag by a closed form that does '
                    f"not hold for {robot.name}",
                    allowed=f"an arm with level parallel axes 2 and 3 that {stands} at zero",
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
        elif truth == "unmodelled" and robot.model.chain.n_joints < 5:
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "unmodelled", which has play in joint 5; {robot.name} '
                    f"has {robot.model.chain.n_joints} joints",
                    fix='remove "unmodelled"',
                    value=truth,
                )
            )
        elif other := truth_faults(coverage_truth(scenario, truth), robot):
            said = other[0].message.removeprefix("[truth] ")
            faults.append(
                Fault(
                    (table, "truths"),
                    f'[{table}] truths has "{truth}": {said}',
                    allowed=other[0].allowed,
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
    return faults
