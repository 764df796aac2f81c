"""Random pose sets: one, or many with their figures for comparison."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.design.problem import Problem, problem_of
from calib.design.selection import Selection, figure_of_rows, finished
from calib.errors import InputError
from calib.information.criteria.base import Criterion
from calib.information.criteria.lazy import first_best

DRAWS = 1000
"""Random sets drawn before giving up on one that tells all numbers apart."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomSets:
    """Many random pose sets of one size, and the best of them."""

    indices: Index
    """(k, m) places in the pool, each row ascending."""
    criterion: str
    """Criterion they are judged by."""
    values: Array
    """(k,) its figure, of each set."""
    best: Selection
    """The best set."""


def random_selection(n_pool: int, m: int, rng: np.random.Generator) -> Index:
    """Places (m,) of a random set drawn from a pool without repeats, ascending."""
    if not 1 <= m <= n_pool:
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed=f"1 to {n_pool}, the poses of the pool",
            fix="enlarge the pool or choose fewer poses",
        )
    return frozen(np.sort(rng.choice(n_pool, m, replace=False)), np.int64)


def random_set(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """One random set of m poses, whatever it is worth.

    Parameters
    ----------
    blocks, m, criterion, prior, given, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng : numpy.random.Generator
        Draws the set.
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
    return finished(problem, drawn(problem, rng), trace=(), method="random", evaluations=0)


def best_of_random(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    sets: int = 100,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """Best of `sets` random sets; arguments as in `random_set`."""
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
    return _judged(problem, rng, sets).best


def random_sets(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    sets: int = 100,
) -> RandomSets:
    """Draw random sets of m poses from a pool of blocks (N, r, p) and judge each of them."""
    return _judged(problem_of(blocks, m, criterion), rng, sets)


def drawn(problem: Problem, rng: np.random.Generator) -> Index:
    """A random set (m,) of the poses that may be chosen, ascending."""
    places = np.flatnonzero(problem.open)
    return np.sort(places[rng.choice(len(places), problem.m, replace=problem.repeats)])


def nonsingular_set(problem: Problem, rng: np.random.Generator) -> Index:
    """Random set (m,) that tells all numbers apart."""
    for _ in range(DRAWS):
        chosen = drawn(problem, rng)
        if not problem.is_singular(chosen):
            return chosen
    raise InputError(
        f"none of {DRAWS} random sets of {problem.m} poses tells all {problem.p} numbers apart",
        code="M28",
        field="m",
        value=problem.m,
        fix="choose more poses, or a pool with fewer poses alike",
    )


def _judged(problem: Problem, rng: np.random.Generator, sets: int) -> RandomSets:
    """Random sets with their figures, and the best of them."""
    if sets < 1:
        raise InputError(
            f"sets is {sets}", code="A3", field="sets", value=sets, allowed="at least 1"
        )
    criterion, n = problem.criterion, problem.n_poses
    tried = np.array([drawn(problem, rng) for _ in range(sets)])
    values = np.array([figure_of_rows(problem.rows(chosen), n, criterion) for chosen in tried])
    sign = 1.0 if criterion.larger_is_better else -1.0
    best = finished(
        problem,
        tried[first_best(sign * values)],
        trace=(sign * np.maximum.accumulate(sign * values)).tolist(),
        method="best_of_random",
        evaluations=sets,
    )
    return RandomSets(frozen(tried, np.int64), criterion.name, frozen(values), best)
