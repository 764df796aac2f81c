"""Which rows belong together: group numbers, and counts of distinct rows."""

import numpy as np

from calib.arrays import Array, Index


def united(one: Index, other: Index) -> Index:
    """Group (m,) of each row in the finest grouping that keeps the groups of both together."""
    group = one
    while True:
        # spread the lowest group number over the groups of the other numbering, then of this one
        lowest = np.full(len(group), len(group))
        np.minimum.at(lowest, other, group)
        by_other = lowest[other]
        lowest = np.full(len(group), len(group))
        np.minimum.at(lowest, one, by_other)
        if np.array_equal(lowest[one], group):
            return group
        group = lowest[one]


def count_distinct(rows: Array) -> int:
    """Number of distinct rows (m, k)."""
    # adding zero takes the sign of zeros away
    return len({row.tobytes() for row in rows + 0.0})


def first_met(rows: Array | Index) -> Index:
    """Number (m,) of each distinct row, counted in order of appearance."""
    _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[group.ravel()], dtype=np.int64)


def spans(values: Array, group: Index) -> Array:
    """Largest minus smallest (g, n) of the values (m, n) in each group (m,)."""
    low = np.full((int(group.max()) + 1, values.shape[1]), np.inf)
    high = -low
    np.minimum.at(low, group, values)
    np.maximum.at(high, group, values)
    return np.asarray(high - low)
