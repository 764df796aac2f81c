"""Best moves without trying all: cheap bounds first, then only the few candidates that can win.

Candidates are tried best bound first; once the next bound falls below the best score, no other can
win. The result is that of brute force.
"""

from collections.abc import Callable

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Criterion, Move, Pool, Swap
from calib.information.criteria.whitened import CHUNK, grams

TIE = 1e-12
"""Scores that differ by less than this part are equal; the lowest index in the pool then wins."""
SLACK = 1e-9
"""Part by which bounds are widened against rounding; it hardly costs an evaluation."""
FIRST = 8
"""Candidates evaluated exactly in the first round; later rounds double."""
MOST = 64
"""Candidates evaluated in one round at most."""
ILL_CONDITIONED = 1e-3
"""If dropping a pose leaves less than this part of the information in some direction, swaps of it
are computed directly instead of as a drop and an addition."""


def first_best(values: Array) -> int:
    """Index of the largest value; of equal ones (within `TIE`) the first."""
    top = values.max()
    return int(np.argmax(values >= top - TIE * abs(top)))


def best_of_all(gains: Array) -> Move:
    """The best of gains (N,) that are all known."""
    place = first_best(gains)
    return Move(place, float(gains[place]), len(gains))


def best_first(
    upper: Array,
    exact: Callable[[Index], Array],
    may_win: Callable[[Index, float], Bool] | None = None,
    floor: float = -np.inf,
) -> tuple[int, float, int]:
    """Find the largest exact score, evaluating only candidates whose bound may reach it.

    Parameters
    ----------
    upper : (N,) array
        Upper bounds of the scores; -inf for candidates that are not allowed.
    exact : callable
        Scores of candidates, by their indices.
    may_win : callable, optional
        Second screen: whether candidates may reach a score.
    floor : float
        Scores below it need not be found.

    Returns
    -------
    tuple of int, float, int
        Index of the best candidate (-1 if none reaches `floor`), its score, and the number of
        candidates evaluated.
    """
    order = np.argsort(-upper, kind="stable")
    values = np.full(len(upper), -np.inf)
    best, start, batch, evaluated = floor, 0, FIRST, 0
    while start < len(order):
        pick = order[start : start + batch]
        # ties must be tried, whatever the order of their bounds
        least = best - TIE * abs(best) if np.isfinite(best) else np.finfo(np.float64).min
        pick = pick[upper[pick] >= least]
        if not pick.size:
            break
        if may_win is not None and np.isfinite(best):
            pick = pick[may_win(pick, least)]
        if pick.size:
            values[pick] = exact(pick)
            evaluated += len(pick)
            best = max(best, float(values[pick].max()))
        start, batch = start + batch, min(2 * batch, MOST)
    if not np.isfinite(values.max(initial=-np.inf)):
        # nothing finite: the first allowed pose, unless a floor was asked for
        place = int(np.argmax(upper > -np.inf)) if (upper > -np.inf).any() else -1
        return (-1 if np.isfinite(floor) else place), -np.inf, evaluated
    place = first_best(values)
    if values[place] < floor - TIE * abs(floor):
        return -1, -np.inf, evaluated
    return place, float(values[place]), evaluated


def best_swap(criterion: Criterion, M: Array, leaving: Array, pool: Pool, allowed: Bool) -> Swap:
    """Best exchange of one block of `leaving` (k, r, p) for one of the pool; of equals the first.

    For each leaving pose this is the best addition to what remains. Where M without it is nearly
    singular, the exact gain of every exchange is computed instead.
    """
    value = float(criterion.value(M))
    dropped = criterion.drop(M, leaving)
    best = np.full(len(leaving), -np.inf)
    entering, evaluated, top = np.full(len(leaving), -1), 0, -np.inf
    for i in np.argsort(-dropped, kind="stable"):
        B = leaving[i]
        if _remains(M, B):
            floor = value + top - TIE * abs(value + top) if np.isfinite(top) else -np.inf
            rest = M - B.T @ B
            found = criterion.best_add(rest, pool, allowed, floor)
            gain = found.gain + float(criterion.value(rest)) - value
            entering[i], evaluated = found.place, evaluated + found.evaluated
        else:
            places = np.flatnonzero(allowed)
            gains = criterion.swap(M, B[None], pool.blocks[places])[0]
            place = first_best(gains)
            entering[i], gain = places[place], float(gains[place])
            evaluated += len(places)
        if entering[i] >= 0:
            best[i] = gain
            top = max(top, gain)
    if not np.isfinite(best).any():
        return Swap(-1, -1, -np.inf, evaluated)
    out = int(np.argmax(best >= best.max() - TIE * abs(value + best.max())))
    return Swap(out, int(entering[out]), float(best[out]), evaluated)


def _remains(M: Array, B: Array) -> bool:
    """Whether M - B'B (p, p) keeps more than rounding in every direction."""
    try:
        L = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        return False
    Z = np.linalg.solve(L, B.T)
    return bool(np.linalg.norm(Z, 2) ** 2 < 1 - ILL_CONDITIONED)


def fresh_swaps(criterion: Criterion, M: Array, leaving: Array, entering: Array) -> Array:
    """Gains (k, N) of all exchanges, each from its own information matrix."""
    here, out = float(criterion.value(M)), np.empty((len(leaving), len(entering)))
    gained = grams(entering)
    for i, lost in enumerate(grams(leaving)):
        for start in range(0, len(entering), CHUNK):
            some = slice(start, start + CHUNK)
            out[i, some] = criterion.value(M - lost + gained[some]) - here
    return out
