"""The joints of each row, and what may stand beside them: pose, visit, split, approach and time."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.columns import NUMBERS, unit_of
from testbed.files.conditions import CENTERS, conditions_of
from testbed.files.refusal import refusal
from testbed.files.rows.beside import BesideJoints, beside_of, drive_columns
from testbed.files.rows.limits import check_limits
from testbed.files.rows.times import Moments, days_of, moments_of, times_of
from testbed.files.session import rows_of
from testbed.files.table import Columns, DataTable, together
from testbed.files.valid import valid_rows
from testbed.names import choice_of
from testbed.robots.robot import Robot
from testbed.units import either

SPLITS = ("identify", "test")
Source = Literal["commanded", "read-back"]


@dataclass(frozen=True, slots=True, eq=False)
class Extras:
    """What a file says of its rows besides joints and readings; None where it says nothing."""

    pose: tuple[str, ...] | None = None
    target: tuple[str, ...] | None = None
    repeat: Index | None = None
    split: tuple[str, ...] | None = None
    approach: tuple[str, ...] | None = None
    conditions: Conditions = field(default_factory=Conditions)
    time: Array | None = None
    moments: Moments | None = None
    """Of `time`, or of what tells no order."""
    days: tuple[str, ...] = ()
    """First and last ISO day of the rows, where their times are dates."""
    beside: BesideJoints = field(default_factory=BesideJoints)
    warnings: tuple[str, ...] = ()

    def rows(self, index: Index) -> "Extras":
        """The same for some rows (indices)."""
        some = rows_of(self, index, ("pose", "target", "repeat", "split", "approach", "time"))
        return replace(
            some,
            moments=self.moments.rows(index) if self.moments is not None else None,
            conditions=self.conditions.rows(index),
            beside=self.beside.rows(index),
        )


def extra_columns(table: DataTable) -> Columns:
    """The columns of a table that say when and how, in numbers."""
    own = Columns(tuple(name for name in NUMBERS if name in table))
    return together(own, table.find("length", *CENTERS), drive_columns(table))


def extras_of(table: DataTable, good: Bool) -> Extras:
    """The columns of a table that say when, how and what for, of rows (m,) whose numbers are good.

    Raises
    ------
    InputError
        M25, M35: a split that is neither identify nor test; a repeat that is no whole number; what
        `conditions_of` refuses.
    """
    split = table.texts_of("split")
    for row, word in enumerate(split or ()):
        if word not in SPLITS:
            fix = choice_of(word, SPLITS) if len(word) > 2 else ""
            raise refusal(
                table.place(row), "split", f'split is "{word[:20]}"', value=word[:20],
                allowed="it is identify or test", fix=fix,
            )  # fmt: skip
    moments, unread = moments_of(table, good)
    time, still = times_of(moments, good, table.where)
    return Extras(
        pose=table.texts_of("pose_id"),
        target=table.texts_of("target"),
        repeat=_repeats(table, good) if "repeat" in table else None,
        split=split,
        approach=table.texts_of("approach"),
        conditions=conditions_of(table, good),
        time=time,
        moments=moments,
        days=days_of(table, good),
        beside=beside_of(table, good),
        warnings=still or unread,
    )


def _repeats(table: DataTable, good: Bool) -> Index:
    """Which visit each row is."""
    values = np.where(good, table.numbers(["repeat"])[:, 0], 0.0)
    wrong = (values < 0) | (values != np.floor(values))
    if wrong.any():
        row = int(np.argmax(wrong))
        message = f'repeat is "{table.texts("repeat")[row][:20]}"'
        allowed = "it is a whole number, 0 for the first visit"
        raise refusal(table.place(row), "repeat", message, allowed=allowed, fix="correct it")
    return values.astype(np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Joint vectors of the arm in the order of the file, good rows only."""

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
    """Where the joints stand that the controller counts."""
    used: Columns
    """All columns of numbers that were read."""
    warnings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, index: Index) -> "Joints":
        """The same for some rows (indices)."""
        some = rows_of(self, index, ("place", "row", "q", "read_back"))
        return replace(some, extras=self.extras.rows(index))


def read_joints(
    table: DataTable,
    robot: Robot,
    source: Source | None,
    *,
    drop: bool | None,
    nests: Collection[str] = (),
) -> Joints:
    """Joint vectors of a table: those of the controller are there, those of the arm come back.

    Rows whose target is one of some nests on the floor have none, whatever stands there.

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
    used = together(chosen, other, extra_columns(table))
    targets = table.texts_of("target") or ("",) * len(table)
    at_nest = np.array([target in nests for target in targets], dtype=np.bool_)
    good, warnings = valid_rows(table, used, drop=drop, spare=at_nest)
    good = good & ~at_nest
    q = robot.controller.read(table.values(chosen), robot.model.chain.n_joints)
    warnings += check_limits(table, robot, chosen, q, good)
    extras = extras_of(table, good)
    whole = Joints(
        where=table.where,
        place=table.places,
        row=np.arange(len(table)),
        q=q,
        read_back=robot.controller.read(table.values(other), q.shape[1]) if other else None,
        source=source,
        extras=extras,
        columns=chosen,
        used=used,
        warnings=(*warnings, *extras.warnings),
    )
    return whole.rows(np.flatnonzero(good))


def joint_columns(table: DataTable, robot: Robot, tail: str = "") -> Columns | None:
    """Columns of all joints of one source that have one; None if there is none of them."""
    found = [table.find(kind, f"{stem}{tail}") for stem, kind in _stems(robot)]
    there = [columns for columns in found if columns]
    if not there:
        return None
    if len(there) < len(found):
        raise _missing(table, robot, tail)
    return together(*there)


def has_joints(table: DataTable, robot: Robot) -> bool:
    """Whether a table has a column of some joint of a robot."""
    names = [(kind, f"{stem}{tail}") for stem, kind in _stems(robot) for tail in ("", "_read")]
    return any(table.find(kind, name) for kind, name in names)


def _stems(robot: Robot) -> list[tuple[str, str]]:
    """Column and kind of unit of each joint of the controller: ``q1`` is an angle, or a length."""
    kinds = robot.model.chain.kinds
    return [
        (f"q{j + 1}", "length" if kinds[j] == "prismatic" else "angle")
        for j in robot.controller.counted(len(kinds))
    ]


def held_words(robot: Robot, missing: Collection[str], there: Collection[str]) -> str:
    """What to do where the joint or joints `missing` have no column, and others do.

    A controller that counts its joints without one that rods hold calls joint 5 of the arm its 4.
    """
    own = [stem for stem, _ in _stems(robot)]
    counted = [f"q{k + 1}" for k in range(len(own))]
    if robot.controller.held and set(there) == set(counted):
        pairs = [(stem, name) for stem, name in zip(own, counted, strict=True) if stem != name]
        words = ", ".join(f'{stem}_deg = "{name}_deg"' for stem, name in pairs)
        held = either([f"q{j + 1}" for j in robot.controller.held])
        return (
            f"; {held} of the arm is held by rods: if the controller counts its joints without it, "
            f"write columns = {{ {words} }}, with the names in the file"
        )
    if len(missing) > 1 or not there:
        return ""
    return (
        "; a joint that rods hold needs none where its robot.toml says so under [controller]: "
        'joints = ["q4 = -q2 - q3"]'
    )


def _missing(table: DataTable, robot: Robot, tail: str) -> InputError:
    """The error where joints have no column."""
    found = {stem: table.find(kind, f"{stem}{tail}") for stem, kind in _stems(robot)}
    said = {kind: found[stem] for stem, kind in _stems(robot) if found[stem]}
    missing = [
        f"{stem}{tail}_{_unit_beside(said.get(kind), kind)}"
        for stem, kind in _stems(robot)
        if not found[stem]
    ]
    held = (f"q{j + 1}" for j in robot.controller.held)
    there = [
        *(stem for stem in found if found[stem]),
        *(stem for stem in held if table.find("angle", f"{stem}{tail}")),
    ]
    return refusal(
        table.where, "joints",
        f"has no column for {len(missing)} of the {len(found)} joints of "
        f"{robot.name}",
        value=", ".join(table.names)[:200],
        allowed=f"needed: {', '.join(missing)}; {table.found(120)}",
        fix="name the columns so, with the unit, or let `truebed new session` propose them"
        + held_words(robot, [stem for stem in found if not found[stem]], there),
    )  # fmt: skip


def _unit_beside(columns: Columns | None, kind: str) -> str:
    """The unit of another joint of a kind, or the usual one."""
    return unit_of(columns.names[0]) if columns else "mm" if kind == "length" else "deg"
