"""Test of many robots for noise with memory, by permutations that all of them share."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.drift.drifting import SEED
from calib.uncertainty.drift.memory import KERNEL_ROWS, PERMUTATIONS, permuted

AT_ONCE = 2_000_000
"""Entries of permuted kernels computed at a time (16 MB); kernels that need no more are cached."""


def memory_chances(rows: Sequence[Array], order: Index, alike: Sequence[Index]) -> Array:
    """P-values (k, R) of rows that resemble their neighbors in time, if the noise has no memory.

    Parameters
    ----------
    rows : sequence of k (R, m, d) arrays
        Quantities to test for R robots, for example whitened position residuals.
    order : (m,) array
        Place of each row in time.
    alike : sequence of (k, c) arrays of int
        Rows that may change places, from `memory.interchangeable`.

    References
    ----------
    As in `memory.memory_p`: T = sum of K_jk r_j'r_k over pairs of rows. Permuting rows is the same
    as permuting the kernel K, so that one matrix of kernels, multiplied by the products r_j'r_k,
    serves all robots.
    """
    m = rows[0].shape[1]
    j, k = np.triu_indices(m, 1)
    likeness = []
    for each in rows:
        about = each.copy()
        for some in alike:
            about[:, some] -= about[:, some].mean(axis=(1, 2), keepdims=True)
        likeness.append((about @ np.swapaxes(about, 1, 2))[:, j, k])
    products = np.concatenate(likeness)
    larger = np.zeros(len(products))
    kinds = tuple((some.tobytes(), some.shape) for some in alike)
    few = (1 + PERMUTATIONS) * len(j) <= AT_ONCE
    kernels = iter((_kept if few else _kernels)(m, order.tobytes(), kinds))
    seen = products @ next(kernels)[0]
    for other in kernels:
        larger += (products @ other.T >= seen[:, None]).sum(axis=1)
    return np.asarray((1 + larger) / (1 + PERMUTATIONS)).reshape(len(rows), -1)


def _kernels(
    m: int, order: bytes, alike: tuple[tuple[bytes, tuple[int, ...]], ...]
) -> Iterator[Array]:
    """Kernels (c, pairs) of m rows in the order of time, then of permutations, block by block."""
    j, k = np.triu_indices(m, 1)
    kernel = np.exp(-np.arange(m) / KERNEL_ROWS)
    in_time = np.argsort(np.frombuffer(order, dtype=np.int64), kind="stable")

    def of(which: Index) -> Array:
        """Kernels (c, pairs) of orders (c, m)."""
        place = np.argsort(which, axis=1)
        return np.asarray(kernel[np.abs(place[:, j] - place[:, k])])

    yield of(in_time[None])
    kinds = [np.frombuffer(rows, dtype=np.int64).reshape(shape) for rows, shape in alike]
    block = max(1, AT_ONCE // max(len(j), 1))
    for which in permuted(m, kinds, np.random.default_rng(SEED)):
        moved = which[:, in_time]
        for first in range(0, len(moved), block):
            yield of(moved[first : first + block])


@lru_cache(maxsize=2)
def _kept(
    m: int, order: bytes, alike: tuple[tuple[bytes, tuple[int, ...]], ...]
) -> tuple[Array, ...]:
    """All blocks of `_kernels`, cached."""
    return tuple(_kernels(m, order, alike))
