"""Round numbers that are marked along an axis."""

import numpy as np

from calib.arrays import Array


def decades(low: float, high: float) -> Array:
    """Powers of ten from `low` to `high`; with fewer than two, the steps of 2 and 5 as well."""
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    found = powers[(powers >= low) & (powers <= high)]
    if len(found) < 2:
        found = (powers[:, None] * [1, 2, 5]).ravel()
        found = found[(found >= low) & (found <= high)]
    return np.asarray(np.round(found, 12))


def ticks(low: float, high: float, most: int) -> Array:
    """Round numbers from `low` to `high`: steps of 1, 2 or 5 times a power of ten, few of them."""
    power = 10.0 ** np.floor(np.log10((high - low) / most))
    steps = (step * power for step in (1, 2, 5, 10))
    step = next(step for step in steps if (high - low) / step <= most)
    found = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return np.asarray(np.round(found, 12)) + 0.0  # no minus before a zero
