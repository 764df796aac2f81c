"""Each observation's part in a fit: its leverage, and how far it lies from what the others say."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index, check
from calib.identification.tangent import column_basis

UNCHECKED = 1e-9
"""Eigenvalue of I - H below which no other observation checks that direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Outliers:
    """How each observation fits to all others."""

    score: Array
    """(m,) r'inv(I - H) r of its whitened residual: chi-square if the observation is sound."""
    limit: Array
    """(m,) what a sound one exceeds so rarely that, over all m, it happens in 5 % of tables."""

    @property
    def suspect(self) -> Bool:
        """(m,) observations beyond the limit."""
        return np.asarray(self.score > self.limit)


def leverages(A: ArrayLike, row_of: Index) -> Array:
    """Leverage (m,) of each observation: the sum over all is the number of parameters.

    Parameters
    ----------
    A : (N, f) array
        Whitened Jacobian of the estimated numbers.
    row_of : (N,) array of int
        Observation of each row, as in `Stack`.

    References
    ----------
    tr H_jj, H = A inv(A'A) A'.
    """
    (A,) = check("N f", A=A)
    return np.asarray(np.bincount(row_of, np.square(column_basis(A)).sum(1)), dtype=np.float64)


def outliers(r: ArrayLike, A: ArrayLike, row_of: Index, *, chance: float = 0.05) -> Outliers:
    """Judge each observation by its residual and leverage.

    Parameters
    ----------
    r : (N,) array
        Whitened residual at the end of the fit.
    A : (N, f) array
        Whitened Jacobian of the estimated numbers there.
    row_of : (N,) array of int
        Observation of each row; rows of one observation stand together.
    chance : float
        Chance that a sound table has any suspect at all (Bonferroni).

    References
    ----------
    r_j' inv(I - H_jj) r_j against the chi-square quantile at 1 - chance / m.
    """
    r, A = check("N, N f", r=r, A=A)
    Q = column_basis(A)
    sizes = np.bincount(row_of)
    score, checked = np.zeros(len(sizes)), np.zeros(len(sizes))
    for size in np.unique(sizes[sizes > 0]):
        which = np.flatnonzero(sizes == size)
        rows = np.isin(row_of, which)
        block = Q[rows].reshape(len(which), size, -1)
        freedom, axes = np.linalg.eigh(np.eye(size) - block @ np.swapaxes(block, -1, -2))
        along = (r[rows].reshape(len(which), 1, size) @ axes)[:, 0]
        seen = freedom > UNCHECKED
        score[which] = np.sum(np.where(seen, along**2, 0) / np.where(seen, freedom, 1), axis=1)
        checked[which] = seen.sum(1)
    limit = chdtri(np.maximum(checked, 1), chance / len(sizes))
    return Outliers(score, np.where(checked > 0, limit, np.inf))
