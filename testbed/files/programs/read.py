"""The targets of a robot program in CSV: joints, or tool poses with the arm's configuration."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.correction_words import few_joints
from calib.errors import InputError
from calib.geometry.frames import transform
from calib.geometry.inverse import inverse_kinematics, spread
from testbed.files.conditions import target_conditions
from testbed.files.dialects.controllers.rapid import is_rapid
from testbed.files.joints import joint_columns, read_joints
from testbed.files.programs.columns import (
    joints_by_number,
    no_targets,
    require_no_places,
    turns_named,
)
from testbed.files.refusal import refusal
from testbed.files.rotations import checked_rotations, stated_in
from testbed.files.rows.targets import NAMES
from testbed.files.session import Stated
from testbed.files.table import Columns, DataTable, require_short, table_of, together
from testbed.files.text import read_sheet
from testbed.files.valid import valid_rows
from testbed.gates.kinds import require_no_program, require_table
from testbed.gates.text import FileText, read_text
from testbed.robots.catalog import Robot

ADDED = ("status", "before_mm", "left_mm", "left_deg", "conditions")
"""Columns that are added: outcome, errors before and after by the identified model, and whether the
target lies under the conditions of the measurements."""
ONE_MORE = (
    'write one of them with another number of digits, as "1,2340", or all with a decimal point'
)
"""Fix for a decimal comma that may be a thousands mark, which a program cannot state."""
OF_READINGS = {"repeat", "order", "time", "time_s", "split", "approach"}
"""Columns with a meaning for measured rows only; in a program they stay unchanged."""
AS_TABLE = "write its targets as a CSV, one per line, below a header q1_deg, q2_deg ..."
STARTS = 64
"""Number of postures over the joint ranges from which a target far from the last is searched."""

FEW, NEAR, SMALL = 3, 1e-2, 1e-2
"""Targets below which nothing is said of units; positions too near to the base for an arm [m],
and joints so near to zero that all targets are one home [rad]."""


def read_program(path: Path, robot: Robot) -> tuple[FileText, DataTable]:
    """The lines and the targets of a program file, with the columns of all targets checked.

    Raises
    ------
    InputError
        M20, M22-M25, M35: the program is not understood.
    """
    require_table(path, path.name)
    text = read_text(path, path.name)
    require_no_program(text.lines, path.name)
    if is_rapid(text):
        message, fix = "is a RAPID program; targets are corrected in tables only", AS_TABLE
        raise refusal(path.name, "program", message, code="S39", fix=fix)
    sheet = read_sheet(text)
    for name in ADDED:
        if name in sheet.head:
            message = f'already has a column "{name}", as corrected programs do'
            fix = "correct the original program, not a corrected one"
            raise refusal(path.name, name, message, fix=fix)
    # thousands marks would stand beside corrected numbers that have none
    table = table_of(sheet, joints_by_number(sheet, robot), grouped=False, in_doubt=ONE_MORE)
    names = {own: name for own, name in table.names.items() if own not in OF_READINGS}
    table = replace(table, names=names)
    if not len(table):
        raise refusal(path.name, "file", "has no targets", fix="write one target per line")
    for name in NAMES:
        require_short(table, name)
    target_conditions(table)
    if is_cartesian(table):
        poses_of(table)
    if _has_joints(table, robot):
        if not is_cartesian(table):
            require_no_places(table)
        read_joints(table, robot, "commanded", drop=None)
    elif not is_cartesian(table):
        raise no_targets(table, robot)
    return text, table


def _has_joints(table: DataTable, robot: Robot) -> bool:
    """Whether the targets are joints; a table with only some of the joints is refused."""
    try:
        return joint_columns(table, robot) is not None
    except InputError as error:
        if error.field != "joints":
            raise
        fix = "name the columns so, with the unit, in the first line of the program"
        raise refusal(
            table.where, error.field, error.message, allowed=error.allowed, fix=fix
        ) from None


def is_cartesian(table: DataTable) -> bool:
    """Whether the targets are poses of the tool; z alone may be anything."""
    return any(table.find("length", axis) is not None for axis in "xy")


def poses_of(table: DataTable) -> tuple[Columns, Stated, Array, Sequence[str]]:
    """Columns, stated rotations and poses (m, 4, 4) of Cartesian targets [m], and warnings."""
    place = table.find("length", "x", "y", "z")
    try:
        found = stated_in(table, None)
    except InputError as error:
        if error.field != "euler" or error.value is not None:
            raise
        fix = 'add a column euler, with for example "kuka" in each row'
        raise refusal(
            table.where, error.field, error.message, code=error.code, allowed=error.allowed, fix=fix
        ) from None
    if place is None or found is None:
        named = turns_named(table.sheet.head)
        what = f"rename {named}" if named else "add the columns"
        raise refusal(
            table.where, "frames", "has positions without rotations", code="M24",
            allowed="qw qx qy qz, r11 ... r33, rvx_deg ..., or rx_deg ry_deg rz_deg with euler",
            fix=f"a target needs its orientation: {what}",
        )  # fmt: skip
    stated, turned = found
    columns = together(place, turned)
    good, _ = valid_rows(table, columns, drop=None)
    R, odd = checked_rotations(stated, table, good)
    return columns, stated, transform(R, table.values(place)), odd


def in_other_units(table: DataTable, robot: Robot) -> tuple[str, ...]:
    """A sentence where all targets lie as if their unit were another than their columns say."""
    said = list[str]()
    # beside joints a column of z alone is no position, and not used
    place = table.find("length", "x", "y", "z") if is_cartesian(table) else None
    few = len(table) < FEW
    if place is not None and not few and np.abs(table.values(place)).max() < NEAR:
        said.append(
            "all positions lie within 10 mm of the base: if they are in meters, name the columns "
            "x_m, y_m, z_m"
        )
    if joint_columns(table, robot) and not few:
        q = read_joints(table, robot, "commanded", drop=None).q
        turns = np.abs(q[:, [kind == "revolute" for kind in robot.model.chain.kinds]])
        # angles in radians, which are called degrees: pi of these are 0.055 rad
        if turns.size and SMALL < turns.max() < np.radians(np.pi):
            said.append(
                "no joint turns by more than 3.1416 deg: if the joints are in radians, name the "
                "columns q1_rad ..."
            )
    return tuple(said)


def configurations(table: DataTable, robot: Robot, T: Array) -> tuple[Array, tuple[str, ...]]:
    """Joints (m, n) near which the controller reaches its targets [rad, m], and warnings.

    `T` (m, 4, 4) are poses of the tool in the world [m].
    """
    nominal = robot.model
    if joint_columns(table, robot):
        joints = read_joints(table, robot, "commanded", drop=None)
        return joints.q, joints.warnings
    seeds = np.empty((len(T), nominal.chain.n_joints))
    everywhere = spread(robot.limits, STARTS)
    before = robot.limits.mean(axis=1)
    reach = partial(inverse_kinematics, position_first=few_joints(nominal))
    for k in range(len(T)):
        near = reach(nominal, T[k : k + 1], before[None], robot.limits) if k else None
        if near is None or near.status != ("reached",):
            starts = np.concatenate([before[None], everywhere])[None]
            near = reach(nominal, T[k : k + 1], starts, robot.limits)
        seeds[k] = near.q[0]
        before = near.q[0] if near.reached[0] else before
    sentence = (
        "the program does not state the configuration of the arm: the first target is assumed to "
        "have the joints nearest to the middle of their ranges, each other one those nearest to "
        "the one before; add the columns q1_deg ... if the controller does otherwise"
    )
    return seeds, (sentence,)
