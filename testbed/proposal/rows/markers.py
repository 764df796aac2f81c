"""Several markers in each row of a file without names: they stay as far from each other."""

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np

from calib.arrays import Array
from testbed.bounds import FACTORS
from testbed.files.dialects.numbers import number_of
from testbed.files.reflectors.one_tool import apart_or_alike
from testbed.proposal.data import Document, Found, Part
from testbed.proposal.sizes import REACH, by_size, signed

AXES = 3
COUNTERS = 2
"""Largest number of columns before the markers: a frame and a time."""
FEWEST = 2
STAY = 0.1
"""How much the distance of two markers varies, at most, beside how far each of them moves.

Numbers that have nothing to do with each other vary by about half of it.
"""


def marker_parts(look: Found, n: int) -> Iterator[Part]:
    """[points] of rows of several markers on one tool, alone or with `n` joints, for each unit."""
    columns = [str(k + 1) for k in range(look.names, look.names + look.width)]
    marked = beside_joints(look, n)
    units = marked[2:] if marked else by_size(look, columns[COUNTERS:], REACH, ("mm", "m"))
    for unit in units:
        if found := marked[1] if marked else markers_in(look, unit):
            first, last = (next(iter(each)) for each in (found.values(), reversed(found.values())))
            said = (
                f"positions: columns {first[0]} to {last[-1]}, taken as {len(found)} markers: they "
                "stay as far from each other in all rows",
                f"positions: no column states its unit; assumed: {unit}",
            )
            targets = {name: list(own) for name, own in found.items()}
            keys: Document = {"section": "points", "length": unit, "targets": targets}
            yield look, keys, said, "both markers" if marked else "readings"


def markers_in(look: Found, unit: str) -> dict[str, tuple[str, ...]]:
    """Columns of the markers on one rigid tool, by name; none where it is not certain.

    A rotation beside a place, or a transform, has no three numbers that stay as far as that from
    all others.
    """
    every = [str(k + 1) for k in range(look.names, look.names + look.width)]
    return next(
        (found for skip in range(COUNTERS + 1) if (found := _of(look, every[skip:], unit))), {}
    )


def beside_joints(
    look: Found, n: int
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]], str] | None:
    """Columns of `n` joints, those of the markers beside them, and the unit of these.

    None where it is not certain, as where all columns are of markers. A number of the row may stand
    before them, and columns that never change anywhere: they say nothing of a pose.
    """
    if any(markers_in(look, unit) for unit in ("mm", "m")):
        return None
    moving = moving_columns(look)
    for skip, unit in product((0, 1), ("mm", "m")):
        left = moving[skip:]
        for joints, places in ((left[:n], left[n:]), (left[-n:], left[:-n])):
            if len(joints) == n and (found := _of(look, places, unit)):
                return tuple(joints), found, unit
    return None


def moving_columns(look: Found) -> list[str]:
    """Names of the columns of numbers that are not the same number in all rows."""
    every = [str(k + 1) for k in range(look.names, look.names + look.width)]
    return [name for name in every if len({number_of(cell) for cell in look.column(name)}) > 1]


def _of(look: Found, columns: Sequence[str], unit: str) -> dict[str, tuple[str, ...]]:
    """Three columns of each marker, if all of these columns are of markers on one tool."""
    count, rest = divmod(len(columns), AXES)
    if rest or count < FEWEST:
        return {}
    found = {f"marker {k + 1}": tuple(columns[AXES * k : AXES * (k + 1)]) for k in range(count)}
    places = [FACTORS[unit] * signed(look, own).T for own in found.values()]
    pairs = combinations(places, 2)
    alone = all(_stay(one, other) and not apart_or_alike(one, other) for one, other in pairs)
    return found if alone else {}


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
