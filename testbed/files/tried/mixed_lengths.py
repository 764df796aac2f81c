"""Positions of which some rows are in another unit than the others."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.frames import length
from testbed.files.alternatives import Alternative, Interpretation, OtherReadings

UNITS = ((25.4, "inches, not mm"), (1e3, "m, not mm"), (10.0, "cm, not mm"))
"""Factors by which such rows are too small, and how they are said to be."""
APART = 3.0
"""A factor between the distances of neighboring rows, ranked, above which two units are tried."""


def nearer_rows(position: Array) -> Bool:
    """Rows (m,) that a wide gap in their distances from the instrument parts from the others."""
    far = np.maximum(length(position), 1e-9)
    ranked = np.sort(far)
    steps = ranked[1:] / ranked[:-1]
    if len(far) < 2 or steps.max() < APART:
        return np.zeros(len(far), dtype=np.bool_)
    return np.asarray(far < ranked[1 + int(np.argmax(steps))])


def mixed_lengths(rows: Interpretation, first: str) -> OtherReadings:
    """Positions of some rows in another unit; `first` is the file and line of the first of them."""
    small = nearer_rows(rows.position)
    if not small.any():
        return
    line = first.rpartition(":")[2]
    for factor, units in UNITS:
        condition = f"if the positions of some rows, the first in line {line}, are in {units}"
        fix = "write all rows in one unit"
        other = Alternative("length", condition, fix, "M21", "length")
        yield other, replace(rows, position=rows.position * np.where(small[:, None], factor, 1.0))
