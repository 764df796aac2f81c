"""The best pose to add and the best to drop, exactly: cheap bounds first, then the few survivors.

For each index a scorer knows a monotone score of the information matrix, an upper bound on the
score after a change by one block, and the score itself. Candidates are met best bound first; once
the next bound falls below the best score, no other can win. The result is that of brute force.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import solve_triangular

from calib.arrays import Array, Bool, Index
from calib.information.observability import Criterion, known

TIE = 1e-12
"""Scores closer than this part are equal; the lowest place in the pool then wins."""
FIRST = 8
"""Candidates evaluated exactly in the first round; later rounds double."""
MOST = 64


class Move(NamedTuple):
    """One pose to add to, or to drop from, a set."""

    place: int
    """Place in the pool (add) or in the list of chosen poses (drop)."""
    evaluated: int
    """Sets evaluated exactly to find it."""


class Scorer(Protocol):
    """What an exchange needs to know about an index."""

    def add(self, M: Array, inside: Bool) -> Move:
        """Best pose outside the set to add to information M (p, p); `inside` (N,) marks the set."""
        ...

    def drop(self, M: Array, chosen: Index) -> Move:
        """Best of the poses `chosen` (k,), ascending, to take out of information M (p, p)."""
        ...


def scorer(blocks: Array, criterion: Criterion) -> Scorer:
    """Scorer of an index over a pool of blocks (N, r, p)."""
    known(criterion)
    if criterion == "O1":
        return _LogDet(blocks)
    if criterion == "O5":
        return _InverseSum(blocks)
    return _Extremes(blocks, criterion)


def first_best(values: Array) -> int:
    """Place of the largest value; of equal ones (within `TIE`) the first."""
    top = values.max()
    return int(np.argmax(values >= top - TIE * abs(top)))


_SCORES: dict[Criterion, Callable[[Array, Array], Array]] = {
    "O2": lambda low, high: low / high,
    "O3": lambda low, _: low,
    "O4": lambda low, high: low**2 / high,
}
"""Square of each index from the smallest and the largest eigenvalue."""
_NEEDED: dict[Criterion, Callable[[float, Array], Array]] = {
    "O2": lambda score, high: score * high,
    "O3": lambda score, high: np.full_like(high, score),
    "O4": lambda score, high: np.sqrt(score * high),
}
"""Smallest eigenvalue that a score asks for."""


class _Pool:
    """Candidate blocks, and the same rows in pages (r, N, p), so that sums over r are fast."""

    def __init__(self, blocks: Array) -> None:
        self.blocks = blocks
        self.pages = np.ascontiguousarray(np.moveaxis(blocks, 1, 0))


def _seen_along(pages: Array, V: Array) -> Array:
    """B_j V, pages (r, N, k), for pages (r, N, p) and V (p, k)."""
    r, n_blocks, p = pages.shape
    return (pages.reshape(-1, p) @ np.ascontiguousarray(V)).reshape(r, n_blocks, -1)


class _LogDet:
    """O1: score log det M; the change by a block is an r x r determinant.

    With K = B M^-1 B', adding gains log det(I + K) <= r log(1 + tr K / r), dropping log det(I - K).

    References
    ----------
    MATH 8.3; the determinant lemma and the inequality of means.
    """

    def __init__(self, blocks: Array) -> None:
        self.pool = _Pool(blocks)

    def add(self, M: Array, inside: Bool) -> Move:
        r = len(self.pool.pages)
        Z = _seen_along(self.pool.pages, _whitener(M))
        trace = np.einsum("rjk,rjk->j", Z, Z)
        upper = np.where(inside, -np.inf, r * np.log1p(trace / r) * (1 + TIE))
        return _best_first(upper, lambda pick: _log_det_change(Z[:, pick], 1.0))

    def drop(self, M: Array, chosen: Index) -> Move:
        Z = self.pool.pages[:, chosen] @ _whitener(M)
        return Move(first_best(_log_det_change(Z, -1.0)), len(chosen))


def _whitener(M: Array) -> Array:
    """Upper triangular W (p, p) with W W' = M^-1."""
    lower = np.linalg.cholesky(M)
    return np.asarray(
        solve_triangular(lower, np.eye(len(M)), lower=True, check_finite=False, trans=0).T
    )


def _log_det_change(Z: Array, sign: float) -> Array:
    """Values log det(I + sign Z_j Z_j') of whitened pages (r, k, p); -inf where nothing is left."""
    rows = np.moveaxis(Z, 0, 1)
    K = sign * (rows @ np.swapaxes(rows, 1, 2))
    K[:, range(len(Z)), range(len(Z))] += 1.0
    positive, value = np.linalg.slogdet(K)
    return np.where(positive > 0, value, -np.inf)


class _Extremes:
    """O2, O3, O4: scores from the smallest and the largest eigenvalue of M.

    On the span of some eigenvectors of M, the changed matrix has a smallest eigenvalue not below,
    and a largest not above, the true ones: a score of those two bounds the true score. Whether the
    true smallest eigenvalue reaches what a candidate needs to win is one r x r inertia count.

    References
    ----------
    MATH 8.3; Courant-Fischer; Haynsworth's inertia additivity.
    """

    def __init__(self, blocks: Array, criterion: Criterion) -> None:
        self.pool = _Pool(blocks)
        self.score = _SCORES[criterion]
        self.needed = _NEEDED[criterion]

    def add(self, M: Array, inside: Bool) -> Move:
        return self._change(M, self.pool.pages, self.pool.blocks, 1.0, inside)

    def drop(self, M: Array, chosen: Index) -> Move:
        pages, blocks = self.pool.pages[:, chosen], self.pool.blocks[chosen]
        return self._change(M, pages, blocks, -1.0, np.zeros(len(chosen), dtype=bool))

    def _change(self, M: Array, pages: Array, blocks: Array, sign: float, out: Bool) -> Move:
        """Best of M + sign B'B over all blocks not marked `out`."""
        w, V = np.linalg.eigh(M)
        slack = _rounding(w)
        two = min(2, len(M))
        C = _seen_along(pages, np.concatenate([V[:, :two], V[:, -two:]], axis=1))
        low = _of_pair(w[:two], C[..., :two], sign)[0] + slack
        high = _of_pair(w[-two:], C[..., two:], sign)[1] - slack
        upper = np.where(out, -np.inf, self.score(np.maximum(low, 0.0), high))

        def may_win(pick: Index, floor: float) -> Bool:
            enough = self.needed(max(floor, 0.0), high[pick]) - slack
            return _smallest_exceeds(w, blocks[pick] @ V, sign, enough)

        def exact(pick: Index) -> Array:
            changed = _eigenvalues(_changed(M, blocks[pick], sign))
            return np.asarray(self.score(np.maximum(changed[:, 0], 0.0), changed[:, -1]))

        return _best_first(upper, exact, may_win)


def _rounding(w: Array) -> float:
    """Rounding that eigenvalues w (p,), ascending, carry; a bound must not lose to it."""
    return float(4 * len(w) * np.finfo(np.float64).eps * w[-1])


def _changed(M: Array, blocks: Array, sign: float) -> Array:
    """Information (k, p, p) after adding or dropping each of some blocks (k, r, p)."""
    return np.asarray(M + sign * (np.swapaxes(blocks, 1, 2) @ blocks))


def _eigenvalues(M: Array) -> Array:
    """Eigenvalues (..., p), ascending."""
    return np.asarray(np.linalg.eigvalsh(M), dtype=np.float64)


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


class _InverseSum:
    """O5: score 1 / sum of lambda^-1/2.

    In the eigenbasis of M the diagonal of the changed matrix is majorized by its eigenvalues and
    x^-1/2 is convex, so the sum over the diagonal is never above the sum over the eigenvalues.

    References
    ----------
    Schur-Horn theorem; Karamata's inequality.
    """

    def __init__(self, blocks: Array) -> None:
        self.pool = _Pool(blocks)

    def add(self, M: Array, inside: Bool) -> Move:
        return self._change(M, self.pool.pages, self.pool.blocks, 1.0, inside)

    def drop(self, M: Array, chosen: Index) -> Move:
        pages, blocks = self.pool.pages[:, chosen], self.pool.blocks[chosen]
        return self._change(M, pages, blocks, -1.0, np.zeros(len(chosen), dtype=bool))

    def _change(self, M: Array, pages: Array, blocks: Array, sign: float, out: Bool) -> Move:
        """Best of M + sign B'B over all blocks not marked `out`."""
        w, V = np.linalg.eigh(M)
        C = _seen_along(pages, V)
        diagonal = w + sign * np.einsum("rjk,rjk->jk", C, C) + _rounding(w)
        upper = np.where(out, -np.inf, _inverse_sum(diagonal))

        def exact(pick: Index) -> Array:
            return _inverse_sum(_eigenvalues(_changed(M, blocks[pick], sign)))

        return _best_first(upper, exact)


def _inverse_sum(eigenvalues: Array) -> Array:
    """1 / sum of lambda^-1/2 over the last axis; 0 where an eigenvalue is not positive."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (1.0 / np.sqrt(np.maximum(eigenvalues, 0.0))).sum(-1))


def _best_first(
    upper: Array,
    exact: Callable[[Index], Array],
    may_win: Callable[[Index, float], Bool] | None = None,
) -> Move:
    """Place of the best exact score, evaluating in the order of the bounds until none can win.

    `may_win` sorts out candidates that certainly do not reach a score.
    """
    order = np.argsort(-upper, kind="stable")
    values = np.full(len(upper), -np.inf)
    best, start, batch, evaluated = -np.inf, 0, FIRST, 0
    while start < len(order):
        pick = order[start : start + batch]
        # a bound at -inf is a pose that may not be taken; ties must be met, whatever their order
        floor = best - TIE * abs(best) if evaluated else np.finfo(np.float64).min
        pick = pick[upper[pick] >= floor]
        if not pick.size:
            break
        if may_win is not None and evaluated:
            pick = pick[may_win(pick, floor)]
        if pick.size:
            values[pick] = exact(pick)
            evaluated += len(pick)
            best = max(best, float(values[pick].max()))
        start, batch = start + batch, min(2 * batch, MOST)
    if not np.isfinite(best):
        return Move(int(np.argmax(np.isfinite(upper))), evaluated)
    return Move(first_best(values), evaluated)
