"""Whether the noise of many robots remembers: permutations that all share, likeness as products."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.statement.memory import KERNEL_ROWS, PERMUTATIONS, permuted

AT_ONCE = 2_000_000
"""Numbers of permuted kernels formed at a time: 16 MB. So few in all are kept."""


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
    As `memory.memory_p`: T = sum of K_jk r_j'r_k over pairs of rows; rows that change places change
    the kernel K as well, so that all robots meet one matrix of kernels by their products r_j'r_k.
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
    kernels = iter((_kept if few else _kernels)(m, order.tobytes(), seed, kinds))
    seen = products @ next(kernels)[0]
    for other in kernels:
        larger += (products @ other.T >= seen[:, None]).sum(axis=1)
    return np.asarray((1 + larger) / (1 + PERMUTATIONS)).reshape(len(rows), -1)


def _kernels(
    m: int, order: bytes, seed: int, alike: tuple[tuple[bytes, tuple[int, ...]], ...]
) -> Iterator[Array]:
    """Kernels (c, pairs) of m rows: as they came, then in other orders, some at a time."""
    j, k = np.triu_indices(m, 1)
    kernel = np.exp(-np.arange(m) / KERNEL_ROWS)
    in_time = np.argsort(np.frombuffer(order, dtype=np.int64), kind="stable")

    def of(which: Index) -> Array:
        """Of orders (c, m)."""
        place = np.argsort(which, axis=1)
        return np.asarray(kernel[np.abs(place[:, j] - place[:, k])])

    yield of(in_time[None])
    kinds = [np.frombuffer(rows, dtype=np.int64).reshape(shape) for rows, shape in alike]
    block = max(1, AT_ONCE // max(len(j), 1))
    for which in permuted(m, kinds, np.random.default_rng(seed)):
        moved = which[:, in_time]
        for first in range(0, len(moved), block):
            yield of(moved[first : first + block])


@lru_cache(maxsize=2)
def _kept(
    m: int, order: bytes, seed: int, alike: tuple[tuple[bytes, tuple[int, ...]], ...]
) -> tuple[Array, ...]:
    """The same, all of them."""
    return tuple(_kernels(m, order, seed, alike))
