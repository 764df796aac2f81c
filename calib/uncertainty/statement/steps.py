"""Steps that the values of a joint keep over all poses, between which nothing was proven."""

import numpy as np

from calib.arrays import Array, frozen

STEP, STEP_SLIDE = np.radians(2.0), 0.002
"""Least step of a joint's values that is named: gears make some 30 to 200 waves a turn of a joint,
screws a wave in some millimeters [rad, m]."""
ON_STEP = 0.02
"""Share of a step within which a value stands on it: an error that repeats with the steps then
changes by an eighth of its amplitude at most."""


def steps_of(q: Array, prismatic: Array) -> Array:
    """Step (n,) that all values of each joint keep over poses q (m, n); zero where none [rad, m].

    An error that repeats with the steps, as that of a gear or a screw may, looks like a shift of
    the joint at all these poses: no reading shows it.
    """
    least = np.where(prismatic > 0, STEP_SLIDE, STEP)
    return frozen([_step(values, fewest) for values, fewest in zip(q.T, least, strict=True)])


def _step(values: Array, least: float) -> float:
    """Largest step of at least `least` that values (m,) keep; zero if none."""
    sorted_values = np.sort(values)
    gaps = np.diff(sorted_values)
    wide = gaps[gaps > least / 2]
    if not len(wide):
        return 0.0
    for parts in range(1, int(wide.min() / least + ON_STEP) + 1):
        place = np.concatenate([[0.0], np.cumsum(np.round(gaps * parts / wide.min()))])
        step, first = np.polynomial.polynomial.polyfit(place, sorted_values, 1)[::-1]
        if np.abs(sorted_values - first - step * place).max() <= ON_STEP / 2 * step:
            return float(step)
    return 0.0
