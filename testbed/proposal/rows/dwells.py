"""How far the clock of a log of joints is ahead of that of readings, from the stops of the arm."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index

ALIKE = 1e-4
"""Joints of one stop lie within this part of their range: 0.01 deg of 100 deg."""
LONGER = 3.0
"""The stops at which an arm was measured last so many times longer than any other."""
AROUND = 3
"""Times the length of a run around it within which the rest of its stop is looked for."""
OTHERS, SHORT = 3, 0.1
"""Stops beside those of the readings that are tried in their place, of which none lasts less than
this part of the shortest of those: one may have been cut off."""
FEWEST = 6
"""Readings below which no difference of the clocks is proposed."""


@dataclass(frozen=True, slots=True)
class Offset:
    """Differences of two clocks at which each reading falls into its stop [s]."""

    least: float
    most: float

    @property
    def middle(self) -> float:
        """The one farthest from both ends, with no more digits than these tell."""
        digits = max(0, 1 - int(np.floor(np.log10(max(self.most - self.least, 1e-3)))))
        return round((self.least + self.most) / 2, digits)


def clock_offset(times: Array, joints: Array, moments: Array) -> Offset | None:
    """What to add to sorted moments of readings (k,) so that each falls into a stop of its own [s].

    `times` (m,) of a log are sorted [s], `joints` (m, n) are of any units. None if there are not as
    many stops as readings, if no one difference brings each reading into its stop, or if another
    choice of stops has one, too.
    """
    k = len(moments)
    if k < FEWEST or len(times) < 2 * k:
        return None
    stops = _stops(joints, 3 * k)
    begin, end = times[stops[:, 0]], times[stops[:, 1]]
    order = np.argsort(end - begin)[::-1]
    if len(order) < k:
        return None
    lasts = (end - begin)[order]
    if lasts[k - 1] <= 0 or (len(order) > k and lasts[k - 1] < LONGER * lasts[k]):
        return None
    found = [
        Offset(least, most)
        for kept in _chosen(order[lasts >= SHORT * lasts[k - 1]], k)
        if (least := float((begin[kept] - moments).max()))
        < (most := float((end[kept] - moments).min()))
    ]
    return found[0] if len(found) == 1 else None


def _chosen(order: Index, k: int) -> list[Index]:
    """The k longest of some stops, of which `order` (s,) tells the lengths, and all k in a row.

    Of these and a few more: an arm that rests at home before or after makes a longer stop than any.
    """
    some = np.sort(order[: k + OTHERS])
    rows = [some[first : first + k] for first in range(len(some) - k + 1)]
    longest = np.sort(order[:k])
    return rows if any(np.array_equal(longest, one) for one in rows) else [longest, *rows]


def _stops(joints: Array, most: int) -> Index:
    """First and last row (s, 2) of up to `most` of the longest stretches alike, in time.

    A run that begins on the way into a stop may end within it: the middle of its rows is what the
    others are held against.
    """
    scaled = joints / np.maximum(np.ptp(joints, axis=0), 1e-12) / ALIKE
    runs = _runs(scaled)
    taken, found = np.zeros(len(scaled), dtype=np.bool_), list[tuple[int, int]]()
    for first, last in runs[np.argsort(runs[:, 0] - runs[:, 1], kind="stable")[:most]].tolist():
        if taken[first : last + 1].any():
            continue
        begin, end = max(0, first - AROUND * (last + 1 - first)), last + AROUND * (last + 1 - first)
        some, middle = scaled[begin : end + 1], (first + last) // 2 - begin
        away = (np.abs(some - np.median(scaled[first : last + 1], axis=0)) > 1).any(axis=1)
        away |= taken[begin : end + 1]
        before, after = np.flatnonzero(away[:middle]), np.flatnonzero(away[middle:])
        low = begin + (int(before[-1]) + 1 if len(before) else 0)
        high = begin + (middle + int(after[0]) if len(after) else len(some)) - 1
        if high < begin + middle:
            continue  # a row of its own, on the way
        taken[low : high + 1] = True
        found.append((low, high))
    return np.array(sorted(found))


def _runs(scaled: Array) -> Index:
    """First and last row (r, 2) of each run of rows (m, n) that are within 1 of its first one."""
    runs, k = list[tuple[int, int]](), 0
    while k < len(scaled):
        size, end = 64, k + 1
        while end < len(scaled):
            away = (np.abs(scaled[end : end + size] - scaled[k]) > 1).any(axis=1)
            if away.any():
                end += int(np.argmax(away))
                break
            end, size = min(end + size, len(scaled)), 2 * size
        runs.append((k, end - 1))
        k = end
    return np.array(runs)
