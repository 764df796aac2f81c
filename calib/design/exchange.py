"""Exchange of poses from many starts; Fedorov's step takes the best of all pairs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Index
from calib.design.detmax import checked_start
from calib.design.greedy import grow
from calib.design.local import add_and_drop, best_pairs
from calib.design.problem import Problem, problem_of
from calib.design.random import nonsingular_set
from calib.design.selection import Selection, finished
from calib.errors import InputError
from calib.information.criteria.base import Criterion
from calib.information.criteria.d import D
from calib.information.criteria.g import G
from calib.information.criteria.linear import Linear

STARTS = 6
"""Starts unless told otherwise: the greedy set, for A and V the best for D, the others random."""
STARTS_OF_D = 2
"""Starts of that search for D."""
PAIRS_OF_G = 5000
"""Exchanges of two poses that G tries at most: each needs every goal pose."""


class Best(NamedTuple):
    """The best of several local searches."""

    chosen: Index
    value: float
    trace: list[float]
    evaluated: int


def exchange(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    starts: int = STARTS,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """Pose set of size m that no exchange improves, the best from several starts.

    The first start is the greedy set, so that the result is never worse than that. The second, for
    A and V, is the best set found for D: variances have more local optima than the determinant.
    From each, the best pose is added and the worst dropped until nothing changes; the best of the
    ends goes on by best pairs until no exchange of two poses helps. G begins with the best set for
    the mean instead of the greedy one, and tries pairs in small pools only.

    Parameters
    ----------
    blocks, m, criterion, prior, given, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng : numpy.random.Generator
        Draws the other starts.
    starts : int
        Number of starts.

    References
    ----------
    Mitchell 1974 (add and drop); Fedorov 1972 (pairs).
    """
    problem = problem_of(
        blocks,
        m,
        criterion,
        prior=prior,
        given=given,
        allowed=allowed,
        repeats=repeats,
        names=names,
    )
    if starts < 1:
        raise InputError(
            f"starts is {starts}", code="A3", field="starts", value=starts, allowed="at least 1"
        )
    pairs = not isinstance(problem.criterion, G) or m * len(problem.pool) <= PAIRS_OF_G
    best = best_exchange(problem, rng, starts=starts, pairs=pairs)
    return finished(
        problem, best.chosen, trace=best.trace, method="exchange", evaluations=best.evaluated
    )


def best_exchange(
    problem: Problem,
    rng: np.random.Generator,
    *,
    starts: int = STARTS,
    first: Sequence[int] | None = None,
    pairs: bool = False,
) -> Best:
    """The search of a checked problem, from `first` (else the greedy set) and random sets."""
    criterion = problem.criterion
    if isinstance(criterion, G):
        # the worst goal pose changes from set to set: the best mean is where to begin
        mean = best_exchange(replace(problem, criterion=criterion.mean()), rng, starts=starts)
        first = mean.chosen.tolist()
    chosen, value, trace, evaluated = np.zeros(0, np.int64), -np.inf, list[float](), 0
    for start in range(starts):
        if start == 0:
            begin = _first(problem, rng, first)
        elif start == 1 and isinstance(criterion, Linear):
            by_d = replace(problem, criterion=D())
            begin = best_exchange(by_d, rng, starts=STARTS_OF_D).chosen
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
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    start: ArrayLike | None = None,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """Pose set of size m from one start, until no exchange of one pose improves it.

    Parameters
    ----------
    blocks, m, criterion, prior, given, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng : numpy.random.Generator
        Draws the first set.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    References
    ----------
    Fedorov 1972.
    """
    problem = problem_of(
        blocks,
        m,
        criterion,
        prior=prior,
        given=given,
        allowed=allowed,
        repeats=repeats,
        names=names,
    )
    chosen = nonsingular_set(problem, rng) if start is None else checked_start(problem, start)
    end = best_pairs(problem, chosen)
    figure = problem.criterion.figure(problem.information(end.chosen), problem.n_poses)
    return finished(
        problem, end.chosen, trace=[figure], method="fedorov", evaluations=end.evaluated
    )
