"""Linear algebra shared by D, A, V and G: candidate rows whitened by the information M."""

import numpy as np
from scipy.linalg.lapack import dtrtri

from calib.arrays import Array, Bool

CHUNK = 4096
"""Poses handled at once, so that intermediate rows stay in the cache."""


def whitener(M: Array) -> Array:
    """Upper triangular W (p, p) with W W' = M^-1."""
    # the factor is the inverse wanted here, and is triangular: no solver of scipy's is as quick
    return np.asarray(dtrtri(np.linalg.cholesky(M), lower=1)[0].T, dtype=np.float64)


def rounding_of_rest(M: Array, W: Array, Z: Array) -> Array:
    """Largest errors (N,) of an eigenvalue of I - Z Z' for rows Z = B W that M = (W W')^-1 counts.

    What of M is left without these rows stands in the others, and so do its rounding errors: a
    direction that only they determine seems to keep some of its information. Weak directions of M
    that the rows B (N, r, p) do not see have little part in it.

    References
    ----------
    The factor of M is that of M + E, |E_ij| <= c eps sqrt(M_ii M_jj) (Higham 2002, theorem 10.3).
    To first order K = B M^-1 B' errs by B M^-1 E M^-1 B', and so its eigenvalues by at most
    c eps |B M^-1 D|^2, D^2 = diag M. The product B W, |B| <= D, adds c eps |D W|, and I - K a few
    eps. Of 39,000 deletions and as many swaps that leave nothing, with p to 36 and condition to
    1e14, none left more than c = 4.2.
    """
    scaled = W * np.sqrt(np.diagonal(M))[:, None]
    seen = ((Z @ scaled.T) ** 2).sum(axis=(1, 2))
    return np.asarray(8 * np.finfo(np.float64).eps * (1.0 + np.linalg.norm(scaled) + seen))


def squares_along(pages: Array, H: Array) -> Array:
    """tr(H' B_j'B_j H) (N,) of pages (r, N, p) along the columns of H (p, k)."""
    found = np.empty(pages.shape[1])
    for start in range(0, len(found), CHUNK):
        Z = pages[:, start : start + CHUNK] @ H
        found[start : start + CHUNK] = np.einsum("rjk,rjk->j", Z, Z)
    return found


def identity_plus(K: Array) -> Array:
    """I + K of small matrices (..., r, r)."""
    return np.asarray(K + np.eye(K.shape[-1]))


def transpose(X: Array) -> Array:
    """Last two axes exchanged."""
    return np.asarray(np.swapaxes(X, -1, -2))


def log_det(S: Array) -> Array:
    """Log det (...,) of symmetric matrices (..., r, r); -inf where it is not positive."""
    sign, value = np.linalg.slogdet(S)
    return np.where(sign > 0, value, -np.inf)


def log_det_of_rest(S: Array, rounding: Array) -> Array:
    """Log det (N,) of I - K after deletions (N, r, r); -inf where it is singular to `rounding`.

    The rounding (N,) or () of the eigenvalues is that of `rounding_of_rest`.

    Two eigenvalues that rounding has made negative would give a positive determinant. No eigenvalue
    is above one, so that only a determinant below the first bad eigenvalue is in doubt.
    """
    value, rounding = log_det(S), np.broadcast_to(rounding, len(S))
    doubtful = value < np.log(4 * rounding)
    if doubtful.any():
        good = sound(eigenvalues(S[doubtful]), rounding[doubtful])
        value[doubtful] = np.where(good, value[doubtful], -np.inf)
    return value


def eigenvalues(S: Array) -> Array:
    """Eigenvalues (..., r) of symmetric matrices (..., r, r), ascending."""
    return np.asarray(np.linalg.eigvalsh(S), dtype=np.float64)


def sound(w: Array, rounding: Array | float) -> Bool:
    """Whether the eigenvalues (N, r), ascending, of I - K are above rounding (N,) or ().

    If not, the pose alone determines some direction, and M is singular without it.
    """
    return np.asarray(w[:, 0] > rounding * np.maximum(w[:, -1], 1.0), dtype=bool)


def grams(blocks: Array) -> Array:
    """B_j'B_j (N, p, p) of blocks (N, r, p)."""
    return np.asarray(transpose(blocks) @ blocks)


def sandwich(S: Array, Y: Array, rounding: Array | float = 0.0) -> Array:
    """tr(Y' S^-1 Y) (N,) of small symmetric S (N, r, r) and Y (N, r, k); inf if S is not sound."""
    good = sound(eigenvalues(S), rounding)
    safe = np.where(good[:, None, None], S, np.eye(S.shape[-1]))
    value = np.einsum("jrk,jrk->j", Y, np.linalg.solve(safe, Y))
    return np.where(good, value, np.inf)


def relative_rounding(M: Array, *, any_units: bool = True) -> float:
    """Relative rounding error of the smallest eigenvalue of M (p, p).

    With `any_units`, of M scaled to a unit diagonal, for criteria that do not depend on units.
    """
    if any_units:
        scale = np.sqrt(np.maximum(np.diagonal(M), np.finfo(np.float64).tiny))
        M = M / scale / scale[:, None]
    w = eigenvalues(M)
    least = np.finfo(np.float64).eps * w[-1]
    return float(4 * len(w) * least / max(float(w[0]), least))


def eigenvalue_rounding(w: Array, squares: Array) -> Array:
    """Rounding error (N,) of the eigenvalues of M + B_j'B_j, by which bounds are widened.

    w (p,) are the eigenvalues of M, ascending; squares (N,) the sums of squares of the rows B_j.
    """
    return np.asarray(4 * len(w) * np.finfo(np.float64).eps * (w[-1] + squares))
