"""The joints of each row: commanded, read back, units stated and judged against the limits."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from testbed.files.columns import ANGLES, LENGTHS, find
from testbed.files.readings import Extras, extras_of
from testbed.files.table import Table, refuse_bad
from testbed.robots.robot import Robot

BEYOND = 0.05
"""Part of the joint values outside the limits above which the unit is wrong."""


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
    source: Literal["commanded", "read-back"]
    extras: Extras
    columns: tuple[str, ...]
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, index: Index) -> "Joints":
        """The same for some rows (indices)."""
        return replace(
            self,
            place=tuple(self.place[k] for k in index),
            row=self.row[index],
            q=self.q[index],
            read_back=None if self.read_back is None else self.read_back[index],
            extras=self.extras.rows(index),
        )


def read_joints(
    table: Table, robot: Robot, source: Literal["commanded", "read-back"] | None, *, drop: bool
) -> Joints:
    """Joint vectors of a table.

    Raises
    ------
    InputError
        M35: a joint has no column, or both sources are there and none is chosen; M20: more than 5 %
        of the values lie outside the limits.
    """
    commanded = _columns(table, robot, "")
    read = _columns(table, robot, "_read")
    if commanded and read and source is None:
        raise InputError(
            f"has commanded ({commanded[0][0]}) and read-back ({read[0][0]}) joints",
            code="M35",
            where=table.where,
            field="joints.source",
            fix='write source = "commanded" (or "read-back") under [joints] in session.toml',
        )
    chosen, other = (read, commanded) if source == "read-back" else (commanded, read)
    if source is None and read and not commanded:
        chosen, other, source = read, None, "read-back"
    if not chosen:
        _refuse_missing(table, robot, source == "read-back")
    names, factors = chosen or ([], [])
    good, warnings = refuse_bad(table, names, drop=drop)
    q = table.numbers(names) * factors
    _check_limits(table, robot, names, q, good)
    read_back = None
    if other:
        fine, told = refuse_bad(table, other[0], drop=drop)
        good, warnings = good & fine, warnings + told
        read_back = table.numbers(other[0]) * other[1]
    extras = extras_of(table)
    rows = np.arange(len(table))
    whole = Joints(
        table.where,
        tuple(table.place(row) for row in range(len(table))),
        rows,
        q,
        read_back,
        source or "commanded",
        extras,
        (*names, *(other[0] if other else ())),
        (*warnings, *extras.warnings),
    )
    return whole.rows(np.flatnonzero(good))


def _columns(table: Table, robot: Robot, read: str) -> tuple[list[str], list[float]] | None:
    """Columns and factors of all joints of one source; None if there is none of them."""
    chain = robot.model.chain
    found = [
        find(
            table.names,
            f"q{j + 1}{read}",
            "length" if kind == "prismatic" else "angle",
            table.where,
        )
        for j, kind in enumerate(chain.kinds)
    ]
    there = [at for at in found if at]
    if not there:
        return None
    if len(there) < len(found):
        _refuse_missing(table, robot, bool(read))
    return [name for name, _ in there], [factor for _, factor in there]


def _refuse_missing(table: Table, robot: Robot, read: bool) -> None:
    """A joint has no column."""
    chain, tail = robot.model.chain, "_read" if read else ""
    missing = [
        f"q{j + 1}{tail}_{'mm' if kind == 'prismatic' else 'deg'}"
        for j, kind in enumerate(chain.kinds)
        if not any(f"q{j + 1}{tail}_{unit}" in table
                   for unit in (LENGTHS if kind == "prismatic" else ANGLES))
    ]  # fmt: skip
    raise InputError(
        f"has no column for {len(missing)} of the {chain.n_joints} joints of {robot.name}",
        code="M35",
        where=table.where,
        field="joints",
        value=", ".join(table.names)[:200],
        allowed=f"needed: {', '.join(missing)}; found: {', '.join(table.names)[:120]}",
        fix="name the columns so, with the unit, or map them with --config session.toml",
    )


def _check_limits(table: Table, robot: Robot, names: list[str], q: Array, good: Bool) -> None:
    """Refuse radians that are degrees: too many values outside the limits."""
    lower, upper = robot.limits.T
    outside = ((q < lower - 1e-6) | (q > upper + 1e-6)) & good[:, None]
    if outside.sum() <= BEYOND * max(good.sum(), 1) * q.shape[1]:
        return
    row, j = (int(i) for i in np.argwhere(outside)[0])
    unit = names[j].rpartition("_")[2]
    slides = robot.model.chain.kinds[j] == "prismatic"
    factor = LENGTHS[unit] if slides else ANGLES[unit]
    other = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m"}.get(unit, "another unit")
    share = 100 * outside.sum() / (good.sum() * q.shape[1])
    raise InputError(
        f"{share:.0f} % of the joint values lie outside the limits of {robot.name}, the first is "
        f'{table.names[names[j]]} = "{table.texts(names[j])[row][:20]}"',
        code="M20",
        where=table.place(row),
        field=names[j],
        value=float(q[row, j]),
        allowed=f"its limits are {lower[j] / factor:.4g} to {upper[j] / factor:.4g} {unit}",
        fix=f"if these are {other}, name the columns q1_{other} ...; else check the robot",
    )
