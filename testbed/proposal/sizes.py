"""Numbers in columns of files, and their likely unit by their size."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from testbed.files.dialects.marks import either_mark
from testbed.proposal.data import Found

FEW = 300
"""Number of rows that are used."""
REACH = 20.0
"""Size of positions above which they cannot be in meters [m]."""


def by_size(
    look: Found, names: Sequence[str], most: float, units: tuple[str, str]
) -> tuple[str, ...]:
    """Both units, with the likely one by the size of the numbers first."""
    sizes = _numbers(look, names)
    large = bool(np.nan_to_num(sizes).max(initial=0.0) > most)
    return units if large else units[::-1]


def signed(look: Found, names: Sequence[str]) -> Array:
    """Numbers (k, m) of some columns; nan for cells that are not numbers."""
    return np.array([[either_mark(cell) for cell in look.column(name)[:FEW]] for name in names])


def _numbers(look: Found, names: Sequence[str]) -> Array:
    """Absolute values of all numbers in some columns; nan for cells that are not numbers."""
    values: Array = signed(look, names).ravel() if names else np.array([np.nan])
    return np.abs(values)
