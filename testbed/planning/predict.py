"""What a pose set will be worth: the goal's uncertainty from the information it gathers."""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.arrays import Array
from calib.design.blocks import information, sees_all
from calib.geometry.parameters import Parameters


def covariance_of(M: Array, parameters: Parameters) -> Array:
    """Covariance (p, p) [m, rad] of the free numbers from information M (p, p) in scaled units."""
    C = cho_solve(cho_factor(M), np.eye(len(M)))
    scale = parameters.free_scale
    return np.asarray((C + C.T) / 2 * np.outer(scale, scale))


def point_u(M: Array, rows: Array) -> Array:
    """3-D standard uncertainty (g,) of the tool point at the goal, from its rows (g, 3, p) [m].

    References
    ----------
    JCGM 102:2011, 6.2: the covariance of a linear function y = J x is J C J'; here C = M^-1, and
    u^2 = tr(J_t M^-1 J_t') adds the variances of the three coordinates.
    """
    lower = np.linalg.cholesky(M)
    g, _, p = rows.shape
    half = np.linalg.solve(lower, rows.reshape(-1, p).T)
    return np.asarray(np.sqrt((half**2).sum(axis=0).reshape(g, 3).sum(axis=1)))


def rms(u: Array, weights: Array) -> float:
    """Weighted root mean square of u (g,) [m]."""
    return float(np.sqrt(weights @ u**2))


def information_of(blocks: Array, prior: Array | None) -> Array:
    """Information (p, p) of poses (m, r, p) and what was known before."""
    M = information(blocks)
    return M if prior is None else np.asarray(M + prior)


def leverages(blocks: Array, M: Array) -> Array:
    """Leverage tr K_jj (N,) of blocks (N, r, p): their weight against information M (p, p)."""
    n, r, p = blocks.shape
    half = np.linalg.solve(np.linalg.cholesky(M), blocks.reshape(-1, p).T)
    return np.asarray((half**2).sum(axis=0).reshape(n, r).sum(axis=1))


def u_while_measuring(blocks: Array, before: Array, rows: Array, weights: Array) -> Array:
    """Goal uncertainty (m,) after each of the poses (m, r, p) in order; nan while it is endless.

    `before` (b, p) are the rows of poses measured already.
    """
    out = np.full(len(blocks), np.nan)
    for k in range(len(blocks)):
        seen = stacked(before, blocks[: k + 1])
        if sees_all(seen):
            out[k] = rms(point_u(seen.T @ seen, rows), weights)
    return out


def stacked(before: Array, blocks: Array) -> Array:
    """Rows (b + m r, p) of what was measured before (b, p) and of poses (m, r, p)."""
    return np.concatenate([before, blocks.reshape(-1, blocks.shape[-1])])
