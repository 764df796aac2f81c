"""Local searches: exchange poses of a set one at a time until nothing improves; perturb a set."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.design.problem import Problem
from calib.design.random import nonsingular_set
from calib.information.criteria.lazy import best_swap

SHAKES = 100
"""Random perturbations tried before a nonsingular set is drawn anew."""


class LocalOptimum(NamedTuple):
    """Result of one local search."""

    chosen: Index
    """(m,) indices in the pool, ascending."""
    value: float
    """Value of the criterion."""
    evaluated: int
    """Number of sets evaluated exactly."""
    way: list[Index]
    """The first set, and the one after each exchange."""


def add_and_drop(problem: Problem, chosen: Index) -> LocalOptimum:
    """Add the best pose and drop the worst until they are the same or the value stops rising.

    The set stays in ascending order and its information is summed afresh each round, so that its
    value does not depend on the way to it.

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
    """Make the best of all exchanges of one pose for another until the value stops rising.

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
    problem: Problem, chosen: Index, move: Callable[[Array, Index, Bool], tuple[Index | None, int]]
) -> LocalOptimum:
    """Change a set (m,) by a move until it offers none or the value stops rising."""
    criterion, evaluated, way = problem.criterion, 0, [chosen]
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
        way.append(chosen)
    return LocalOptimum(chosen, value, evaluated, way)


def shake(problem: Problem, chosen: Index, swaps: int, rng: np.random.Generator) -> Index:
    """Replace `swaps` poses of a set, or all it can, by random others; M stays nonsingular."""
    outside = np.flatnonzero(problem.addable(chosen))
    swaps = min(swaps, len(chosen), len(outside))
    for _ in range(SHAKES):
        leaving = rng.choice(len(chosen), swaps, replace=False)
        entering = rng.choice(outside, swaps, replace=False)
        changed = np.sort(np.concatenate([np.delete(chosen, leaving), entering]))
        if not problem.is_singular(changed):
            return np.asarray(changed, dtype=np.int64)
    return nonsingular_set(problem, rng)
