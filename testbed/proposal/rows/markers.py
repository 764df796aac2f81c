"""Several markers in each row of a file without names: they stay as far from each other."""

from itertools import combinations

from testbed.bounds import FACTORS
from testbed.files.reflectors.one_tool import apart_or_alike
from testbed.proposal.data import Found
from testbed.proposal.sizes import signed

AXES = 3
COUNTERS = 2
"""Largest number of columns before the markers: a frame and a time."""
FEWEST = 2


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
        if not any(apart_or_alike(one, other) for one, other in combinations(places, 2)):
            return found
    return {}
