"""Whether the noise of many robots remembers: permutations that all share, kernels as products."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.statement.memory import KERNEL_ROWS, PERMUTATIONS, permuted


def memory_chances(rows: Array, order: Index, seed: int, alike: Sequence[Index]) -> Array:
    """Chance (R,) of rows that follow their neighbors in time as these do, if noise forgets.

    Parameters
    ----------
    rows : (R, m, d) array
        Whitened position residuals of R robots, or whatever else is asked.
    order : (m,) array
        Place of each row in time.
    seed : int
        Of the permutations, which all robots share.
    alike : sequence of (k, c) arrays of int
        Rows that may change places, as `memory.interchangeable` finds them.

    References
    ----------
    As `memory.memory_p`; of each order the rows' products with all before them, by one kernel.
    """
    m, rows = rows.shape[1], rows.copy()
    for some in alike:
        rows[:, some] -= rows[:, some].mean(axis=(1, 2), keepdims=True)
    in_time = np.argsort(order, kind="stable")
    rng = np.random.default_rng(seed)
    orders = [in_time[None], *(which[:, in_time] for which in permuted(m, alike, rng))]
    which = np.concatenate(orders)
    later = np.subtract.outer(np.arange(m), np.arange(m))
    kernel = np.where(later > 0, np.exp(-np.maximum(later, 0) / KERNEL_ROWS), 0.0)
    found = np.empty(len(rows))
    for k, one in enumerate(rows):
        moved = one[which].swapaxes(0, 1).reshape(m, -1)  # (m, orders x d)
        each = (moved * (kernel @ moved)).sum(axis=0).reshape(len(which), -1).sum(axis=1)
        found[k] = (1 + (each[1:] >= each[0]).sum()) / (1 + PERMUTATIONS)
    return found
