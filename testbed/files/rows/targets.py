"""What the targets of a program are called, under which conditions a model takes them."""

from collections.abc import Sequence

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions, approaches
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.table import DataTable
from testbed.robots.file_frames import hung_in_chain
from testbed.robots.robot import Robot

NAMES = ("pose_id", "target", "name")
"""Columns that name the targets of a program; the first one there does."""


def target_names(table: DataTable) -> tuple[str, ...]:
    """What a program calls its targets (m,), as it came; empty where it has no name for one."""
    return next((table.texts(name) for name in NAMES if name in table), ("",) * len(table))


def called(names: Sequence[str]) -> tuple[str, ...]:
    """How a sentence calls each target (m,): its number from 1, and its name if it has one.

    Examples
    --------
    >>> called(("pick", ""))
    ('1 "pick"', '2')
    """
    return tuple(f'{k} "{name}"' if name else str(k) for k, name in enumerate(names, start=1))


def of_targets(
    robot: Robot, identified: RobotModel, stated: Conditions, q: Array
) -> tuple[OperatingConditions, tuple[str, ...]]:
    """Conditions of targets at joints q (m, n), and sentences on what the model assumes of them.

    A program is its own order: each target is approached from the one before it.

    Parameters
    ----------
    robot : Robot
        The robot as its file describes it.
    identified : RobotModel
        What it is.
    stated : Conditions
        What the targets say.
    q : (m, n) array
        Joints about which the program takes them [rad, m].
    """
    terms = {term.wave: term for term in identified.joint_errors.terms}
    said = []
    if "approach" in terms:
        said.append(
            "the model includes backlash: each target is assumed to be approached from the one "
            "before it; the first one, whose side is unknown, is placed in the middle of the "
            "backlash, and its region includes both sides"
        )
    if "torque" in terms:
        said.append(
            "the model follows what the drives report, which is unknown at the targets: the "
            "average over the measurements is used, and the regions include how far it varied"
        )
    springs = identified.joint_errors.springs
    if springs is not None:
        # no weight is what was stated, or what stands for a load of which nothing is
        weight = float(springs.weight.payload[0])
        load = "what it carried in the measurements" + f", {weight:.3g} kg on average" * (
            weight > 0
        )
        if stated.payload is not None:
            load = f"a payload of {stated.words('payload')} {stated.center_words}".rstrip()
        said.append(f"the arm is bent by its own weight and {load}")
    if "lengths" in terms:
        mean = terms["lengths"].reference
        words = f"{mean:.4g} degC, the mean of the measurements: they state no temperature"
        if stated.temperature is not None:
            words = stated.words("temperature")
        said.append(f"the lengths of the arm at the targets are those at {words}")
    return (
        OperatingConditions(
            stated.payload,
            hung_in_chain(robot, stated.payload, stated.center),
            approaches(q) if "approach" in terms else None,
            None,
            stated.temperature,
        ),
        tuple(said),
    )
