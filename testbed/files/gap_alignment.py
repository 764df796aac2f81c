"""Two sequences aligned with gaps (Needleman, Wunsch 1970): readings and poses in their orders."""

import numpy as np

from calib.arrays import Array, Bool, Index

ALONE = 50.0
"""What a reading or a pose left alone costs, in squares of usual errors; a row that fits nowhere
costs as much as both, less a little, so that it stays where it is."""


def aligned(cost: Array, shifts: Index, n: int) -> tuple[float, Index]:
    """What the cheapest way through m readings and n poses costs, and each reading's shift in it.

    Parameters
    ----------
    cost : (m, s) array
        Of each reading at each shift, in the unit of `ALONE`.
    shifts : (s,) array of int
        How many poses further than its own number a reading may belong, one after the other.
    n : int
        Poses.

    Returns
    -------
    total : float
        Cost of the way, `ALONE` for each reading and each pose left alone.
    way : (m,) array of int
        Place of each reading's shift among `shifts`; -1 where the reading is left alone.
    """
    m, price, places = len(cost), ALONE * shifts, np.arange(len(shifts))
    total = np.where(shifts >= 0, price, np.inf)
    matched, source = np.zeros(cost.shape, dtype=bool), np.zeros(cost.shape, dtype=np.int64)
    for i in range(m):
        joints = i + shifts
        stay = np.where((joints >= 0) & (joints < n), total + cost[i], np.inf)
        extra = np.append(total[1:] + ALONE, np.inf)
        matched[i] = stay <= extra
        # a pose left alone moves on by one shift: the cheapest of all before
        ahead = np.where(joints + 1 <= n, np.minimum(stay, extra), np.inf) - price
        least = np.minimum.accumulate(ahead)
        source[i] = np.maximum.accumulate(np.where(ahead == least, places, 0))
        total = np.where((joints + 1 >= 0) & (joints + 1 <= n), least + price, np.inf)
    place = int(np.searchsorted(shifts, n - m))
    best, way = float(total[place]), np.full(m, -1)
    for i in range(m - 1, -1, -1):
        place = int(source[i, place])
        if matched[i, place]:
            way[i] = place
        else:
            place += 1
    return best, way


def without_swaps(good: Index, way: Index, near: Bool, shifts: Index) -> Index:
    """The rows that fit without one of each two in each other's place: they are no missed shot.

    Parameters
    ----------
    good : (k,) array of int
        Readings that fit at the shifts of their way.
    way : (m,) array of int
        As `aligned` gives it.
    near : (m, s) array of bool
        Whether each reading fits at each shift.
    shifts : (s,) array of int
        As in `aligned`.
    """
    kept, here = [], shifts[way]
    for k, row in enumerate(good):
        around = {int(here[other]) for other in (*good[max(k - 1, 0) : k], *good[k + 1 : k + 2])}
        if len(around) == 1 and int(here[row]) not in around:
            usual = around.pop()
            other, back = int(row + here[row] - usual), int(2 * usual - here[row])
            place = back - int(shifts[0])
            inside = 0 <= other < len(way) and 0 <= place < len(shifts)
            if inside and other not in good and near[other, place]:
                continue
        kept.append(row)
    return np.array(kept, dtype=np.int64)
