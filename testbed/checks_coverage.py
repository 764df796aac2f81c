"""What [coverage] asks of its robot: an arm that every kind of true robot in the list can have."""

from typing import TYPE_CHECKING

from testbed.checks_truth import truth_faults
from testbed.mistakes import Fault
from testbed.settings_coverage import coverage_truth

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot
    from testbed.settings import Scenario

SAGGING = ("wen2022", "soft", "unmodelled")
"""Kinds of robots whose joints sag by the closed form of an upright arm."""


def coverage_faults(scenario: "Scenario", robot: "Robot") -> list[Fault]:
    """Faults of a list of truths that this robot cannot have; none if the study is off."""
    from calib.identification.extended import gravity_is_closed

    coverage = scenario.coverage
    if not coverage.robots:
        return []
    faults = []
    closed = gravity_is_closed(robot.model.chain)
    for truth in coverage.truths:
        if truth in SAGGING and not closed:
            faults.append(
                Fault(
                    ("coverage", "truths"),
                    f'[coverage] truths has "{truth}", whose joints sag as those of an upright arm '
                    f"do; {robot.name} is none",
                    allowed="an arm with level parallel axes 2 and 3 that stands upright at zero",
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
        elif truth == "unmodelled" and robot.model.chain.n_joints < 5:
            faults.append(
                Fault(
                    ("coverage", "truths"),
                    f'[coverage] truths has "unmodelled", which has play in joint 5; {robot.name} '
                    f"has {robot.model.chain.n_joints} joints",
                    fix='remove "unmodelled"',
                    value=truth,
                )
            )
        elif other := truth_faults(coverage_truth(scenario, truth), robot):
            said = other[0].message.removeprefix("[truth] ")
            faults.append(
                Fault(
                    ("coverage", "truths"),
                    f'[coverage] truths has "{truth}": {said}',
                    allowed=other[0].allowed,
                    fix=f'remove "{truth}"',
                    value=truth,
                )
            )
    return faults
