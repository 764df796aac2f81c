"""Criteria of the eigenvalues of M: the gains they share, and the moves of E, O2 and O4."""

from abc import abstractmethod

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Criterion, Move, Pool
from calib.information.criteria.lazy import best_first
from calib.information.criteria.whitened import CHUNK, eigenvalues, grams

RISE = 1e-12
"""A set counts as better when its value rises by more than this part; ties would cycle."""


class Spectral(Criterion):
    """A value of all eigenvalues of M: the gain of a move is a difference of two such values."""

    __slots__ = ()

    def rises(self, value: float, before: float) -> bool:
        """Whether the value is higher by more than rounding."""
        return value > before + RISE * abs(before)

    def add(self, M: Array, blocks: Array) -> Array:
        """Gains (N,), each from its own eigenvalues."""
        return self.value(changed(M, blocks, 1.0)) - self.value(M)

    def drop(self, M: Array, blocks: Array) -> Array:
        """Gains (k,), each from its own eigenvalues."""
        return self.value(changed(M, blocks, -1.0)) - self.value(M)

    def swap(self, M: Array, leaving: Array, entering: Array) -> Array:
        """Gains (k, N), each from its own eigenvalues."""
        return fresh_swaps(self, M, leaving, entering)


class Extremes(Spectral):
    """A value that rises with the smallest eigenvalue and does not rise with the largest.

    On the span of some eigenvectors of M, the changed matrix has a smallest eigenvalue not below,
    and a largest not above, the true ones: a score of those two bounds the true score. Whether the
    true smallest eigenvalue reaches what a candidate needs to win is one r x r inertia count.

    References
    ----------
    Courant-Fischer; Haynsworth's inertia additivity.
    """

    __slots__ = ()

    @abstractmethod
    def of_extremes(self, low: Array, high: Array) -> Array:
        """Value of the smallest and the largest eigenvalue, none negative."""

    @abstractmethod
    def needed(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue that a value asks for, beside a largest one."""

    def value(self, M: Array) -> Array:
        """Value (...,) from the eigenvalues."""
        w = eigenvalues(M)
        return self.of_extremes(np.maximum(w[..., 0], 0.0), w[..., -1])

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition, met in the order of the Rayleigh-Ritz bounds."""
        return self._best(M, pool, 1.0, allowed, floor)

    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best deletion, met in the order of the Rayleigh-Ritz bounds."""
        return self._best(M, Pool(blocks), -1.0, np.ones(len(blocks), dtype=bool), -np.inf)

    def _best(self, M: Array, pool: Pool, sign: float, allowed: Bool, floor: float) -> Move:
        """Best of M + sign B'B over the allowed blocks of a pool."""
        w, V = np.linalg.eigh(M)
        slack = rounding(w, pool.squares)
        two = min(2, len(M))
        C = seen_along(pool.pages, np.concatenate([V[:, :two], V[:, -two:]], axis=1))
        low = np.maximum(_of_pair(w[:two], C[..., :two], sign)[0] + slack, 0.0)
        high = _of_pair(w[-two:], C[..., two:], sign)[1] - slack
        upper = np.where(allowed, self.of_extremes(low, high), -np.inf)

        def may_win(pick: Index, least: float) -> Bool:
            enough = self.needed(max(least, 0.0), high[pick]) - slack[pick]
            return _smallest_exceeds(w, pool.blocks[pick] @ V, sign, enough)

        def exact(pick: Index) -> Array:
            return self.value(changed(M, pool.blocks[pick], sign))

        place, value, evaluated = best_first(upper, exact, may_win, floor)
        here = float(self.of_extremes(np.maximum(w[:1], 0.0), w[-1:])[0])
        return Move(place, value - here, evaluated)


def fresh_swaps(criterion: Criterion, M: Array, leaving: Array, entering: Array) -> Array:
    """Gains (k, N) of all exchanges, each from its own information matrix."""
    here, out = float(criterion.value(M)), np.empty((len(leaving), len(entering)))
    gained = grams(entering)
    for i, lost in enumerate(grams(leaving)):
        for start in range(0, len(entering), CHUNK):
            some = slice(start, start + CHUNK)
            out[i, some] = criterion.value(M - lost + gained[some]) - here
    return out


def rounding(w: Array, squares: Array) -> Array:
    """Rounding (N,) of the eigenvalues of M + B_j'B_j; a bound must not lose to it.

    Eigenvalues w (p,) of M, ascending; squares (N,) of the rows.
    """
    return np.asarray(4 * len(w) * np.finfo(np.float64).eps * (w[-1] + squares))


def changed(M: Array, blocks: Array, sign: float) -> Array:
    """Information (k, p, p) after adding or dropping each of some blocks (k, r, p)."""
    return np.asarray(M + sign * grams(blocks))


def seen_along(pages: Array, V: Array) -> Array:
    """B_j V, pages (r, N, k), for pages (r, N, p) and V (p, k)."""
    return np.asarray(pages @ np.ascontiguousarray(V))


def _smallest_exceeds(w: Array, C: Array, sign: float, level: Array) -> Bool:
    """Whether each diag(w) + sign C_j'C_j, for C (k, r, p), has all eigenvalues above a level (k,).

    It has as many below as diag(w) has, less (or, for a drop, plus) the negative eigenvalues of
    I + sign C_j (diag(w) - level)^-1 C_j'.
    """
    gap = w - level[:, None]
    tiny = np.finfo(np.float64).eps * w[-1]
    gap = np.where(np.abs(gap) < tiny, tiny, gap)
    S = sign * ((C / gap[:, None, :]) @ np.swapaxes(C, 1, 2))
    S[:, range(S.shape[1]), range(S.shape[1])] += 1.0
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
