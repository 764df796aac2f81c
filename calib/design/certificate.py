"""A certificate for O1: how close a pose set is to the best possible, whatever found it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from calib.arrays import Array
from calib.design.blocks import checked_blocks, information

ITERATIONS = 200
PATIENCE = 40
ENOUGH = 1e-4
"""Stop when log det / p of the bound falls by less than this in `PATIENCE` iterations."""


@dataclass(frozen=True, slots=True, eq=False)
class Certificate:
    """What no set of the same size can exceed, and where this one stands."""

    log_det: float
    """log det M of the set."""
    bound: float
    """No set of this size, without repeats, has a larger log det M."""
    d_efficiency: float
    """exp((log_det - bound) / p): certified part of the best possible det^(1/p)."""
    o1_efficiency: float
    """Its square root: certified part of the best possible O1."""
    iterations: int
    """Steps of the relaxation."""


def o1_certificate(
    blocks: ArrayLike, indices: ArrayLike, *, iterations: int = ITERATIONS
) -> Certificate:
    """Certify the O1 (D-optimality) of a pose set against every other set of its size.

    Weights w on the pool replace the set; at any of them log det is concave, so its tangent bounds
    the log det of every set: log det M* <= log det M(w) + p log(sum of the m largest d_j / p) with
    d_j = tr(M(w)^-1 B_j'B_j). The weights follow w_j <- w_j d_j m / p and the least bound is kept.

    Parameters
    ----------
    blocks : (N, r, p) array
        Whitened, scaled rows of each candidate pose.
    indices : (m,) array of int
        The set, without repeats.
    iterations : int
        Most steps of the relaxation; the bound holds after any number of them.

    References
    ----------
    MATH 8.4; Joshi and Boyd 2009.
    """
    chosen = np.unique(np.asarray(indices, dtype=np.int64))
    m = len(chosen)
    blocks = checked_blocks(blocks, m)
    n_pool, r, p = blocks.shape
    rows = blocks.reshape(-1, p)
    weights, bound, recent, steps = np.full(n_pool, m / n_pool), np.inf, np.inf, 0
    for steps in range(1, iterations + 1):
        M = (rows * np.repeat(weights, r)[:, None]).T @ rows
        d = _leverages(M, rows).reshape(n_pool, r).sum(1)
        top = np.partition(d, n_pool - m)[n_pool - m :].sum()
        bound = min(bound, float(np.linalg.slogdet(M)[1] + p * np.log(top / p)))
        if steps % PATIENCE == 0:
            if recent - bound < ENOUGH * p:
                break
            recent = bound
        # no pose counts more than once in a set, so no weight need exceed one
        weights = np.minimum(weights * d * (m / p), 1.0)
        weights *= m / weights.sum()
    log_det = float(np.linalg.slogdet(information(blocks[chosen]))[1])
    efficiency = float(np.exp((log_det - bound) / p))
    return Certificate(log_det, bound, efficiency, float(np.sqrt(efficiency)), steps)


def _leverages(M: Array, rows: Array) -> Array:
    """Leverages a' M^-1 a (n,) of rows a (n, p)."""
    lower = np.linalg.cholesky(M)
    whitener = solve_triangular(lower, np.eye(len(M)), lower=True, check_finite=False)
    Z = rows @ whitener.T
    return np.asarray(np.einsum("ij,ij->i", Z, Z))
