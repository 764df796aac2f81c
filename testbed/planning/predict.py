"""What a pose set will be worth: the goal's uncertainty from the information it gathers."""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.arrays import Array
from calib.design.blocks import information, sees_all
from calib.geometry.parameters import Parameters
from testbed.laboratory.station import point_u


def covariance_of(M: Array, parameters: Parameters) -> Array:
    """Covariance (p, p) [m, rad] of the free numbers from information M (p, p) in scaled units."""
    C = cho_solve(cho_factor(M), np.eye(len(M)))
    scale = parameters.free_scale
    return np.asarray((C + C.T) / 2 * np.outer(scale, scale))


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
