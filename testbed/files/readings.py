"""Rows of a file as readings: poses, points and distances, without lost readings and copies."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.measurement.corrections import Corrections
from testbed.files.joints import Extras
from testbed.files.refusal import refusal
from testbed.files.session import Stated, rows_of
from testbed.files.table import Columns, DataTable, Unread
from testbed.files.uncertainty import Spread
from testbed.units import counted, named

SHOWN = 10
"""Lines named in one sentence."""
NO_DIRECTION = "say that the tool is at a fixed point, and not to which side of it it is off"
BAR = (
    "a ball in a socket is no distance: put a bar of known length (50 mm or more) between both and "
    "write that length, or measure where the sockets are and give positions under [points]"
)
"""What to do where a ball was put into a socket: that fixes three numbers, and a distance one."""
TOUCHES = 3
"""Rows of each place that a tip touches. Two are a reading and its copy."""
COPIES = "copies of earlier readings, digit for digit"
"""What rows are that repeat the digits of others."""


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Rows of one kind, good ones only, in the order of the file."""

    kind: str
    """pose, point or distance."""
    where: str
    place: tuple[str, ...]
    """(m,) file and line."""
    order: Index
    """(m,) place among all rows of the file, nests and lost readings too, from 0."""
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
    uncertainty: str
    """Where the covariances come from."""
    offset: Array | None = None
    """(m, 3) place of the reflector in the tool frame, where the file gives it [m]."""
    corrections: Corrections | None = None
    """Those by nests, where a drift was taken off."""
    columns: Columns = field(default_factory=Columns)
    """Columns of numbers that were read."""
    stated: Stated = field(default_factory=Stated)
    extras: Extras = field(default_factory=Extras)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unread: tuple[Unread, ...] = ()
    """What the notes say of columns."""
    cycling: bool = False
    """Whether poses are numbered by how often a target was measured before."""

    def __len__(self) -> int:
        return len(self.place)

    def rows(self, which: Bool | Index) -> "Readings":
        """The same for some rows (a mask or indices)."""
        index = np.arange(len(self))[which]
        columns = (
            "place", "order", "position", "rotation", "distance", "covariance", "target", "anchor",
            "station", "offset",
        )  # fmt: skip
        some = rows_of(self, index, columns)
        return replace(
            some,
            stated=self.stated.rows(index),
            extras=self.extras.rows(index),
            corrections=self.corrections and self.corrections.rows(index),
        )


def plain_readings(table: DataTable, kind: str, position: Array, spread: Spread) -> Readings:
    """Readings (m, 3) [m] of all rows of a table, without rotations, distances and names."""
    m = len(table)
    nameless = ("",) * m
    return Readings(
        kind=kind,
        where=table.where,
        place=table.places,
        order=np.arange(m),
        position=position,
        rotation=np.tile(np.eye(3), (m, 1, 1)),
        distance=np.zeros(m),
        covariance=spread.covariance,
        target=nameless,
        anchor=nameless,
        station=nameless,
        uncertainty=spread.source,
    )


def are_touched(position: Array) -> bool:
    """Whether positions (m, 3) are places that a tip touches again and again, to the last digit.

    An instrument does not read every one of its readings three times.
    """
    _, count = np.unique(position, axis=0, return_counts=True)
    return len(count) > 0 and bool(count.min() >= TOUCHES)


def lost_readings(
    readings: Readings, nests: Sequence[str], *, touches: bool = True
) -> tuple[Bool, list[str]]:
    """Rows (m,) that were measured, and a sentence on those that were not.

    A tracker that loses its target writes 0 0 0, or a distance of 0. Readings of `nests` stay:
    rounds are counted by them. So does a place in the origin that a tip touches, among others;
    without `touches`, as in cycles that an instrument measures, none is.

    Raises
    ------
    InputError
        M27: all distances are 0, as of balls in sockets.
    """
    distance = readings.kind == "distance"
    zero = readings.distance == 0 if distance else (readings.position == 0).all(axis=1)
    lost = zero & ~np.isin(readings.target, nests)
    if touches and not (distance or zero.all()) and are_touched(readings.position):
        lost[:] = False
    if distance and len(zero) and zero.all():
        raise refusal(
            readings.where, "distance", f"has no distance but 0: lengths of 0 {NO_DIRECTION}",
            code="M27", allowed="a distance of 0 is a missed shot", fix=BAR,
        )  # fmt: skip
    written = "0" if distance else "0 0 0"
    return ~lost, rows_said(readings.place, lost, f"missed shots, written as {written}")


def lost_targets(readings: Readings, good: Bool) -> list[str]:
    """A sentence on each target none of whose rows is among the good ones (m,)."""
    left = {name for name, one in zip(readings.target, good, strict=True) if one}
    return [
        f"{readings.where}: all {counted(readings.target.count(name), 'shot')} of "
        f"{f'target {name}' if name else 'this file'} were missed, so it takes no part"
        for name in dict.fromkeys(readings.target)
        if name not in left
    ]


def copied_rows(readings: Readings, *beside: Array | Index) -> tuple[Bool, list[str]]:
    """Rows (m,) without those that repeat the digits of an earlier one, and a sentence on them.

    Numbers (m,) or (m, k) `beside` the readings must be equal, too.
    """
    names = (readings.station, readings.anchor)
    codes = [np.unique(np.array(texts, dtype=str), return_inverse=True)[1] for texts in names]
    rotation = readings.rotation.reshape(-1, 9)
    key = np.column_stack([readings.position, rotation, readings.distance, *codes, *beside])
    _, first = np.unique(key, axis=0, return_index=True)
    copies = np.ones(len(readings), dtype=bool)
    copies[first] = False
    return ~copies, rows_said(readings.place, copies, f"{COPIES}; each counts once")


def rows_said(place: Sequence[str], rows: Bool, what: str, *, left: str = "left out ") -> list[str]:
    """One sentence on some rows: how many, what they are, and where; none if there are none."""
    count = int(rows.sum())
    if not count:
        return []
    split = [place[row].rpartition(":") for row in np.flatnonzero(rows)[:SHOWN]]
    lines = named("line", [line for _, _, line in split], count)
    return [f"{split[0][0]}: {counted(count, 'row')} {left}({lines}): {what}"]
