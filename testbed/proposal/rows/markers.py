"""Several markers in each row of a file without names: they stay as far from each other."""

from itertools import combinations

import numpy as np

from calib.arrays import Array
from testbed.bounds import FACTORS
from testbed.files.reflectors.one_tool import apart_or_alike
from testbed.proposal.data import Found
from testbed.proposal.sizes import signed

AXES = 3
COUNTERS = 2
"""Largest number of columns before the markers: a frame and a time."""
FEWEST = 2
STAY = 0.1
"""How much the distance of two markers varies, at most, beside how far each of them moves.

Numbers that have nothing to do with each other vary by about half of it.
"""


def markers_in(look: Found, unit: str) -> dict[str, tuple[str, ...]]:
    """Columns of the markers on one rigid tool, by name; none where it is not certain.

    A rotation beside a place, or a transform, has no three numbers that stay as far as that from
    all others.
    """
    for skip in range(COUNTERS + 1):
        count, rest = divmod(look.width - skip, AXES)
        if rest or count < FEWEST:
            continue
        at = look.names + skip
        found = {
            f"marker {k + 1}": tuple(str(at + AXES * k + axis + 1) for axis in range(AXES))
            for k in range(count)
        }
        places = [FACTORS[unit] * signed(look, columns).T for columns in found.values()]
        if all(
            _stay(one, other) and not apart_or_alike(one, other)
            for one, other in combinations(places, 2)
        ):
            return found
    return {}


def _stay(one: Array, other: Array) -> bool:
    """Whether two places (m, 3) move, and the distance between them hardly varies.

    Joints that turn little, and columns that are constant, stay near each other as well. Medians,
    so that single shots that were missed say nothing.
    """
    seen = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    if not seen.any():
        return False
    one, other = one[seen], other[seen]
    moves = min(_spread(one), _spread(other))
    varies = _spread(np.linalg.norm(one - other, axis=1)[:, None])
    return varies < STAY * moves


def _spread(places: Array) -> float:
    """Median distance of places (m, k) from their middle."""
    return float(np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
