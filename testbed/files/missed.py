"""Rows that are no measurements: shots that missed, and readings that were written twice."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Bool
from testbed.files.readings import Readings

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
