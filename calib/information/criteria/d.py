"""D-optimality: the volume of the information ellipsoid; its figure is the index O1."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Certifiable, Move, Pool
from calib.information.criteria.lazy import SLACK, best_first, best_of_all
from calib.information.criteria.whitened import (
    identity_plus,
    log_det,
    log_det_of_rest,
    relative_rounding,
    rounding_of_rest,
    squares_along,
    transpose,
    whitener,
)
from calib.information.observability import IndexName

RISE = 5e-11
"""A set counts as better if log det rises by more than this: 1e-12 of O1 for two dozen numbers."""
ROUNDING = 1e-14
"""Rounding of the logarithm of a determinant near one."""


@dataclass(frozen=True, slots=True, eq=False)
class D(Certifiable):
    """Value log det M; figure O1 = exp(log det M / 2p) / sqrt(poses).

    With K_ij = B_i M^-1 B_j': adding gains log det(I + K_jj), dropping log det(I - K_ii), a swap
    log det(I + K_jj) + log det(I - K_ii + K_ij (I + K_jj)^-1 K_ji), even where dropping alone
    would make M singular. An addition gains at most r log(1 + tr K_jj / r), by the inequality of
    arithmetic and geometric means.

    References
    ----------
    Fedorov 1972; the bound on all sets, log det M* <= log det M + p log(tr(M^-1 M*) / p), follows
    from the same inequality (Joshi and Boyd 2009).
    """

    name: str = "D"

    unit: ClassVar[str] = "1"
    index: ClassVar[IndexName | None] = "O1"
    larger_is_better: ClassVar[bool] = True
    sharpness: ClassVar[tuple[float, ...]] = (1.0,)

    def value(self, M: Array) -> Array:
        """Log det M (...,)."""
        return log_det(M)

    def figure(self, M: Array, n_poses: int) -> float:
        """O1, per pose."""
        return self.figure_of_value(float(log_det(M)), len(M), n_poses)

    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """O1 = exp(value / 2p) / sqrt(poses)."""
        return float(np.exp(value / (2 * p)) / np.sqrt(n_poses))

    def rises(self, value: float, before: float) -> bool:
        """Whether log det is higher by more than rounding."""
        return value > before + RISE

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains log det(I + K_jj) (N,)."""
        Z = blocks @ whitener(M)
        return log_det(identity_plus(Z @ transpose(Z)))

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains log det(I - K_ii) (k,); -inf where M becomes singular."""
        W = whitener(M)
        Z = blocks @ W
        return log_det_of_rest(identity_plus(-(Z @ transpose(Z))), rounding_of_rest(M, W, Z))

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N) by the matrix determinant lemma for both changes at once."""
        W = whitener(M)
        Zi, Zj = leaving @ W, entering @ W
        T = identity_plus(Zj @ transpose(Zj))
        # rows of the pool whitened by what they bring themselves: K_ij T^-1 K_ji = X X'
        Zj = np.linalg.solve(np.linalg.cholesky(T), Zj)
        gained = log_det(T)
        # log det(I - K_ii + K_ij T^-1 K_ji), pair by pair
        left, rounding = identity_plus(-(Zi @ transpose(Zi))), rounding_of_rest(M, W, Zi)
        out = np.empty((len(leaving), len(entering)))
        for i, Z in enumerate(Zi):
            X = Z @ transpose(Zj)
            out[i] = gained + log_det_of_rest(left[i] + X @ transpose(X), rounding[i])
        return out

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition; candidates are tried in descending order of r log(1 + tr K / r)."""
        W, r = whitener(M), len(pool.pages)
        trace = squares_along(pool.pages, W)
        upper = np.where(allowed, r * np.log1p(trace / r) * (1 + SLACK) + ROUNDING, -np.inf)

        def exact(pick: Index) -> Array:
            Z = pool.blocks[pick] @ W
            return log_det(identity_plus(Z @ transpose(Z)))

        if np.isfinite(floor):
            floor -= float(log_det(M))
        return Move(*best_first(upper, exact, floor=floor))

    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best deletion; all are evaluated."""
        return best_of_all(self.drop(M, blocks))

    def dual(self, M: Array, sharpness: float) -> Array:
        """S = M^-1."""
        W = whitener(M)
        return W @ W.T

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """Log det M + p log(top / p)."""
        return float(log_det(M) + len(M) * np.log(top / len(M)))

    def with_rounding(self, bound: float, M: Array) -> float:
        """The bound plus the rounding of a logarithm of M's smallest eigenvalue."""
        return bound + relative_rounding(M)

    def exponent(self, sharpness: float) -> float:
        """One: weights are multiplied by their leverage tr(K_jj)."""
        return 1.0

    def efficiency(self, value: float, bound: float, p: int) -> float:
        """Lower bound on det^(1/p) relative to the best possible."""
        return float(np.exp((value - bound) / p))
