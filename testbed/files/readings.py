"""Rows of a file as readings: roles, missed shots, and readings that were written twice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import InputError
from testbed.files.columns import is_known
from testbed.files.session import Stated
from testbed.files.table import Table
from testbed.strict import choice_of

TEXTS = ("pose_id", "station", "split", "approach", "time", "target", "anchor", "euler")
"""Own columns that hold no numbers."""
SPLITS = ("identify", "test")


@dataclass(frozen=True, slots=True, eq=False)
class Extras:
    """Columns that may stand beside joints or readings."""

    pose: tuple[str, ...] | None = None
    repeat: Index | None = None
    split: tuple[str, ...] | None = None
    approach: tuple[str, ...] | None = None
    temperature: Array | None = None
    time: Array | None = None
    warnings: tuple[str, ...] = ()

    def rows(self, index: Index) -> "Extras":
        """The same for some rows (indices)."""
        return replace(self, **{name: _rows(getattr(self, name), index) for name in PER_ROW})


OF_ROWS = (
    "place",
    "order",
    "position",
    "rotation",
    "distance",
    "covariance",
    "target",
    "anchor",
    "station",
    "offset",
)
PER_ROW = ("pose", "repeat", "split", "approach", "temperature", "time")


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Rows of one kind, good ones only, in the order of the file."""

    kind: str
    """pose, point or distance."""
    where: str
    place: tuple[str, ...]
    """(m,) file and line."""
    order: Index
    """(m,) place among all rows of the file, nests and lost shots too, from 0."""
    position: Array
    """(m, 3) in the frame of the station [m]."""
    rotation: Array
    """(m, 3, 3)."""
    distance: Array
    """(m,) [m]."""
    covariance: Array
    """(m, 6, 6) [m, rad]."""
    target: tuple[str, ...]
    """(m,) name of the reflector; empty if the file names none."""
    anchor: tuple[str, ...]
    station: tuple[str, ...]
    offset: Array | None
    """(m, 3) place of the reflector in the tool frame, where the file gives it [m]."""
    stated: Stated
    extras: Extras
    uncertainty: str
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    cycling: bool = False
    """Whether poses are numbered by how often a target was shot before."""

    def __len__(self) -> int:
        return len(self.place)

    def rows(self, which: Bool | Index) -> "Readings":
        """The same for some rows (a mask or indices)."""
        index = np.arange(len(self))[which]
        changes: dict[str, Any] = {name: _rows(getattr(self, name), index) for name in OF_ROWS}
        numbers = None if self.stated.numbers is None else self.stated.numbers[index]
        return replace(
            self,
            **changes,
            stated=replace(self.stated, numbers=numbers),
            extras=self.extras.rows(index),
        )


def _rows(values: Any, index: Index) -> Any:
    """Some entries of a column that may be missing, be a tuple or an array."""
    if values is None:
        return None
    return tuple(values[k] for k in index) if isinstance(values, tuple) else values[index]


def numeric_columns(table: Table) -> list[str]:
    """Own columns of a table that hold numbers."""
    return [name for name in table.names if is_known(name) and name not in TEXTS]


def extras_of(table: Table) -> Extras:
    """The columns of a table that say when, how and what for.

    Raises
    ------
    InputError
        M35: a split that is neither identify nor test; a repeat that is no whole number.
    """
    split = tuple(table.texts("split")) if "split" in table else None
    for row, word in enumerate(split or ()):
        if word not in SPLITS:
            raise InputError(
                f'split is "{word[:20]}"',
                code="M35",
                where=table.place(row),
                field="split",
                value=word[:20],
                allowed="it is identify or test",
                fix=choice_of(word, SPLITS) if len(word) > 2 else "",
            )
    time, told = _times(table)
    temperature = table.numbers(["temperature_degC"])[:, 0] if "temperature_degC" in table else None
    return Extras(
        pose=tuple(table.texts("pose_id")) if "pose_id" in table else None,
        repeat=_repeats(table) if "repeat" in table else None,
        split=split,
        approach=tuple(table.texts("approach")) if "approach" in table else None,
        temperature=temperature,
        time=time,
        warnings=told,
    )


def _repeats(table: Table) -> Index:
    """Which visit each row is."""
    values = table.numbers(["repeat"])[:, 0]
    wrong = ~(np.isfinite(values) & (values >= 0) & (values == np.floor(values)) & (values < 1e9))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f'repeat is "{table.texts("repeat")[row][:20]}"',
            code="M35",
            where=table.place(row),
            field="repeat",
            allowed="it is a whole number, 0 for the first visit",
            fix="mend it",
        )
    return values.astype(np.int64)


def _times(table: Table) -> tuple[Array | None, tuple[str, ...]]:
    """Times [s], or why there are none: a clock that stands still orders nothing."""
    if "time_s" in table:
        times = table.numbers(["time_s"])[:, 0]
    elif "time" in table:
        times = _clock(table)
    else:
        return None, ()
    if not np.isfinite(times).all():
        return None, (f"{table.where}: the times cannot be read and are not used",)
    if len(times) > 2 and len(np.unique(times)) < len(times) / 2:
        count = len(np.unique(times))
        return None, (f"{table.where}: the times are rounded to {count} values and are not used",)
    return times - times[:1], ()


def _clock(table: Table) -> Array:
    """Times of a column of numbers [s] or of ISO dates; nan where it is neither."""
    numbers = table.numbers(["time"])[:, 0]
    if np.isfinite(numbers).all():
        return numbers
    out = []
    for text in table.texts("time"):
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            return np.full(len(table), np.nan)
        # an hour without zone is taken as it stands: only differences count
        out.append(moment.replace(tzinfo=None).toordinal() * 86400.0 + _seconds(moment))
    return np.array(out)


def _seconds(moment: datetime) -> float:
    """Seconds since midnight."""
    return moment.hour * 3600 + moment.minute * 60 + moment.second + moment.microsecond / 1e6


SHOWN = 10


def missed_shots(readings: Readings, nests: Sequence[str]) -> tuple[Bool, list[str]]:
    """Rows (m,) that were measured, and a sentence on those that were not.

    A tracker that loses its target writes 0 0 0, or a distance of 0. Shots at `nests` stay: rounds
    are counted by them.
    """
    if readings.kind == "distance":
        lost = readings.distance == 0
    else:
        lost = np.asarray((readings.position == 0).all(axis=1))
    lost = lost & ~np.isin(readings.target, nests)
    return ~lost, told(readings.place, lost, "missed shots, written as 0 0 0")


def copied_rows(readings: Readings) -> tuple[Bool, list[str]]:
    """Rows (m,) without those that repeat the digits of an earlier one; they tell nothing new."""
    key = np.column_stack(
        [
            readings.position,
            readings.rotation.reshape(-1, 9),
            readings.distance,
            _codes(readings.station),
            _codes(readings.anchor),
        ]
    )
    _, first = np.unique(key, axis=0, return_index=True)
    copies = np.ones(len(readings), dtype=bool)
    copies[first] = False
    sentence = "copies of earlier readings, digit for digit; each counts once"
    return ~copies, told(readings.place, copies, sentence)


def told(place: Sequence[str], rows: Bool, what: str) -> list[str]:
    """One sentence on some rows: how many, what they are, and where."""
    found = np.flatnonzero(rows)
    if not found.size:
        return []
    file = place[found[0]].rpartition(":")[0]
    lines = ", ".join(place[row].rpartition(":")[2] for row in found[:SHOWN])
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    plural = "s" if len(found) > 1 else ""
    return [f"{file}: {len(found)} row{plural} left out (line{plural} {lines}{more}): {what}"]


def _codes(names: Sequence[str]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """A number for each different text."""
    return np.unique(np.array(names, dtype=str), return_inverse=True)[1].ravel()


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Joints and what was seen there."""

    q: Array
    """(m, n) [rad, m]."""
    position: Array
    """(m, 3) [m]."""
    rotation: Array | None
    """(m, 3, 3); None for points."""
    numbers: Array | None
    """(m, k) rotations as they stand in the file, as in `Stated.numbers`."""
