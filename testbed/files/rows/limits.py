"""Joints that a table has outside the limits, of the arm or of its controller."""

import numpy as np

from calib.arrays import Array, Bool
from testbed.bounds import FACTORS
from testbed.files.columns import UNITS, unit_of
from testbed.files.refusal import refusal
from testbed.files.rows.counts import added
from testbed.files.table import Columns, DataTable
from testbed.robots.controller import BEYOND
from testbed.robots.robot import Robot
from testbed.units import DEG, MM, counted
from testbed.units import unit_of as unit_of_kind

MANY = 0.05
"""Part of the joint values outside the limits above which the unit is wrong."""
COUNTED, WHOLE = 3600, 1e-6
"""Whole numbers above this are counts; what is left of one by the change of its unit."""
LARGER = ("rad", "m")
"""Units whose numbers may be those of the other one."""
OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m"}


def check_limits(
    table: DataTable, robot: Robot, columns: Columns, q: Array, good: Bool
) -> list[str]:
    """A warning of joint values outside the limits; too many are refused.

    Parameters
    ----------
    table : DataTable
        Where they stand.
    robot : Robot
        Limits of its joints, and of those that its controller counts.
    columns : Columns
        Of the joints that the controller counts.
    q : (m, n) array
        Joints of the arm [rad, m].
    good : (m,) array of bool
        Rows whose numbers are there.

    Raises
    ------
    InputError
        M20: more than 5 % of the values lie outside the limits.
    """
    lower, upper = robot.limits.T
    by_arm = ((q < lower - BEYOND) | (q > upper + BEYOND)) & good[:, None]
    outside = by_arm | (robot.controller.beyond(q) & good[:, None])
    if not outside.any():
        return []
    row, j = (int(i) for i in np.argwhere(outside)[0])
    counted_joints = robot.controller.counted(q.shape[1]).tolist()
    # of a joint without a column the last one that moves it
    place = counted_joints.index(j) if j in counted_joints else len(counted_joints) - 1
    name, names = columns.names[place], columns.names
    unit = unit_of(name)
    first = f'{table.names[name]} = "{table.texts(name)[row][:20]}"'
    allowed = _allowed(robot, j, unit, float(q[row, j]), of_arm=bool(by_arm[row, j]))
    if outside.sum() <= MANY * max(int(good.sum()), 1) * q.shape[1]:
        values, lie = (
            counted(int(outside.sum()), "joint value"),
            "lies" if outside.sum() == 1 else "lie",
        )
        return [
            f"{table.where}: {values} {lie} outside the limits of {robot.name}, the first is in "
            f"line {table.sheet.lines[row]}: {first}; {allowed}"
        ]
    share = 100 * outside.sum() / (good.sum() * q.shape[1])
    other = OTHER_UNIT.get(unit, "another unit")
    # a number beyond the limits in degrees is farther beyond them in radians, meters in mm alike
    fix = "correct these cells, or check the robot"
    if unit in LARGER:
        far = outside[:, counted_joints].mean(axis=0) > MANY
        wrong = [names[k] for k in np.flatnonzero(far)] or [name]
        stem = wrong[0].rpartition("_")[0] if len(wrong) < len(names) // 2 + 1 else "q1"
        what = "these" if stem == "q1" else ", ".join(name.rpartition("_")[0] for name in wrong)
        fix = f"if {what} are {other}, name the columns {stem}_{other} ...; else check the robot"
    elif not robot.controller.plain:
        fix = "correct these cells, or check the robot and its [controller]"
    numbers = table.values(columns) / FACTORS[unit]
    if (np.abs(numbers - np.round(numbers)) < WHOLE).all() and np.abs(numbers).max() > COUNTED:
        fix = (
            "whole numbers of that size are counts of encoders, and only the controller knows how "
            f"many make a turn: export the joints in {'mm' if unit in ('m', 'mm') else 'degrees'}"
        )
    if other_way := _other_way(robot, q, good):
        lines = added(robot.controller, *(f"q{k} = -J{k}" for k in other_way))
        which = " and ".join(f"q{k}" for k in other_way)
        verb = "is" if len(other_way) == 1 else "are"
        fix = f"if {which} {verb} counted the other way, {lines}; else check the robot"
    raise refusal(
        table.place(row), name,
        f"{share:.0f} % of the joint values lie outside the limits of {robot.name}, the first is "
        f"{first}", code="M20", value=float(table.values(columns)[row, place]), allowed=allowed,
        fix=fix,
    )  # fmt: skip


def _other_way(robot: Robot, q: Array, good: Bool) -> list[int]:
    """Numbers of the joints that hardly pass their limits with the other sign, and now often do.

    None where other joints pass theirs as often, or the controller counts otherwise already.
    """
    if not robot.controller.plain:
        return []
    lower, upper = robot.limits.T
    low, high = lower - BEYOND, upper + BEYOND
    far, turned = (((low > J) | (high < J))[good].mean(axis=0) > MANY for J in (q, -q))
    return [] if (far & turned).any() else [int(j) + 1 for j in np.flatnonzero(far)]


def _allowed(robot: Robot, j: int, unit: str, value: float, *, of_arm: bool) -> str:
    """The limits that a joint's value [rad, m] passes, in the unit of its column."""
    slides = bool(robot.model.chain.prismatic[j])
    factor = UNITS["length" if slides else "angle"].get(unit)
    if factor is None:  # of a held joint of the other kind
        unit, factor = unit_of_kind(slides), 1 / (MM if slides else DEG)
    low, high = (robot.limits if of_arm else robot.controller.limits)[j] / factor
    if robot.controller.plain:
        return f"its limits are {low:.4g} to {high:.4g} {unit}"
    moves = "moves" if slides else "turns"
    whose = f"q{j + 1}, as the arm {moves}," if of_arm else f"J{j + 1} of the controller"
    is_at = f" is {value / factor:.4g} {unit} there, and its" if of_arm else "'s"
    return f"{whose}{is_at} limits are {low:.4g} to {high:.4g} {unit}"
