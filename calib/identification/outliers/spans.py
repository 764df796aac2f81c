"""Spans of rows in order of time that something which moved may have displaced."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Index
from calib.measurement.observations import Measurements

FEWEST = 8
"""Fewest poses on either side of a step; six numbers would fit fewer too well."""
BACK = 4
"""Fewest stops between a step and the one back: twelve coordinates for up to six numbers."""
BESIDE = 2
"""Fewest stops before the first of the two, and after the second: one may be a wrong shot."""
ENDS = 120
"""Stops that are tried as ends of a span; of more, every second or third, and so on."""


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """Spans that are tried for what moved."""

    first: Index
    """(s,) first row of each, in time."""
    end: Index
    """(s,) first row behind each; the number of rows where nothing came back."""
    tried: int
    """How many there are, with those between the ends that are tried."""
    back: bool = False
    """Whether it came back."""


def steps_of(rows: Measurements) -> Spans:
    """From a stop on, with enough poses on either side."""
    first = _stops(rows)[1:]
    count = np.arange(1, len(first) + 1)  # stops before each
    first = first[(count >= FEWEST) & (len(first) + 1 - count >= FEWEST)]
    return Spans(first, np.full(len(first), len(rows)), len(first))


def intervals_of(rows: Measurements) -> Spans:
    """From a stop on until before another, with enough of them between, and poses beside."""
    stops = _stops(rows)
    place = np.arange(BESIDE, len(stops) - BESIDE + 1)
    pairs = len(place) * (len(place) - 1) // 2
    place = place[:: -(-len(place) // ENDS) or 1]
    one, other = (each.ravel() for each in np.meshgrid(place, place, indexing="ij"))
    inside = other - one
    use = (inside >= BACK) & (len(stops) - inside >= FEWEST)
    return Spans(stops[one[use]], stops[other[use]], max(pairs, 1), back=True)


def _stops(rows: Measurements) -> Index:
    """First row of every stop, in time."""
    pose = rows.pose_id
    return np.flatnonzero(np.concatenate([[True], pose[1:] != pose[:-1]]))
