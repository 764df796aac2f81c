"""Rows as one reading of a file has them: what is compared when readings are tried."""

from dataclasses import dataclass

from calib.arrays import Array


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
