"""The joints of each row: commanded, read back, units stated and judged against the limits."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from testbed.files.columns import UNITS
from testbed.files.extras import Extras, extras_of
from testbed.files.refusal import refusal
from testbed.files.session import rows_of
from testbed.files.table import Columns, DataTable, together, valid_rows
from testbed.robots.robot import Robot

BEYOND = 0.05
"""Part of the joint values outside the limits above which the unit is wrong."""
OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m"}
Source = Literal["commanded", "read-back"]


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Joint vectors in the order of the file, good rows only."""

    where: str
    place: tuple[str, ...]
    row: Index
    """(k,) row of the table."""
    q: Array
    """(k, n) [rad, m]."""
    read_back: Array | None
    """(k, n) the other source, where both are there [rad, m]."""
    source: Source
    extras: Extras
    columns: Columns
    """Where `q` stands in the file."""
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, index: Index) -> "Joints":
        """The same for some rows (indices)."""
        some = rows_of(self, index, ("place", "row", "q", "read_back"))
        return replace(some, extras=self.extras.rows(index))


def read_joints(table: DataTable, robot: Robot, source: Source | None, *, drop: bool) -> Joints:
    """Joint vectors of a table.

    Raises
    ------
    InputError
        M35: a joint has no column, or both sources are there and none is chosen; M20: more than 5 %
        of the values lie outside the limits.
    """
    commanded = joint_columns(table, robot, "")
    read = joint_columns(table, robot, "_read")
    if commanded and read and source is None:
        message = f"has commanded ({commanded.names[0]}) and read-back ({read.names[0]}) joints"
        fix = 'write source = "commanded" (or "read-back") under [joints] in session.toml'
        raise refusal(table.where, "joints.source", message, fix=fix)
    if source is None:
        source = "read-back" if read and not commanded else "commanded"
    chosen, other = (read, commanded) if source == "read-back" else (commanded, read)
    if not chosen:
        raise _missing(table, robot, "_read" if source == "read-back" else "")
    good, warnings = valid_rows(table, chosen.names, drop=drop)
    q = table.values(chosen)
    _check_limits(table, robot, chosen.names, q, good)
    read_back = None
    if other:
        fine, more = valid_rows(table, other.names, drop=drop)
        good, warnings = good & fine, warnings + more
        read_back = table.values(other)
    extras = extras_of(table)
    whole = Joints(
        where=table.where,
        place=table.places,
        row=np.arange(len(table)),
        q=q,
        read_back=read_back,
        source=source,
        extras=extras,
        columns=chosen,
        warnings=(*warnings, *extras.warnings),
    )
    return whole.rows(np.flatnonzero(good))


def joint_columns(table: DataTable, robot: Robot, tail: str = "") -> Columns | None:
    """Columns of all joints of one source; None if there is none of them."""
    found = [table.find(kind, f"{stem}{tail}") for stem, kind in _stems(robot)]
    there = [columns for columns in found if columns]
    if not there:
        return None
    if len(there) < len(found):
        raise _missing(table, robot, tail)
    return together(there)


def _stems(robot: Robot) -> list[tuple[str, str]]:
    """Column and kind of unit of each joint: ``q1`` is an angle, or a length."""
    kinds = robot.model.chain.kinds
    return [
        (f"q{j + 1}", "length" if kind == "prismatic" else "angle") for j, kind in enumerate(kinds)
    ]


def _missing(table: DataTable, robot: Robot, tail: str) -> InputError:
    """The error where joints have no column."""
    missing = [
        f"{stem}{tail}_{'mm' if kind == 'length' else 'deg'}"
        for stem, kind in _stems(robot)
        if not table.find(kind, f"{stem}{tail}")
    ]
    return refusal(
        table.where, "joints",
        f"has no column for {len(missing)} of the {robot.model.chain.n_joints} joints of "
        f"{robot.name}",
        value=", ".join(table.names)[:200],
        allowed=f"needed: {', '.join(missing)}; {table.found(120)}",
        fix="name the columns so, with the unit, or map them with --config session.toml",
    )  # fmt: skip


def _check_limits(
    table: DataTable, robot: Robot, names: tuple[str, ...], q: Array, good: Bool
) -> None:
    """Refuse radians that are degrees: too many values outside the limits."""
    lower, upper = robot.limits.T
    outside = ((q < lower - 1e-6) | (q > upper + 1e-6)) & good[:, None]
    if outside.sum() <= BEYOND * max(good.sum(), 1) * q.shape[1]:
        return
    row, j = (int(i) for i in np.argwhere(outside)[0])
    unit = names[j].rpartition("_")[2]
    factor = UNITS[_stems(robot)[j][1]][unit]
    other = OTHER_UNIT.get(unit, "another unit")
    share = 100 * outside.sum() / (good.sum() * q.shape[1])
    raise refusal(
        table.place(row), names[j],
        f"{share:.0f} % of the joint values lie outside the limits of {robot.name}, the first is "
        f'{table.names[names[j]]} = "{table.texts(names[j])[row][:20]}"',
        code="M20",
        value=float(q[row, j]),
        allowed=f"its limits are {lower[j] / factor:.4g} to {upper[j] / factor:.4g} {unit}",
        fix=f"if these are {other}, name the columns q1_{other} ...; else check the robot",
    )  # fmt: skip
