"""Criteria linear in the covariance: A-optimality over parameters, V over tool points."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Certifiable, Move, Pool
from calib.information.criteria.lazy import SLACK, best_first, best_of_all
from calib.information.criteria.whitened import (
    identity_plus,
    relative_rounding,
    rounding_of_rest,
    sandwich,
    squares_along,
    transpose,
    whitener,
)
from calib.information.goals import Goals
from calib.information.observability import IndexName

RISE = 1e-12
"""A set counts as better if its value rises by more than this part: searches must not cycle."""


@dataclass(frozen=True, slots=True, eq=False)
class Variance(Certifiable):
    """A criterion whose value is minus a variance, and whose figure is the root of the variance."""

    unit: ClassVar[str] = "m"
    index: ClassVar[IndexName | None] = None
    larger_is_better: ClassVar[bool] = False

    def figure(self, M: Array, n_poses: int) -> float:
        """Root of the variance."""
        return self.figure_of_value(float(self.value(M)), len(M), n_poses)

    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """Root of minus the value."""
        return float(np.sqrt(-value))

    def rises(self, value: float, before: float) -> bool:
        """Whether the variance decreases by more than rounding."""
        return value > before + RISE * abs(before) or before == -np.inf < value

    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best deletion; all are evaluated."""
        return best_of_all(self.drop(M, blocks))

    def with_rounding(self, bound: float, M: Array) -> float:
        """The bound, brought nearer to zero by the part that rounding may be."""
        return bound * (1 - min(relative_rounding(M), 1.0))

    def efficiency(self, value: float, bound: float, p: int) -> float:
        """Lower bound on the smallest possible figure, relative to this one."""
        return float(np.sqrt(bound / value)) if np.isfinite([bound, value]).all() else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Linear(Variance):
    """Value -tr(C M^-1) for C = F F'; figure sqrt(tr(C M^-1)).

    With K_ij = B_i M^-1 B_j' and Q_ij = B_i M^-1 C M^-1 B_j': adding gains tr[(I + K_jj)^-1 Q_jj],
    dropping loses tr[(I - K_ii)^-1 Q_ii]. With phi = tr(C M^-1) no addition gains more than
    phi t / (phi + t), t = tr Q_jj, because tr(C M*^-1) >= phi^2 / tr(M^-1 C M^-1 M*) for every M*.

    References
    ----------
    Fedorov 1972; the bound is Cauchy-Schwarz's inequality.
    """

    root: Array | None = field(default=None, repr=False)
    """(p, k) F; None for the identity."""

    sharpness: ClassVar[tuple[float, ...]] = (1.0,)

    @property
    def n_numbers(self) -> int | None:
        """Number p of parameters of the goal; None for A, which takes any."""
        return None if self.root is None else len(self.root)

    def value(self, M: Array) -> Array:
        """-tr(C M^-1) (...,); -inf where M is singular."""
        return -variance(M, np.eye(M.shape[-1]) if self.root is None else self.root)

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains tr[(I + K)^-1 Q] (N,)."""
        W = whitener(M)
        Z = blocks @ W
        return sandwich(identity_plus(Z @ transpose(Z)), blocks @ self._half(W))

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains -tr[(I - K)^-1 Q] (k,); -inf where M becomes singular."""
        W = whitener(M)
        Z = blocks @ W
        left = identity_plus(-(Z @ transpose(Z)))
        return -sandwich(left, blocks @ self._half(W), rounding_of_rest(M, W, Z))

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N): those of the addition, and of the deletion from M + B_j'B_j.

        With T = I + K_jj and X = K_ij T^-1, the deletion has I - K_ii + X T X' in place of
        I - K_ii, and rows B_i - X B_j in place of B_i.
        """
        W = whitener(M)
        H = self._half(W)
        Zi, Zj = leaving @ W, entering @ W
        Yi, Yj = leaving @ H, entering @ H
        # the addition
        T = identity_plus(Zj @ transpose(Zj))
        gained = sandwich(T, Yj)
        solved, rows = np.asarray(np.linalg.solve(T, Zj)), np.linalg.solve(T, Yj)
        # the deletion from M with the addition, pair by pair
        left, rounding = identity_plus(-(Zi @ transpose(Zi))), rounding_of_rest(M, W, Zi)
        out = np.empty((len(leaving), len(entering)))
        for i, (Z, Y) in enumerate(zip(Zi, Yi, strict=True)):
            K = Z @ transpose(Zj)
            remains = left[i] + K @ transpose(Z @ transpose(solved))
            out[i] = gained - sandwich(remains, Y - K @ rows, rounding[i])
        return out

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition; candidates are tried in descending order of tr Q."""
        W = whitener(M)
        H = self._half(W)
        phi, t = float(-self.value(M)), squares_along(pool.pages, H)
        upper = np.where(allowed, phi * t / (phi + t) * (1 + SLACK), -np.inf)

        def exact(pick: Index) -> Array:
            Z = pool.blocks[pick] @ W
            return sandwich(identity_plus(Z @ transpose(Z)), pool.blocks[pick] @ H)

        return Move(*best_first(upper, exact, floor=floor + phi))

    def _half(self, W: Array) -> Array:
        """H (p, k) with H H' = M^-1 C M^-1, from W W' = M^-1."""
        return np.asarray(W @ (W.T if self.root is None else W.T @ self.root))

    def dual(self, M: Array, sharpness: float) -> Array:
        """S = M^-1 C M^-1."""
        H = self._half(whitener(M))
        return H @ H.T

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """-phi^2 / top."""
        return -(float(self.value(M)) ** 2) / top

    def exponent(self, sharpness: float) -> float:
        """One half: weights are multiplied by the root of tr(S B_j'B_j)."""
        return 0.5


def variance(M: Array, F: Array) -> Array:
    """tr(F' M^-1 F) (...,) of information M (..., p, p); inf where M is not positive definite."""
    return np.asarray(forms(M, F).sum(-1))


def forms(M: Array, F: Array) -> Array:
    """Variances f' M^-1 f (..., k) along the columns f of F (p, k); inf where M is singular."""
    Y = halves(M, F)
    return np.asarray(np.einsum("...ik,...ik->...k", Y, Y))


def halves(M: Array, F: Array) -> Array:
    """Y (..., p, k) with Y'Y = F' M^-1 F, for M (..., p, p) and F (..., p, k).

    Its entries are inf where M is not positive definite.
    """
    scale = np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), np.finfo(np.float64).tiny))
    try:
        lower = np.linalg.cholesky(M / (scale[..., :, None] * scale[..., None, :]))
    except np.linalg.LinAlgError:
        if M.ndim == 2:
            return np.full(F.shape, np.inf)
        F = np.broadcast_to(F, (*M.shape[:-1], F.shape[-1]))
        pairs = zip(M.reshape(-1, *M.shape[-2:]), F.reshape(-1, *F.shape[-2:]), strict=True)
        return np.array([halves(*pair) for pair in pairs]).reshape(F.shape)
    return np.asarray(np.linalg.solve(lower, F / scale[..., :, None]))


@dataclass(frozen=True, slots=True, eq=False)
class A(Linear):
    """Value -tr M^-1; figure sqrt(tr M^-1), the standard uncertainty of all parameters together."""

    name: str = "A"


@dataclass(frozen=True, slots=True, eq=False)
class V(Linear):
    """Value -tr(C M^-1), C the mean of J_t'J_t over goal poses; figure the RMS tool-point u [m]."""

    name: str = "V"


def v_of(goals: Goals, name: str = "V") -> V:
    """V for a goal."""
    # C = F F' with as many columns as C has rank
    w, U = np.linalg.eigh(goals.mean)
    kept = w > len(w) * np.finfo(np.float64).eps * w[-1]
    root = U[:, kept] * np.sqrt(w[kept])
    root.setflags(write=False)
    return V(name=name, root=root)
