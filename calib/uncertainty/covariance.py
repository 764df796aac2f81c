"""Parameter covariances, and random steps of the parameters drawn from them."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from calib.arrays import Array, check, frozen
from calib.errors import refuse

RANK_TOLERANCE = 1e-9
"""Smallest singular value of the scaled columns that still counts, relative to the largest."""


def matrix_row_weights(n_poses: int) -> Array:
    """Weights (m, 6, 6) on rows [dp (m); dr (rad)] that equal twelve unweighted rows in mm and rad.

    The paper's rows satisfy H'H = 2 Jw'Jw + Jp'Jp with Jp in mm: a milliradian counts like 1.4 um.
    Where the noise is 17.5 um and 0.011 deg, orientation gets 65 times too little root weight.

    References
    ----------
    Wen et al. 2022, eq. (4).
    """
    return np.broadcast_to(np.diag([1e6, 1e6, 1e6, 2.0, 2.0, 2.0]), (n_poses, 6, 6))


def estimator(J: Array, weight: Array, *, prior_precision: Array | None = None) -> Array:
    """Map F (m, f, r) from raw residual rows to the estimate: dx = sum_j F_j r_j.

    Parameters
    ----------
    J : (m, r, f) array
        Jacobian of the prediction, raw rows [m, rad], free numbers only [m, rad].
    weight : (m, r, r) array
        Weight of each block of rows, positive definite [1/m^2, 1/(m rad), 1/rad^2].
    prior_precision : (f, f) array, optional
        Lambda0, inverse covariance of what is known beforehand.

    Raises
    ------
    InputError
        If the rows cannot tell all f numbers apart.

    References
    ----------
    F_j = inv(sum J'WJ + Lambda0) J_j' W_j, through one QR factorization of the scaled rows.
    """
    return _maps(J, weight, prior_precision)[0]


def _maps(J: Array, weight: Array, prior_precision: Array | None) -> tuple[Array, Array]:
    """F (m, f, r) of the raw rows, and the same (f, k) of the k whitened prior rows."""
    J, weight = check("m r f, m r r", J=J, weight=weight)
    m, r, f = J.shape
    root = np.swapaxes(_cholesky(weight, "weight"), -1, -2)
    rows = (root @ J).reshape(m * r, f)
    if prior_precision is not None:
        (prior_precision,) = check(f"{f} {f}", prior_precision=prior_precision)
        rows = np.concatenate([rows, covariance_factor(prior_precision).T])
    scale = np.linalg.norm(rows, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    Q, R = np.linalg.qr(rows / scale)
    singular = np.linalg.svd(R, compute_uv=False)
    if len(singular) < f or singular[-1] <= RANK_TOLERANCE * singular[0]:
        rank = int((singular > RANK_TOLERANCE * singular[0]).sum())
        message = f"the rows have rank {rank}, with {f} free numbers"
        fix = "reduce the free numbers to the identifiable ones, or give a prior"
        raise refuse("J", rank, f"rank {f}", code="A5", message=message, fix=fix)
    F = solve_triangular(R, Q.T) / scale[:, None]
    measured, prior = F[:, : m * r], F[:, m * r :]
    return np.moveaxis(measured.reshape(f, m, r), 0, 1) @ root, prior


def sandwich(
    J: Array, weight: Array, covariance: Array, *, prior_precision: Array | None = None
) -> Array:
    """True covariance (f, f) of a weighted least-squares estimate, whatever its weights.

    Parameters
    ----------
    J : (m, r, f) array
        Jacobian of the prediction, raw rows [m, rad], free numbers only.
    weight : (m, r, r) array
        Weights that the estimator used.
    covariance : (m, r, r) array
        Covariance the rows really have [m^2, m rad, rad^2].
    prior_precision : (f, f) array, optional
        Lambda0 of the estimator; its own scatter counts too, so that the result is
        inv(J'WJ + Lambda0) when the weights are the inverse covariances.

    References
    ----------
    C = inv(H) (J'W S WJ + Lambda0) inv(H), H = J'WJ + Lambda0.
    """
    (covariance,) = check("m r r", covariance=covariance)
    if covariance.shape != weight.shape:
        allowed = f"that of the weights, {weight.shape}"
        message = f"covariance has shape {covariance.shape}"
        raise refuse("covariance", covariance.shape, allowed, code="A1", message=message)
    F, prior = _maps(J, weight, prior_precision)
    m, f, r = F.shape
    # C = (F L)(F L)' stays symmetric and positive
    columns = np.moveaxis(F @ _cholesky(covariance, "covariance"), 1, 0).reshape(f, m * r)
    C = columns @ columns.T + prior @ prior.T
    return frozen((C + C.T) / 2)


def common_input_covariance(F: Array, sensitivity: Array, covariance: Array) -> Array:
    """Covariance (f, f) that inputs shared by all rows add: type B, not reduced by more poses.

    Parameters
    ----------
    F : (m, f, r) array
        From `estimator`.
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


def _cholesky(blocks: Array, name: str) -> Array:
    """Cholesky factors (m, r, r); a block that has none is named."""
    try:
        return np.asarray(np.linalg.cholesky(blocks))
    except np.linalg.LinAlgError:
        lowest = np.linalg.eigvalsh(blocks)[:, 0]
        row = int(np.argmin(lowest))
        message = f"{name}[{row}] has the eigenvalue {lowest[row]:.3g}"
        allowed = "symmetric positive definite blocks"
        raise refuse(name, float(lowest[row]), allowed, code="A3", message=message) from None


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
