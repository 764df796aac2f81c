"""Parameter covariances, and random steps of the parameters drawn from them."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse


def matrix_row_weights(n_poses: int) -> Array:
    """Weights (m, 6, 6) on rows [dp (m); dr (rad)] that equal twelve unweighted rows in mm and rad.

    The paper's rows satisfy H'H = 2 Jw'Jw + Jp'Jp with Jp in mm: a milliradian counts like 1.4 um.
    Where the noise is 17.5 um and 0.011 deg, orientation gets 65 times too little root weight.

    References
    ----------
    Wen et al. 2022, eq. (4).
    """
    return np.broadcast_to(np.diag([1e6, 1e6, 1e6, 2.0, 2.0, 2.0]), (n_poses, 6, 6))


def common_input_covariance(F: Array, sensitivity: Array, covariance: Array) -> Array:
    """Covariance (f, f) that inputs shared by all rows add: type B, not reduced by more poses.

    Parameters
    ----------
    F : (m, f, r) array
        How the estimate follows each row, as `type_b.estimator_maps` gives it.
    sensitivity : (m, r, k) array
        B: change of each row per unit of each of k inputs (target offset, range offset, ...).
    covariance : (k, k) array
        S: covariance of these inputs.

    References
    ----------
    F (B S B') F'; JCGM 100:2008, 5.2.
    """
    F, sensitivity, covariance = check(
        "m f r, m r k, k k", F=F, sensitivity=sensitivity, covariance=covariance
    )
    G = np.einsum("mfr,mrk->fk", F, sensitivity) @ covariance_factor(covariance)
    return frozen(G @ G.T)


def standard_uncertainty(covariance: Array) -> Array:
    """Square root of the diagonal (..., f) [m or rad]."""
    return np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))


def correlation(covariance: Array) -> Array:
    """Correlation matrix (f, f); a number without uncertainty is correlated with itself only."""
    u = standard_uncertainty(covariance)
    u = np.where(u > 0, u, 1.0)
    rho = covariance / np.outer(u, u)
    np.fill_diagonal(rho, 1.0)
    return frozen(rho)


def covariance_factor(covariance: Array) -> Array:
    """L (f, f) with L L' = covariance, also where numbers are fixed or exactly dependent.

    Lower triangular (Cholesky) for the numbers with a variance; zero for the others.

    Raises
    ------
    InputError
        If the matrix is not symmetric, or has a direction of negative variance.
    """
    (covariance,) = check("f f", covariance=covariance)
    variance = np.diagonal(covariance)
    u = np.sqrt(np.abs(variance))
    stray = covariance[variance == 0].any(axis=1)
    if stray.any():
        i = int(np.flatnonzero(variance == 0)[stray][0])
        message = f"covariance[{i}] is correlated but has no variance"
        allowed = "zero rows and columns for fixed numbers"
        raise refuse("covariance", 0.0, allowed, code="A3", message=message)
    lopsided = np.abs(covariance - covariance.T) > 1e-9 * np.outer(u, u)
    if lopsided.any():
        i, j = (int(k) for k in np.argwhere(lopsided)[0])
        gap = float(covariance[i, j] - covariance[j, i])
        message = f"covariance[{i}, {j}] and [{j}, {i}] differ"
        raise refuse("covariance", gap, "a symmetric matrix", code="A3", message=message)
    moving = np.flatnonzero(variance)
    L = np.zeros_like(covariance)
    if not len(moving):
        return L
    own = np.ix_(moving, moving)
    scaled = covariance[own] / np.outer(u[moving], u[moving])
    scaled = (scaled + scaled.T) / 2
    lowest = float(np.linalg.eigvalsh(scaled)[0])
    if lowest < -1e-9 or (variance < 0).any():
        message = f"covariance has the scaled eigenvalue {lowest:.3g}"
        allowed = "no negative variance in any direction"
        raise refuse("covariance", lowest, allowed, code="A3", message=message)
    if lowest > 1e-13:
        root = np.linalg.cholesky(scaled)
    else:  # exactly dependent numbers: semidefinite
        values, vectors = np.linalg.eigh(scaled)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
    L[own] = u[moving, None] * root
    return L


def independent_draws(standard: ArrayLike, draws: int, rng: np.random.Generator) -> Array:
    """Steps (M, P): every number normal about zero with its own u (P,), no correlation [m, rad]."""
    (standard,) = check("k", standard=standard)
    if (standard < 0).any():
        message = f"standard[{int(np.argmin(standard))}] is negative"
        least = float(standard.min())
        raise refuse("standard", least, "zero (fixed) or more", code="A3", message=message)
    moving = np.flatnonzero(standard)
    steps = np.zeros((checked(draws), len(standard)))
    steps[:, moving] = rng.standard_normal((draws, len(moving))) * standard[moving]
    return steps


def correlated_draws(covariance: ArrayLike, draws: int, rng: np.random.Generator) -> Array:
    """Steps (M, P), normal about zero with the full covariance (P, P) [m, rad]."""
    return drawn(covariance_factor(np.asarray(covariance, dtype=np.float64)), checked(draws), rng)


def drawn(L: Array, draws: int, rng: np.random.Generator) -> Array:
    """The same by a factor L (P, P) of the covariance."""
    moving = np.flatnonzero(L.any(axis=1))
    steps = np.zeros((draws, len(L)))
    steps[:, moving] = rng.standard_normal((draws, len(moving))) @ L[np.ix_(moving, moving)].T
    return steps


def checked(draws: int) -> int:
    """At least two draws: a standard deviation needs them."""
    if draws < 2:
        raise refuse("draws", draws, "2 or more", code="A3")
    return draws
