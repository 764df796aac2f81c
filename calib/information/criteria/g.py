"""G-optimality: the largest variance of the tool point over the goal poses."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.information.criteria.base import Move, Pool
from calib.information.criteria.lazy import SLACK, best_first, fresh_swaps
from calib.information.criteria.linear import V, Variance, forms, v_of
from calib.information.criteria.whitened import (
    CHUNK,
    identity_plus,
    rounding_of_rest,
    sound,
    transpose,
    whitener,
)
from calib.information.goals import Goals

WORST = 12
"""Number of goal poses with the largest variance that bound the gain of an addition."""


@dataclass(frozen=True, slots=True, eq=False)
class G(Variance):
    """Value: minus the largest tr(J_t M^-1 J_t') over goal poses t; figure: the root of it [m].

    Adding pose j reduces each variance by tr[(I + K_jj)^-1 Y Y'], Y = B_j M^-1 J_t'. The maximum
    over the few worst goal poses is never above that over all, which bounds the value. The largest
    variance is never below a weighted mean of variances, so every lower bound on tr(C M^-1),
    C = sum of nu_t J_t'J_t, is one on it; at order k, nu_t is proportional to the variance to the
    power k - 1.

    References
    ----------
    Fedorov 1972; the bound for given weights is Cauchy-Schwarz's, as for V.
    """

    name: str = "G"
    rows: Array = field(default_factory=lambda: frozen(np.zeros((0, 3, 0))), repr=False)
    """(g, 3, p) displacement of the tool point per scaled parameter at each goal pose [m]."""

    sharpness: ClassVar[tuple[float, ...]] = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)

    @property
    def n_numbers(self) -> int | None:
        """Number p of parameters of the goal."""
        return int(self.rows.shape[2])

    def mean(self) -> V:
        """V over the same goal poses, equally weighted."""
        return v_of(Goals(self.rows, np.ones(len(self.rows))))

    def variances(self, M: Array) -> Array:
        """Tool-point variances (..., g) [m^2]; inf where M is singular."""
        along = forms(M, self.rows.reshape(-1, M.shape[-1]).T)
        return np.asarray(along.reshape(*along.shape[:-1], -1, 3).sum(-1))

    def value(self, M: Array) -> Array:
        """Minus the largest variance (...,)."""
        return np.asarray(-self.variances(M).max(-1))

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,)."""
        return self._values_after(M, blocks, 1.0, self.variances(M), self.rows) - self.value(M)

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,); -inf where M becomes singular."""
        return self._values_after(M, blocks, -1.0, self.variances(M), self.rows) - self.value(M)

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N), each from its own information matrix."""
        return fresh_swaps(self, M, leaving, entering)

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition; candidates are tried by their effect on the worst goal poses."""
        # bound: the variances after it at the worst goal poses only
        now = self.variances(M)
        worst = np.argsort(-now, kind="stable")[:WORST]
        bound = self._values_after(M, pool.blocks, 1.0, now[worst], self.rows[worst])
        upper = np.where(allowed, bound * (1 - SLACK), -np.inf)

        def exact(pick: Index) -> Array:
            return self._values_after(M, pool.blocks[pick], 1.0, now, self.rows)

        place, value, evaluated = best_first(upper, exact, floor=floor)
        return Move(place, value + float(now.max()), evaluated)

    def dual(self, M: Array, sharpness: float) -> Array:
        """S = M^-1 C M^-1, C weighted as for this order."""
        H = self._mean_root(M, sharpness)
        W = whitener(M)
        S = W @ (W.T @ H)
        return np.asarray(S @ S.T)

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """-phi^2 / top, with phi = tr(C M^-1) = tr(S M)."""
        return -(float(np.einsum("ij,ij->", S, M)) ** 2) / top

    def exponent(self, sharpness: float) -> float:
        """1 / (k + 1)."""
        return 1 / (sharpness + 1)

    def _mean_root(self, M: Array, order: float) -> Array:
        """F (p, 3g) with F F' = sum of nu_t J_t'J_t, where the nu_t sum to one."""
        # weights of order k
        now = self.variances(M)
        share = (now / now.max()) ** (order - 1)
        nu = share / share.sum()
        return np.asarray((self.rows * np.sqrt(nu)[:, None, None]).reshape(-1, M.shape[-1]).T)

    def _values_after(self, M: Array, blocks: Array, sign: float, now: Array, rows: Array) -> Array:
        """Values (N,) over goal poses with rows (g, 3, p), after adding or dropping each block."""
        # F = M^-1 J', for all goal poses at once
        W = whitener(M)
        F = W @ (W.T @ rows.reshape(-1, M.shape[-1]).T)
        out = np.empty(len(blocks))
        step = max(CHUNK // max(len(rows) // WORST, 1), 1)
        for start in range(0, len(blocks), step):
            some = blocks[start : start + step]
            # S = I +- K_jj
            Z = some @ W
            S = identity_plus(sign * (Z @ transpose(Z)))
            # Y with Y'Y = F' B' S^-1 B F
            if sign > 0:
                good = np.ones(len(some), dtype=bool)
                Y = np.linalg.solve(np.linalg.cholesky(S), some) @ F
            else:
                w, U = np.linalg.eigh(S)
                good = sound(w, rounding_of_rest(M, W, Z))
                root = transpose(U) / np.sqrt(np.where(good[:, None], w, 1.0))[:, :, None]
                Y = (root @ some) @ F
            # what each goal pose gains or loses; the worst decides
            change = np.einsum("jrk,jrk->jk", Y, Y).reshape(len(some), -1, 3).sum(-1)
            value = -(now - sign * change).max(-1)
            out[start : start + step] = np.where(good, value, -np.inf)
        return out


def g_of(goals: Goals, name: str = "G") -> G:
    """G for a goal; goal poses with zero weight do not count."""
    return G(name=name, rows=frozen(goals.rows[goals.weights > 0]))
