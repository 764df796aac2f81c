"""Rank: how many directions a measurement determines, which columns span them, what is learned."""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check

RANK_TOLERANCE = 1e-9
"""Singular values above this part of the largest count (TX60: the gap is from 0.19 to 1e-15)."""
PRACTICAL_RATIO = 0.5
"""A direction is learned if measuring brings its sd below this part of its prior sd."""
KEEP_TOLERANCE = 1e-6
"""A column is kept when more than this part of it lies outside the columns already kept."""
PLAIN = 100.0
"""A column this many times above that tolerance is independent whatever the rounding."""


def singular_values(A: ArrayLike) -> Array:
    """Singular values (min(N, f),) of a matrix (N, f), largest first."""
    (A,) = check("N f", A=A)
    if 0 in A.shape:
        return np.zeros(0)
    return np.asarray(np.linalg.svd(triangle(A), compute_uv=False), dtype=np.float64)


def triangle(A: Array) -> Array:
    """R (f, f) of A = Q R for a tall A (N, f), with the same singular values; else A itself."""
    return np.asarray(np.linalg.qr(A, mode="r")) if len(A) > A.shape[1] else A


def rank(A: ArrayLike) -> int:
    """Numerical rank of A (N, f): singular values above `RANK_TOLERANCE` times the largest."""
    return count(singular_values(A), RANK_TOLERANCE)


def practical_rank(A: ArrayLike, prior_sd: ArrayLike, *, ratio: float = PRACTICAL_RATIO) -> int:
    """Number of directions whose sd after measuring is below `ratio` times the prior sd.

    Unlike the rank it does not count directions that are observable but hardly seen.

    Parameters
    ----------
    A : (N, f) array
        Whitened Jacobian, columns in any units.
    prior_sd : (f,) array
        Prior standard deviation of each number, in the units of its column.
    ratio : float
        Posterior over prior sd below which a direction counts as learned.

    Notes
    -----
    In units of the prior sd, that after measuring is 1 / sqrt(1 + s^2) along the singular direction
    with singular value s.
    """
    A, prior_sd = check("N f, f", A=A, prior_sd=prior_sd)
    return int(learned(A, prior_sd, np.ones(1), ratio)[0])


def learned(A: Array, prior_sd: Array, factors: Array, ratio: float = PRACTICAL_RATIO) -> Index:
    """`practical_rank` (k,) under priors whose sd is divided by each of some factors (k,)."""
    beyond = singular_values(A * prior_sd) / factors[:, None] > np.sqrt(ratio**-2 - 1)
    return np.asarray(beyond.sum(axis=1), dtype=np.int64)


def count(singular: Array, tolerance: float) -> int:
    """Number of singular values (k,) above `tolerance` times the largest."""
    return int((singular > tolerance * singular[0]).sum()) if singular.size else 0


class Kept(NamedTuple):
    """Columns kept, in the order they were offered, and all columns in terms of them."""

    places: list[int]
    coordinates: Array  # (p, f) scaled
    silent: Index  # columns of no size


def choose_columns(A: Array, order: Sequence[int]) -> Kept:
    """Keep columns by Gram-Schmidt in the given order, and express all columns in the kept ones."""
    size = np.linalg.norm(A, axis=0)
    silent = np.flatnonzero(size <= RANK_TOLERANCE * size.max())
    if not len(silent) and len(A) == A.shape[1]:
        # where each is plainly told apart, one triangle proves it
        rests = np.abs(np.diagonal(np.linalg.qr(A[:, order], mode="r")))
        if (rests > PLAIN * KEEP_TOLERANCE * size[order]).all():
            return Kept(list(order), np.eye(len(order)), silent)
    basis = np.zeros((A.shape[0], min(A.shape)))
    kept: list[int] = []
    out = {*silent.tolist()}
    for k in order:
        if size[k] == 0 or k in out or len(kept) == basis.shape[1]:
            continue
        rest = A[:, k] / size[k]
        Q = basis[:, : len(kept)]
        # twice: once leaves rounding of the size of the column
        for _ in range(2):
            rest = rest - Q @ (Q.T @ rest)
        length = sqrt(rest @ rest)
        if length > KEEP_TOLERANCE:
            basis[:, len(kept)] = rest / length
            kept.append(k)
    Q = basis[:, : len(kept)]
    C = Q.T @ A
    coordinates = np.zeros((len(kept), A.shape[1]))
    if kept:
        coordinates[:] = np.linalg.solve(C[:, kept], C)
    coordinates[:, silent] = 0.0
    return Kept(kept, coordinates, silent)
