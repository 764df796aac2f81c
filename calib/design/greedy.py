"""Greedy selection: pose after pose, each the best next one; the first k are a set of k."""

from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from calib.design.blocks import has_full_rank
from calib.design.borders import require_problem
from calib.design.problem import Problem
from calib.design.selection import Selection, selection_of
from calib.information.rank import singular_values

RIDGE = 1e-6
"""Part of the pool's mean information put on the diagonal: before rank p every index is zero."""
ROUNDED = 1e-12
"""The same of what is known before, lest it be lost in the rounding of that."""
LOST = 1e-5
"""Prior rows smaller than this part of a pose's rows are lost in rounding."""


class Grown(NamedTuple):
    """A set grown pose by pose."""

    chosen: list[int]
    trace: list[float]
    evaluated: int


def greedy(problem: Problem) -> Selection:
    """Pose set grown by the best next pose.

    Where prior and given poses determine a direction (almost) not at all, a ridge stands in. It
    is relative per column, so that D chooses the same poses in any units; the value reported is
    without it.
    `trace` holds the figure after each pose, with the ridge.
    """
    require_problem(problem)
    grown = grow(problem)
    return selection_of(problem, grown.chosen, "greedy", grown.trace, grown.evaluated)


def grow(problem: Problem) -> Grown:
    """Poses in the order in which each adds most."""
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
    """Information (p, p) before the first pose, with a ridge unless every direction is known."""
    blocks = problem.blocks
    mean = np.einsum("jrk,jrk->k", blocks, blocks) / len(blocks)
    if has_full_rank(problem.before):
        unit = np.sqrt(np.where(mean > 0, mean, np.diagonal(problem.base)))
        if singular_values(problem.before / unit)[-1] >= LOST:
            return problem.base
    # also above the rounding of what is known already, of which one direction may be huge
    ridge = np.maximum(RIDGE * mean, ROUNDED * np.diagonal(problem.base))
    return np.asarray(problem.base + np.diag(ridge))
