"""Criteria of the eigenvalues alone: E (O3), O2, O4 and O5, with their proven bounds."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Certifiable, Criterion, Move, Pool
from calib.information.criteria.lazy import best_first, fresh_swaps
from calib.information.criteria.whitened import (
    eigenvalue_rounding,
    eigenvalues,
    grams,
    relative_rounding,
)
from calib.information.observability import IndexName

Screen = Callable[[Index, float], Bool]
"""Which of some candidates may reach a score."""
RISE = 1e-12
"""A set counts as better if its value rises by more than this part: searches must not cycle."""


class Spectral(Criterion):
    """A criterion of the eigenvalues of M; gains are differences of two values."""

    __slots__ = ()

    unit: ClassVar[str] = "1"
    larger_is_better: ClassVar[bool] = True

    @abstractmethod
    def of_eigenvalues(self, w: Array) -> Array:
        """Value (...,) of eigenvalues (..., p), ascending."""

    @abstractmethod
    def bounds(self, w: Array, V: Array, pool: Pool, sign: float) -> tuple[Array, Screen | None]:
        """Upper bounds (N,) on the value of M + sign B'B for each block, and a second screen.

        w (p,) and V (p, p) are eigenvalues and eigenvectors of M = V diag(w) V'.
        """

    def value(self, M: Array) -> Array:
        """Value (...,) from the eigenvalues."""
        return self.of_eigenvalues(eigenvalues(M))

    def rises(self, value: float, before: float) -> bool:
        """Whether the value is higher by more than rounding."""
        return value > before + RISE * abs(before)

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,), each from its own eigenvalues."""
        return self.value(M + grams(blocks)) - self.value(M)

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,), each from its own eigenvalues."""
        return self.value(M - grams(blocks)) - self.value(M)

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N), each from its own eigenvalues."""
        return fresh_swaps(self, M, leaving, entering)

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition; candidates are tried in the order of their bounds."""
        return self._best(M, pool, 1.0, allowed, floor)

    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best deletion; candidates are tried in the order of their bounds."""
        return self._best(M, Pool(blocks), -1.0, np.ones(len(blocks), dtype=bool), -np.inf)

    def _best(self, M: Array, pool: Pool, sign: float, allowed: Bool, floor: float) -> Move:
        """Best of M + sign B'B over the allowed blocks of a pool."""
        w, V = np.linalg.eigh(M)
        upper, may_win = self.bounds(w, V, pool, sign)

        def exact(pick: Index) -> Array:
            return self.value(M + sign * grams(pool.blocks[pick]))

        upper = np.where(allowed, upper, -np.inf)
        place, value, evaluated = best_first(upper, exact, may_win, floor)
        return Move(place, value - float(self.of_eigenvalues(w)), evaluated)


class Extremes(Spectral):
    """A criterion that increases with the smallest eigenvalue and never with the largest.

    Restricted to the span of some eigenvectors of M, the changed matrix has a smallest eigenvalue
    not below, and a largest not above, those of the whole: their score bounds the true score.
    Whether the smallest eigenvalue is large enough for a candidate to win is one r x r inertia
    count.

    References
    ----------
    Courant-Fischer; Haynsworth's inertia additivity.
    """

    __slots__ = ()

    @abstractmethod
    def of_extremes(self, low: Array, high: Array) -> Array:
        """Value from the smallest and the largest eigenvalue, none negative."""

    @abstractmethod
    def least_for(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue that a value requires, given the largest eigenvalue."""

    def of_eigenvalues(self, w: Array) -> Array:
        """Value (...,) of eigenvalues (..., p), ascending."""
        return self.of_extremes(np.maximum(w[..., 0], 0.0), w[..., -1])

    def bounds(self, w: Array, V: Array, pool: Pool, sign: float) -> tuple[Array, Screen | None]:
        """Rayleigh-Ritz bounds; the screen asks for the smallest eigenvalue that a win needs."""
        slack = eigenvalue_rounding(w, pool.squares)
        # restrict to the two lowest, and to the two highest, eigenvectors
        two = min(2, len(w))
        C = pool.pages @ np.ascontiguousarray(np.concatenate([V[:, :two], V[:, -two:]], axis=1))
        # eigenvalues of the 2 x 2 restrictions, widened by rounding
        low = np.maximum(_of_pair(w[:two], C[..., :two], sign)[0] + slack, 0.0)
        high = _of_pair(w[-two:], C[..., two:], sign)[1] - slack

        def may_win(pick: Index, least: float) -> Bool:
            level = self.least_for(max(least, 0.0), high[pick]) - slack[pick]
            return _smallest_exceeds(w, pool.blocks[pick] @ V, sign, level)

        return self.of_extremes(low, high), may_win


class PlainIndex(Spectral):
    """A criterion whose value is the figure itself."""

    __slots__ = ()

    def figure(self, M: Array, n_poses: int) -> float:
        """The index."""
        return float(self.value(M))


def _smallest_exceeds(w: Array, C: Array, sign: float, level: Array) -> Bool:
    """Whether each diag(w) + sign C_j'C_j, for C (k, r, p), has all eigenvalues above a level (k,).

    It has as many below as diag(w) has, less (or, for a drop, plus) the negative eigenvalues of
    I + sign C_j (diag(w) - level)^-1 C_j'.
    """
    # diag(w) - level, kept away from zero
    gap = w - level[:, None]
    tiny = np.finfo(np.float64).eps * w[-1]
    gap = np.where(np.abs(gap) < tiny, tiny, gap)
    # Schur complement I + sign C gap^-1 C'
    S = sign * ((C / gap[:, None, :]) @ np.swapaxes(C, 1, 2))
    S[:, range(S.shape[1]), range(S.shape[1])] += 1.0
    # inertia: none may remain below the level
    turned = (np.linalg.eigvalsh(S) < 0).sum(-1)
    return np.asarray((gap < 0).sum(-1) - sign * turned <= 0)


def _of_pair(w: Array, C: Array, sign: float) -> tuple[Array, Array]:
    """Smaller and larger eigenvalue (N,) of diag(w) + sign C_j'C_j; w one or two, pages C."""
    a = w[0] + sign * np.einsum("rj,rj->j", C[..., 0], C[..., 0])
    if len(w) == 1:
        return a, a
    b = w[1] + sign * np.einsum("rj,rj->j", C[..., 1], C[..., 1])
    cross = np.einsum("rj,rj->j", C[..., 0], C[..., 1])
    middle, radius = (a + b) / 2, np.hypot((a - b) / 2, cross)
    return middle - radius, middle + radius


@dataclass(frozen=True, slots=True, eq=False)
class E(Extremes, Certifiable):
    """Value lambda_min of M; figure O3, its root.

    No set M* has a lambda_min above tr(Z M*), for any positive semidefinite Z of trace one. At
    order k, Z is proportional to M^-(k+1), the gradient of the matrix mean tr(M^-k)^(-1/k), which
    tends to lambda_min.

    References
    ----------
    Nahvi and Hollerbach 1996 (O3); Pukelsheim 1993 (matrix means).
    """

    name: str = "E"

    index: ClassVar[IndexName | None] = "O3"
    sharpness: ClassVar[tuple[float, ...]] = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)

    def of_extremes(self, low: Array, high: Array) -> Array:
        """The smallest eigenvalue."""
        return low

    def least_for(self, value: float, high: Array) -> Array:
        """The value itself."""
        return np.full_like(high, value)

    def figure(self, M: Array, n_poses: int) -> float:
        """O3."""
        return self.figure_of_value(float(self.value(M)), len(M), n_poses)

    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """Root of the value."""
        return float(np.sqrt(value))

    def dual(self, M: Array, sharpness: float) -> Array:
        """Z of trace one, concentrated on the weakest directions."""
        w, U = np.linalg.eigh(M)
        # any such Z will do: rounding must not make one eigenvalue negative
        w = np.maximum(w, len(w) * np.finfo(np.float64).eps * w[-1])
        share = (w[0] / w) ** (sharpness + 1)
        return np.asarray((U * (share / share.sum())) @ U.T)

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """The largest tr(Z M*) itself."""
        return top

    def with_rounding(self, bound: float, M: Array) -> float:
        """The bound plus the rounding of M's smallest eigenvalue."""
        return bound * (1 + relative_rounding(M, any_units=False))

    def exponent(self, sharpness: float) -> float:
        """1 / (k + 1)."""
        return 1 / (sharpness + 1)

    def efficiency(self, value: float, bound: float, p: int) -> float:
        """Lower bound on O3 relative to the largest possible."""
        return float(np.sqrt(max(value, 0.0) / bound))


@dataclass(frozen=True, slots=True, eq=False)
class O2(Extremes, PlainIndex):
    """Value and figure sqrt(lambda_min / lambda_max); it may fall when a pose is added.

    References
    ----------
    Wen et al. 2022, eq. (6).
    """

    name: str = "O2"

    index: ClassVar[IndexName | None] = "O2"

    def of_extremes(self, low: Array, high: Array) -> Array:
        """sqrt(lambda_min / lambda_max); 0 for M = 0."""
        high = np.where(high > 0, high, 1.0)
        return np.sqrt(low / high)

    def least_for(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue that a value requires."""
        return np.asarray(value**2 * high)


@dataclass(frozen=True, slots=True, eq=False)
class O4(Extremes, PlainIndex):
    """Value and figure lambda_min / sqrt(lambda_max); it may fall when a pose is added.

    References
    ----------
    Nahvi and Hollerbach 1996.
    """

    name: str = "O4"

    index: ClassVar[IndexName | None] = "O4"

    def of_extremes(self, low: Array, high: Array) -> Array:
        """lambda_min / sqrt(lambda_max); 0 for M = 0."""
        return np.asarray(low / np.sqrt(np.where(high > 0, high, 1.0)))

    def least_for(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue that a value requires."""
        return np.asarray(value * np.sqrt(high))


@dataclass(frozen=True, slots=True, eq=False)
class O5(PlainIndex):
    """Value and figure 1 / sum of lambda^-1/2.

    In the eigenbasis of M the diagonal of the changed matrix is majorized by its eigenvalues and
    x^-1/2 is convex, so the sum over the diagonal is never above the sum over the eigenvalues.

    References
    ----------
    Wen et al. 2022, eq. (6), inverted; Schur-Horn theorem and Karamata's inequality.
    """

    name: str = "O5"

    index: ClassVar[IndexName | None] = "O5"

    def of_eigenvalues(self, w: Array) -> Array:
        """The index (...,); 0 where an eigenvalue is not positive."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / (1.0 / np.sqrt(np.maximum(w, 0.0))).sum(-1))

    def bounds(self, w: Array, V: Array, pool: Pool, sign: float) -> tuple[Array, Screen | None]:
        """The index of the diagonal of each changed matrix in the eigenbasis of M."""
        C = pool.pages @ np.ascontiguousarray(V)
        diagonal = w + sign * np.einsum("rjk,rjk->jk", C, C)
        diagonal += eigenvalue_rounding(w, pool.squares)[:, None]
        return self.of_eigenvalues(diagonal), None
