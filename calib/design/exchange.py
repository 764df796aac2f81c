"""Exchange of poses: local searches from one start, after shakes (DETMAX), or from many starts."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index
from calib.design.greedy import grow
from calib.design.problem import Problem
from calib.design.random import nonsingular_set, starting_set
from calib.design.selection import Selection, selection_of
from calib.errors import refuse
from calib.information.criteria.d import D
from calib.information.criteria.g import G
from calib.information.criteria.lazy import best_swap
from calib.information.criteria.linear import Linear

RESTARTS = 6
"""Local searches by default, from the greedy set, for A and V the best for D, the others random."""
RESTARTS_OF_D = 2
"""Local searches of that search for D."""
PAIRS_OF_G = 5000
"""Exchanges of two poses that G tries at most: each needs every goal pose."""
SHAKES = 100
"""Shakes tried before a nonsingular set is drawn anew."""


class LocalOptimum(NamedTuple):
    """End of one local search."""

    chosen: Index
    value: float
    evaluated: int


def add_and_drop(problem: Problem, chosen: Index) -> LocalOptimum:
    """Add the best and drop the worst until they are the same pose or the value stops rising.

    The set stays in ascending order and its information is summed afresh each round, so that a
    value belongs to a set and not to the way to it.

    References
    ----------
    Mitchell 1974.
    """
    criterion, blocks = problem.criterion, problem.blocks

    def move(M: Array, chosen: Index, allowed: Bool) -> tuple[Index | None, int]:
        added = criterion.best_add(M, problem.pool, allowed)
        larger = np.sort(np.append(chosen, added.place))
        B = blocks[added.place]
        dropped = criterion.best_drop(M + B.T @ B, blocks[larger])
        same = larger[dropped.place] == added.place
        after = None if same else np.delete(larger, dropped.place)
        return after, added.evaluated + dropped.evaluated

    return _climb(problem, chosen, move)


def best_pairs(problem: Problem, chosen: Index) -> LocalOptimum:
    """Take the best of all exchanges of one pose for another until the value stops rising.

    References
    ----------
    Fedorov 1972.
    """

    def move(M: Array, chosen: Index, allowed: Bool) -> tuple[Index | None, int]:
        swap = best_swap(problem.criterion, M, problem.blocks[chosen], problem.pool, allowed)
        if swap.leaving < 0:
            return None, swap.evaluated
        after = np.sort(np.append(np.delete(chosen, swap.leaving), swap.entering))
        return after, swap.evaluated

    return _climb(problem, chosen, move)


def _climb(
    problem: Problem,
    chosen: Index,
    move: Callable[[Array, Index, Bool], tuple[Index | None, int]],
) -> LocalOptimum:
    """Change a set (m,) by a move until it offers none or the value stops rising."""
    criterion, evaluated = problem.criterion, 0
    M = problem.information(chosen)
    value = float(criterion.value(M))
    while (allowed := problem.addable(chosen)).any():
        after, tried = move(M, chosen, allowed)
        evaluated += tried
        if after is None:
            break
        M = problem.information(after)
        reached = float(criterion.value(M))
        if not criterion.rises(reached, value):
            break
        chosen, value = after, reached
    return LocalOptimum(chosen, value, evaluated)


def detmax(
    problem: Problem,
    rng: np.random.Generator,
    *,
    a: int = 40,
    b: int = 2,
    c: int = 1,
    d: int = 80,
    start: ArrayLike | None = None,
) -> Selection:
    """Pose set that maximizes a criterion, by the paper's exchange.

    Each local search adds the pose, of all those outside, that lifts the value most, and drops the
    one that lowers it least. After it, b poses of the current set are swapped for random ones (c,
    once a searches in a row brought nothing); after d such searches the best set is returned.

    Parameters
    ----------
    problem : Problem
        What to choose.
    rng : numpy.random.Generator
        Draws the first set and the swaps.
    a, b, c, d : int
        The paper's constants.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    References
    ----------
    Wen et al. 2022, section 2.3, with candidates 1..X in step 4 and the root 1/p in O1;
    Mitchell 1974.
    """
    for name, constant, lowest in (("a", a, 0), ("b", b, 1), ("c", c, 1), ("d", d, 1)):
        if constant < lowest:  # it would never shake, or never stop
            raise refuse(name, constant, f"at least {lowest}", code="A3")
    chosen, criterion = starting_set(problem, rng, start), problem.criterion
    best, winner, trace = -np.inf, chosen, list[float]()
    fails = evaluated = 0
    while fails < d:
        end = add_and_drop(problem, chosen)
        evaluated += end.evaluated
        if not trace or criterion.rises(end.value, best):
            best, winner, fails = end.value, end.chosen, 0
            figure = criterion.figure(problem.information(winner), problem.n_poses)
        else:
            fails += 1
        trace.append(figure)
        if not problem.addable(end.chosen).any():
            break  # the whole pool: nothing to exchange
        chosen = shake(problem, end.chosen, c if fails >= a else b, rng)
    return selection_of(problem, winner, "detmax", trace, evaluated)


def shake(problem: Problem, chosen: Index, swaps: int, rng: np.random.Generator) -> Index:
    """Exchange `swaps` poses of a set for others of the pool; the result is nonsingular."""
    outside = np.flatnonzero(problem.addable(chosen))
    swaps = min(swaps, len(chosen), len(outside))
    for _ in range(SHAKES):
        leaving = rng.choice(len(chosen), swaps, replace=False)
        entering = rng.choice(outside, swaps, replace=False)
        changed = np.sort(np.concatenate([np.delete(chosen, leaving), entering]))
        if not problem.is_singular(changed):
            return np.asarray(changed, dtype=np.int64)
    return nonsingular_set(problem, rng)


class Best(NamedTuple):
    """The best of several local searches."""

    chosen: Index
    value: float
    trace: list[float]
    evaluated: int


def exchange(problem: Problem, rng: np.random.Generator, *, restarts: int = RESTARTS) -> Selection:
    """Pose set that no exchange improves, the best from several starts.

    The first start is the greedy set, so that the result is never worse than that. The second, for
    A and V, is the best set found for D: variances have more local optima than the determinant.
    From each, the best pose is added and the worst dropped until nothing changes; the best of the
    ends goes on by best pairs until no exchange of two poses helps. G begins with the best set for
    the mean instead of the greedy one, and tries pairs in small pools only.

    Parameters
    ----------
    problem : Problem
        What to choose.
    rng : numpy.random.Generator
        Draws the other starts.
    restarts : int
        Local searches, each from another start.

    References
    ----------
    Mitchell 1974 (add and drop); Fedorov 1972 (pairs).
    """
    if restarts < 1:
        raise refuse("restarts", restarts, "at least 1", code="A3")
    small = problem.m * len(problem.pool) <= PAIRS_OF_G
    pairs = small or not isinstance(problem.criterion, G)
    best = best_exchange(problem, rng, restarts=restarts, pairs=pairs)
    return selection_of(problem, best.chosen, "exchange", best.trace, best.evaluated)


def best_exchange(
    problem: Problem,
    rng: np.random.Generator,
    *,
    restarts: int = RESTARTS,
    first: Sequence[int] | None = None,
    pairs: bool = False,
) -> Best:
    """The search of a checked problem, from `first` (else the greedy set) and random sets."""
    criterion = problem.criterion
    if isinstance(criterion, G):
        # the worst goal pose changes from set to set: the best mean is where to begin
        mean = best_exchange(replace(problem, criterion=criterion.mean()), rng, restarts=restarts)
        first = mean.chosen.tolist()
    chosen, value, trace, evaluated = np.zeros(0, np.int64), -np.inf, list[float](), 0
    for start in range(restarts):
        if start == 0:
            begin = _first(problem, rng, first)
        elif start == 1 and isinstance(criterion, Linear):
            by_d = replace(problem, criterion=D())
            begin = best_exchange(by_d, rng, restarts=RESTARTS_OF_D).chosen
        else:
            begin = nonsingular_set(problem, rng)
        end = add_and_drop(problem, begin)
        evaluated += end.evaluated
        if not trace or criterion.rises(end.value, value):
            chosen, value = end.chosen, end.value
        trace.append(criterion.figure(problem.information(chosen), problem.n_poses))
    if pairs:
        end = best_pairs(problem, chosen)
        chosen, value, evaluated = end.chosen, end.value, evaluated + end.evaluated
        trace.append(criterion.figure(problem.information(chosen), problem.n_poses))
    return Best(chosen, value, trace, evaluated)


def _first(problem: Problem, rng: np.random.Generator, first: Sequence[int] | None) -> Index:
    """The set to start from: `first`, else the greedy set."""
    places = grow(problem).chosen if first is None else first
    begin = np.sort(np.array(places, dtype=np.int64))
    return nonsingular_set(problem, rng) if problem.is_singular(begin) else begin


def fedorov(
    problem: Problem, rng: np.random.Generator, *, start: ArrayLike | None = None
) -> Selection:
    """Pose set from one start, until no exchange of one pose improves it.

    Parameters
    ----------
    problem : Problem
        What to choose.
    rng : numpy.random.Generator
        Draws the first set.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    References
    ----------
    Fedorov 1972.
    """
    end = best_pairs(problem, starting_set(problem, rng, start))
    figure = problem.criterion.figure(problem.information(end.chosen), problem.n_poses)
    return selection_of(problem, end.chosen, "fedorov", [figure], end.evaluated)
