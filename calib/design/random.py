"""Random pose sets: one, or many with their figures, to compare designs with."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen, require_count
from calib.design.borders import require_rng, require_search
from calib.design.greedy import grow
from calib.design.places import LARGER_POOL, poses_wanted
from calib.design.problem import Problem
from calib.design.selection import Selection, figure_of_rows, selection_of
from calib.errors import refuse
from calib.information.criteria.d import D
from calib.information.criteria.lazy import first_best
from calib.shown import Shown

DRAWS = 1000
"""Random sets drawn before giving up on a nonsingular one."""
UNTOLD = "M28"
"""Code of the error that no set of m poses determines all numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomFigures(Shown):
    """Many random pose sets of one size, and the best of them."""

    indices: Index
    """(k, m) indices in the pool, each row ascending."""
    criterion: str
    """Name of the criterion that judges them."""
    values: Array
    """(k,) figure of each set; zero or infinite where it leaves a number undetermined."""
    best: Selection
    """The best set."""

    def __repr__(self) -> str:
        span = f"{self.values.min():.4g} to {self.values.max():.4g}"
        count, m = self.indices.shape
        return f"RandomFigures({count} of {m} poses, {self.criterion} = {span})"


def random_selection(n_pool: int, m: int, rng: np.random.Generator) -> Index:
    """Indices (m,) of a random set drawn from a pool without repeats, ascending."""
    require_rng(rng)
    if not 1 <= require_count("m", m, 0, code="M27") <= require_count("n_pool", n_pool):
        raise poses_wanted(m, f"1 to {n_pool}, the poses of the pool", LARGER_POOL)
    return frozen(np.sort(rng.choice(n_pool, m, replace=False)), np.int64)


def random_set(problem: Problem, rng: np.random.Generator) -> Selection:
    """One random set, even if it leaves numbers undetermined."""
    require_search(problem, rng)
    return selection_of(problem, draw_set(problem, rng), "random", (), 0)


def best_of_random(problem: Problem, rng: np.random.Generator, *, sets: int = 100) -> Selection:
    """Best of `sets` random sets."""
    return random_sets(problem, rng, sets=sets).best


def random_sets(problem: Problem, rng: np.random.Generator, *, sets: int = 100) -> RandomFigures:
    """Random sets with their figures, and the best of them."""
    require_search(problem, rng)
    sets = require_count("sets", sets)
    criterion, n = problem.criterion, problem.n_poses
    tried = np.array([draw_set(problem, rng) for _ in range(sets)])
    values = np.array([figure_of_rows(problem.rows(chosen), n, criterion) for chosen in tried])
    sign = 1.0 if criterion.larger_is_better else -1.0
    trace = (sign * np.maximum.accumulate(sign * values)).tolist()
    chosen = tried[first_best(sign * values)]
    best = selection_of(problem, chosen, "best_of_random", trace, sets)
    return RandomFigures(frozen(tried, np.int64), criterion.name, frozen(values), best)


def draw_set(problem: Problem, rng: np.random.Generator) -> Index:
    """A random set (m,) of the poses that may be chosen, ascending."""
    places = np.flatnonzero(problem.open)
    return np.sort(places[rng.choice(len(places), problem.m, replace=problem.repeats)])


def nonsingular_set(problem: Problem, rng: np.random.Generator) -> Index:
    """Random set (m,) that determines all numbers, or the greedy set for D if none is drawn.

    Raises
    ------
    InputError
        M28: neither determines all numbers.
    """
    for _ in range(DRAWS):
        chosen = draw_set(problem, rng)
        if not problem.is_singular(chosen):
            return chosen
    grown = np.sort(np.array(grow(replace(problem, criterion=D())).chosen, dtype=np.int64))
    if not problem.is_singular(grown):
        return grown
    raise refuse(
        "m",
        problem.m,
        code=UNTOLD,
        message=f"no set of {problem.m} poses was found that tells all numbers apart: neither any "
        f"of {DRAWS} random ones nor the one grown pose by pose",
        fix="choose more poses, or a pool with fewer poses alike",
    )


def starting_set(
    problem: Problem, rng: np.random.Generator, start: ArrayLike | None = None
) -> Index:
    """The first set (m,) of a search, ascending: the caller's `start`, else a random one."""
    require_search(problem, rng)
    if start is None:
        return nonsingular_set(problem, rng)
    chosen = np.sort(problem.require_set(start, "start"))
    if problem.is_singular(chosen):
        message = "start leaves a direction unseen"
        raise refuse("start", code=UNTOLD, message=message, fix="start elsewhere")
    return chosen
