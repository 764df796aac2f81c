"""Whether the noise of many robots remembers: permutations that all share, likeness as products."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.statement.memory import KERNEL_ROWS, PERMUTATIONS, permuted

AT_ONCE = 2_000_000
"""Numbers of permuted kernels formed at a time: 16 MB."""


def memory_chances(rows: Sequence[Array], order: Index, seed: int, alike: Sequence[Index]) -> Array:
    """Chances (k, R) of rows that follow their neighbors in time as these do, if noise forgets.

    Parameters
    ----------
    rows : sequence of k (R, m, d) arrays
        Whitened position residuals of R robots, or whatever else is asked.
    order : (m,) array
        Place of each row in time.
    seed : int
        Of the permutations, which all share.
    alike : sequence of (k, c) arrays of int
        Rows that may change places, as `memory.interchangeable` finds them.

    References
    ----------
    As `memory.memory_p`: T = sum of K_jk r_j'r_k over rows in time; rows that change places change
    the kernel K as well, so that all robots meet one matrix of kernels by their products r_j'r_k.
    """
    m = rows[0].shape[1]
    likeness = []
    for each in rows:
        about = each.copy()
        for some in alike:
            about[:, some] -= about[:, some].mean(axis=(1, 2), keepdims=True)
        likeness.append((about @ np.swapaxes(about, 1, 2)).reshape(len(about), m * m))
    products = np.concatenate(likeness)
    later = np.subtract.outer(np.arange(m), np.arange(m))
    kernel = np.where(later > 0, np.exp(-np.maximum(later, 0) / KERNEL_ROWS), 0.0)
    in_time, rng = np.argsort(order, kind="stable"), np.random.default_rng(seed)

    def of(which: Index) -> Array:
        """T (k R, c) of orders (c, m)."""
        place = np.argsort(which, axis=1)
        return products @ kernel[place[:, :, None], place[:, None, :]].reshape(-1, m * m).T

    seen, larger, block = of(in_time[None]), np.zeros(len(products)), max(1, AT_ONCE // m**2)
    for which in permuted(m, alike, rng):
        moved = which[:, in_time]
        for k in range(0, len(moved), block):
            larger += (of(moved[k : k + block]) >= seen).sum(axis=1)
    return np.asarray((1 + larger) / (1 + PERMUTATIONS)).reshape(len(rows), -1)
