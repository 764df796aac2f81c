"""What a scenario asks of its robot: parameters and sets that it must have."""

from typing import TYPE_CHECKING

from testbed.checks_coverage import coverage_faults
from testbed.checks_identification import prior_faults
from testbed.checks_pool import pool_faults
from testbed.checks_truth import truth_faults
from testbed.mistakes import Fault, did_you_mean, one_error
from testbed.settings import Scenario
from testbed.settings_robot import PAPER_SET as PAPER_SET

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot


def check_robot(scenario: Scenario, robot: "Robot", *, where: str) -> None:
    """Raise one InputError if the scenario names parameters or sets the robot does not have."""
    names = robot.model.names
    faults = []
    for table, key, value, word in (
        ("truth", "perturb", scenario.truth.perturb, "links"),
        ("identification", "free", scenario.identification.free, "identifiable"),
    ):
        known = tuple(dict.fromkeys((word, *robot.free_sets))) if isinstance(value, str) else names
        for name in [value] if isinstance(value, str) else value:
            if name not in known:
                fault = Fault(
                    (table, key),
                    f'[{table}] {key} has "{name}", which {robot.name} does not know',
                    allowed=f"known are {', '.join(known)}" if isinstance(value, str) else "",
                    fix=did_you_mean(name, known) or f"see `truebed robots {robot.name}`",
                    value=name,
                )
                faults.append(fault)
    if "paper" in scenario.identification.estimators and PAPER_SET not in robot.free_sets:
        fault = Fault(
            ("identification", "estimators"),
            f'[identification] estimators has "paper", but {robot.name} has no free set '
            f'"{PAPER_SET}"',
            fix='write estimators = ["whitened"]',
            value="paper",
        )
        faults.append(fault)
    faults += pool_faults(scenario.pool, robot)
    faults += truth_faults(scenario.truth, robot)
    faults += coverage_faults(scenario, robot)
    faults = faults or free_faults(scenario, robot) or prior_faults(scenario, robot)
    if faults:
        raise one_error(faults, where)


def free_faults(scenario: Scenario, robot: "Robot") -> list[Fault]:
    """Faults of what [identification] frees: a frame both free and fixed, or nothing at all."""
    settings = scenario.identification
    wanted = settings.free
    listed = wanted if isinstance(wanted, tuple) else robot.free_sets.get(wanted, robot.model.names)
    states = {"base": settings.base, "tool": settings.tool}
    held = [name for name in listed if states.get(name.split(".")[0]) == "fixed"]
    if held and isinstance(wanted, tuple):
        frame = held[0].split(".")[0]
        return [
            Fault(
                ("identification", "free"),
                f'[identification] free has "{held[0]}", and {frame} is "fixed"',
                fix=f'remove it, or write {frame} = "free"',
                value=held[0],
            )
        ]
    if len(held) == len(listed):
        return [
            Fault(
                ("identification", "free"),
                "[identification] frees nothing",
                fix='name at least one parameter, or write free = "identifiable"',
                value=wanted,
            )
        ]
    return []
