"""Rank: how many directions a measurement determines, and how many of them beyond the prior."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check

RANK_TOLERANCE = 1e-9
"""A singular value counts above this part of the largest (TX60: the gap is 0.19 to 1e-15)."""
PRACTICAL_RATIO = 0.5
"""A direction is learned when measuring brings its sd below this part of its prior sd."""


def singular_values(A: ArrayLike) -> Array:
    """Singular values (min(N, f),) of a matrix (N, f), largest first."""
    (A,) = check("N f", A=A)
    if 0 in A.shape:
        return np.zeros(0)
    return np.asarray(np.linalg.svd(triangle(A), compute_uv=False), dtype=np.float64)


def triangle(A: Array) -> Array:
    """Upper triangle (f, f) with the singular values and column angles of a tall A (N, f), or A."""
    return np.asarray(np.linalg.qr(A, mode="r")) if len(A) > A.shape[1] else A


def rank(A: ArrayLike, *, tolerance: float = RANK_TOLERANCE) -> int:
    """Number of directions that the columns of A (N, f) span, by relative singular values."""
    return count(singular_values(A), tolerance)


def practical_rank(A: ArrayLike, prior_sd: ArrayLike, *, ratio: float = PRACTICAL_RATIO) -> int:
    """Directions whose standard deviation after measuring is below `ratio` of the prior one.

    Tells structure from usefulness: two singular values of 1e-5 raise the rank, yet teach nothing.

    Parameters
    ----------
    A : (N, f) array
        Whitened Jacobian, columns in any units.
    prior_sd : (f,) array
        Prior standard deviation of each number, in the units of its column.
    ratio : float
        Posterior over prior sd below which a direction counts as learned.

    References
    ----------
    In prior units the posterior sd along a singular direction is 1 / sqrt(1 + sigma^2).
    """
    A, prior_sd = check("N f, f", A=A, prior_sd=prior_sd)
    return int(learned(A, prior_sd, np.ones(1), ratio)[0])


def learned(A: Array, prior_sd: Array, factors: Array, ratio: float = PRACTICAL_RATIO) -> Index:
    """The same (k,) under priors tighter by some factors (k,)."""
    beyond = singular_values(A * prior_sd) / factors[:, None] > np.sqrt(ratio**-2 - 1)
    return np.asarray(beyond.sum(axis=1), dtype=np.int64)


def count(singular: Array, tolerance: float) -> int:
    """Number of singular values (k,) above `tolerance` times the largest."""
    return int((singular > tolerance * singular[0]).sum()) if singular.size else 0
