"""V and G of the whole uncertainty: noise, and error sources that all readings have in common."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.information.criteria.base import Certifiable, Move, Pool
from calib.information.criteria.g import WORST, G, g_of
from calib.information.criteria.lazy import SLACK, best_first, best_of_all, fresh_swaps
from calib.information.criteria.linear import Variance, halves, v_of
from calib.information.criteria.whitened import (
    CHUNK,
    eigenvalues,
    identity_plus,
    rounding_of_rest,
    sound,
    transpose,
    whitener,
)
from calib.information.goals import Goals


@dataclass(frozen=True, slots=True, eq=False)
class Total(Variance):
    """Value minus the largest tr(J_t M^-1 J_t') + |J_t M^-1 K|^2 over goals t; figure its root [m].

    Blocks [A_j, B_j] have k columns more than the goal has numbers: the whitened effect of k inputs
    common to all readings, per standard deviation of each. Sums of their products contain
    M = sum A_j'A_j and K = sum A_j'B_j, and M^-1 K is the error that a unit of each input causes in
    weighted least squares, which ignores the inputs. Adding a pose can increase the whole.

    No linear estimate is better than one that finds the inputs too, from their prior: its V or G,
    of the same products with a unit precision of each input, bounds this one. Adding a pose changes
    M^-1 K by M^-1 A'(I + A M^-1 A')^-1 (B - A M^-1 K).

    References
    ----------
    Box & Draper 1959 (designs for variance and bias together); Gauss and Markov for the bound.
    """

    rows: Array
    """(g, c, p) Jacobian of each goal [m]; for the mean, of all goal poses as one goal."""
    eased: Certifiable
    """V or G of an estimate that finds the inputs too; for p + k numbers."""
    noise: Certifiable
    """V or G of the noise alone; for p numbers."""

    slack: ClassVar[float] = 10.0

    @property
    def n_numbers(self) -> int | None:
        """Numbers of the goal plus inputs, p + k."""
        return self.eased.n_numbers

    def value(self, M: Array) -> Array:
        """Minus the largest whole variance (...,)."""
        return np.asarray(-self.wholes(M).max(-1))

    def wholes(self, M: Array) -> Array:
        """Whole variance (..., g) of each goal [m^2]; inf where M is singular."""
        g, c, p = self.rows.shape
        N, K, F = M[..., :p, :p], M[..., :p, p:], self.rows.reshape(-1, p).T
        F = np.broadcast_to(F, (*K.shape[:-1], g * c))
        # both from one factor of N: what it finds singular is so for both
        Y, X = np.split(halves(N, np.concatenate([F, K], axis=-1)), [g * c], axis=-1)
        good = np.isfinite(Y[..., 0, 0])[..., None]
        moved = transpose(np.where(good[..., None], X, 0.0)) @ np.where(good[..., None], Y, 0.0)
        noise = np.einsum("...ik,...ik->...k", Y, Y)
        whole = np.where(good, noise + (moved**2).sum(-2), np.inf)
        return np.asarray(whole.reshape(*whole.shape[:-1], g, -1).sum(-1))

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,), of either sign."""
        return self._values_after(M, blocks, 1.0, self.rows) - self.value(M)

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,), of either sign; -inf where M becomes singular."""
        return self._values_after(M, blocks, -1.0, self.rows) - self.value(M)

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N), each from its own matrix."""
        return fresh_swaps(self, M, leaving, entering)

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition; with many goals, tried in the order of its effect on the worst few."""
        now = self.wholes(M)
        worst = np.argsort(-now, kind="stable")[:WORST]
        upper = self._values_after(M, pool.blocks, 1.0, self.rows[worst])
        upper = np.where(allowed, upper, -np.inf)
        if len(worst) == len(now):
            return best_of_all(upper + now.max())

        def exact(pick: Index) -> Array:
            return self._values_after(M, pool.blocks[pick], 1.0, self.rows)

        place, value, evaluated = best_first(upper * (1 - SLACK), exact, floor=floor)
        return Move(place, value + float(now.max()), evaluated)

    def value_bounded(self, M: Array) -> Array:
        """Value of the eased criterion."""
        return self.eased.value(M)

    def dual(self, M: Array, sharpness: float) -> Array:
        """Dual matrix of the eased criterion."""
        return self.eased.dual(M, sharpness)

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """Ceiling of the eased criterion, whose value is never below this one."""
        return self.eased.ceiling(M, S, top)

    def exponent(self, sharpness: float) -> float:
        """Exponent of the eased criterion."""
        return self.eased.exponent(sharpness)

    def _values_after(self, M: Array, blocks: Array, sign: float, rows: Array) -> Array:
        """Values (N,) over goals of some rows (g, c, p), after adding or dropping each block."""
        g, c, p = rows.shape
        F, K, k = rows.reshape(-1, p).T, M[:p, p:], M.shape[1] - p
        W = whitener(M[:p, :p])
        half, PK = W.T @ F, W @ (W.T @ K)
        noise, moved = (half**2).sum(axis=0), half.T @ (W.T @ K)
        # [A, B] to E = A M^-1 F, R = B - A M^-1 K and Z = A W, in one product
        onto = np.block([[W @ half, -PK, W], [np.zeros((k, g * c)), np.eye(k), np.zeros((k, p))]])
        out = np.empty(len(blocks))
        step = max(CHUNK // max(g // WORST, 1), 1)
        for start in range(0, len(blocks), step):
            some = blocks[start : start + step]
            n, r, _ = some.shape
            product = (some.reshape(n * r, -1) @ onto).reshape(n, r, -1)
            E, R, Z = np.split(product, [g * c, g * c + k], axis=2)
            S = identity_plus(sign * (Z @ transpose(Z)))
            good = np.ones(n, dtype=np.bool_)
            if sign < 0:
                good = sound(eigenvalues(S), rounding_of_rest(M[:p, :p], W, Z))
            Y = np.linalg.solve(np.where(good[:, None, None], S, np.eye(r)), E)
            after = moved + sign * (transpose(Y) @ R)
            whole = noise - sign * (E * Y).sum(axis=1) + (after**2).sum(axis=2)
            whole = whole.reshape(n, g, c).sum(axis=2).max(axis=1)
            out[start : start + step] = np.where(good, -whole, -np.inf)
        return out


@dataclass(frozen=True, slots=True, eq=False)
class TotalV(Total):
    """Whole uncertainty, mean over the goal poses."""

    sharpness: ClassVar[tuple[float, ...]] = (1.0,)


@dataclass(frozen=True, slots=True, eq=False)
class TotalG(Total):
    """Whole uncertainty of the worst goal pose."""

    sharpness: ClassVar[tuple[float, ...]] = G.sharpness


def total_v(goals: Goals, inputs: int, name: str = "V") -> TotalV:
    """V of the whole uncertainty, for a goal and `inputs` error sources common to all readings."""
    noise = v_of(goals, name)
    assert noise.root is not None
    return TotalV(name, frozen(noise.root.T[None]), v_of(_wide(goals, inputs), name), noise)


def total_g(goals: Goals, inputs: int, name: str = "G") -> TotalG:
    """G of the whole uncertainty, for a goal and `inputs` error sources common to all readings."""
    noise = g_of(goals, name)
    return TotalG(name, noise.rows, g_of(_wide(goals, inputs), name), noise)


def _wide(goals: Goals, inputs: int) -> Goals:
    """The goal with columns of zeros for the inputs, which do not move the tool."""
    none = np.zeros((*goals.rows.shape[:2], inputs))
    return Goals(np.concatenate([goals.rows, none], axis=2), goals.weights)
