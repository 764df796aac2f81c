"""Greedy selection: pose after pose, each the best next one; the first k are the set of k poses."""

from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from calib.design.blocks import has_full_rank
from calib.design.borders import require_problem
from calib.design.problem import Problem
from calib.design.selection import Selection, selection_of
from calib.information.rank import singular_values

RIDGE = 1e-6
"""Part of the pool's mean information that is the ridge: below rank p every index is zero."""
ROUNDED = 1e-12
"""Least ridge as a part of the information known before, above the rounding of that."""
LOST = 1e-5
"""Prior rows smaller than this part of a pose's rows are lost in rounding."""


class Grown(NamedTuple):
    """A set grown pose by pose."""

    chosen: list[int]
    """Indices in the pool, in the order chosen."""
    trace: list[float]
    """Figure after each pose."""
    evaluated: int
    """Number of sets evaluated exactly."""


def greedy(problem: Problem) -> Selection:
    """Pose set grown by adding the best next pose m times.

    If prior and given poses leave a direction (almost) undetermined, a small diagonal ridge is
    added to M. It is relative per column, so that D chooses the same poses in any units. The value
    reported is without the ridge; `trace` holds the figure after each pose, with it.
    """
    require_problem(problem)
    grown = grow(problem)
    return selection_of(problem, grown.chosen, "greedy", grown.trace, grown.evaluated)


def grow(problem: Problem) -> Grown:
    """Grow a set of m poses, each the one that adds most to those before."""
    M, chosen, trace, evaluated = _start(problem), list[int](), list[float](), 0
    for _ in range(problem.m):
        best = problem.criterion.best_add(M, problem.pool, problem.addable(chosen))
        B = problem.blocks[best.place]
        M = M + B.T @ B
        chosen.append(best.place)
        evaluated += best.evaluated
        trace.append(problem.criterion.figure(M, len(chosen) + len(problem.given)))
    return Grown(chosen, trace, evaluated)


def _start(problem: Problem) -> Array:
    """Information (p, p) before the first pose, with a ridge unless it has full rank."""
    blocks = problem.blocks
    mean = np.einsum("jrk,jrk->k", blocks, blocks) / len(blocks)
    if has_full_rank(problem.before):
        unit = np.sqrt(np.where(mean > 0, mean, np.diagonal(problem.base)))
        if singular_values(problem.before / unit)[-1] >= LOST:
            return problem.base
    # also above the rounding of the information known before, which may be huge in one direction
    ridge = np.maximum(RIDGE * mean, ROUNDED * np.diagonal(problem.base))
    return np.asarray(problem.base + np.diag(ridge))
