"""Rank: how many directions a measurement determines, and how many of them beyond the prior."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check

RANK_TOLERANCE = 1e-9
"""Singular values above this part of the largest count (TX60: the gap is from 0.19 to 1e-15)."""
PRACTICAL_RATIO = 0.5
"""A direction is learned if measuring brings its sd below this part of its prior sd."""
KEEP_TOLERANCE = 1e-6
"""A column is kept when more than this part of it lies outside the columns already kept."""


def singular_values(A: ArrayLike) -> Array:
    """Singular values (min(N, f),) of a matrix (N, f), largest first."""
    (A,) = check("N f", A=A)
    if 0 in A.shape:
        return np.zeros(0)
    return np.asarray(np.linalg.svd(triangle(A), compute_uv=False), dtype=np.float64)


def triangle(A: Array) -> Array:
    """R (f, f) of A = Q R for a tall A (N, f), with the same singular values; else A itself."""
    return np.asarray(np.linalg.qr(A, mode="r")) if len(A) > A.shape[1] else A


def rank(A: ArrayLike, *, tolerance: float = RANK_TOLERANCE) -> int:
    """Numerical rank of A (N, f): singular values above `tolerance` times the largest."""
    return count(singular_values(A), tolerance)


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
