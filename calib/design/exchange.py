"""Exchange algorithms for pose sets: add and drop from several starts, and Fedorov's best pair."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Index, require_count
from calib.design.borders import require_search
from calib.design.greedy import grow
from calib.design.local import add_and_drop, best_pairs
from calib.design.problem import Problem
from calib.design.random import nonsingular_set, starting_set
from calib.design.selection import Selection, selection_of
from calib.information.criteria.base import Pool
from calib.information.criteria.d import D
from calib.information.criteria.g import G
from calib.information.criteria.linear import Linear
from calib.information.criteria.total import Total
from calib.kinds import in_short

RESTARTS = 6
"""Number of local searches by default; their starts are those of `exchange`."""
RESTARTS_OF_D = 2
"""Number of local searches for the D-optimal set that A and V start from."""
PAIRS_OF_G = 5000
"""Largest number of exchanges of two poses for which G tries them: each needs every goal pose."""


class Best(NamedTuple):
    """The best of several local searches."""

    chosen: Index
    """(m,) indices in the pool, ascending."""
    value: float
    """Value of the criterion."""
    trace: list[float]
    """Best figure after each search."""
    evaluated: int
    """Number of sets evaluated exactly."""
    way: list[Index]
    """Sets on the way, as in `Selection`."""


def exchange(problem: Problem, rng: np.random.Generator, *, restarts: int = RESTARTS) -> Selection:
    """Pose set that no exchange improves, the best from several starts.

    The first start is the greedy set, so that the result is never worse. The second, for A and V,
    is the best set found for D: variances have more local optima than the determinant. Where V or G
    counts error sources common to all readings, it is the best set found for the noise alone. All
    further starts are random. From each, the best pose is added and the worst dropped until nothing
    changes; the best of the results is improved until no exchange of two poses helps. G starts from
    the best set for the mean instead of the greedy one, and tries pairs in small pools only.

    Parameters
    ----------
    problem : Problem
        Pool, number of poses and criterion.
    rng : numpy.random.Generator
        Draws the random starts.
    restarts : int
        Number of local searches.

    Raises
    ------
    InputError
        M28: no set was found that determines all numbers.

    References
    ----------
    Mitchell 1974 (add and drop); Fedorov 1972 (pairs).
    """
    require_search(problem, rng)
    restarts = require_count("restarts", restarts)
    small = problem.m * len(problem.pool) <= PAIRS_OF_G
    pairs = small or not isinstance(problem.criterion, G)
    best = best_exchange(problem, rng, restarts=restarts, pairs=pairs)
    return selection_of(problem, best.chosen, "exchange", best.trace, best.evaluated, best.way)


def best_exchange(
    problem: Problem, rng: np.random.Generator, *, restarts: int = RESTARTS, pairs: bool = False
) -> Best:
    """The search of `exchange` for a checked problem."""
    criterion, first = problem.criterion, None
    if isinstance(criterion, G):
        # the worst goal pose changes from set to set: begin with the best mean
        mean = best_exchange(replace(problem, criterion=criterion.mean()), rng, restarts=restarts)
        first = mean.chosen.tolist()
    chosen, value, trace, evaluated = np.zeros(0, np.int64), -np.inf, list[float](), 0
    way = list[Index]()
    for start in range(restarts):
        if start == 0:
            begin = _first(problem, rng, first)
        elif start == 1 and isinstance(criterion, Linear):
            by_d = replace(problem, criterion=D())
            begin = best_exchange(by_d, rng, restarts=RESTARTS_OF_D).chosen
        elif start == 1 and isinstance(criterion, Total):
            by_noise = _of_noise(problem, criterion)
            begin = best_exchange(by_noise, rng, restarts=restarts, pairs=pairs).chosen
        else:
            begin = nonsingular_set(problem, rng)
        end = add_and_drop(problem, begin)
        evaluated += end.evaluated
        if not trace or criterion.rises(end.value, value):
            chosen, value = end.chosen, end.value
            way += [chosen] if way else end.way
        trace.append(criterion.figure(problem.information(chosen), problem.n_poses))
    if pairs:
        end = best_pairs(problem, chosen)
        chosen, value, evaluated = end.chosen, end.value, evaluated + end.evaluated
        way += end.way[1:]
        trace.append(criterion.figure(problem.information(chosen), problem.n_poses))
    return Best(chosen, value, trace, evaluated, way)


def _of_noise(problem: Problem, criterion: Total) -> Problem:
    """The problem without the last columns, those of inputs common to all readings."""
    p = criterion.rows.shape[2]
    return replace(
        problem,
        pool=Pool(problem.blocks[:, :, :p]),
        criterion=criterion.noise,
        before=problem.before[:, :p],
        base=problem.base[:p, :p],
    )


def _first(problem: Problem, rng: np.random.Generator, first: Sequence[int] | None) -> Index:
    """The set to start from: `first`, else the greedy set."""
    places = grow(problem).chosen if first is None else first
    begin = np.sort(np.array(places, dtype=np.int64))
    return nonsingular_set(problem, rng) if problem.is_singular(begin) else begin


@in_short
def fedorov(
    problem: Problem, rng: np.random.Generator, *, start: ArrayLike | None = None
) -> Selection:
    """Pose set by Fedorov's exchange: take the best swap of two poses until none improves the set.

    Parameters
    ----------
    problem : Problem
        Pool, number of poses and criterion.
    rng : numpy.random.Generator
        Draws the first set.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    Raises
    ------
    InputError
        A3: `start` is no set of the pool; M28: no set determines all numbers.

    References
    ----------
    Fedorov 1972.
    """
    end = best_pairs(problem, starting_set(problem, rng, start))
    figure = problem.criterion.figure(problem.information(end.chosen), problem.n_poses)
    return selection_of(problem, end.chosen, "fedorov", [figure], end.evaluated, end.way)
