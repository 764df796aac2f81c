"""Greedy selection: pose after pose, each the best next one; the first k are a set of k."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.design.blocks import sees_all
from calib.design.problem import Problem, problem_of
from calib.design.selection import Selection, finished
from calib.information.criteria.base import Criterion
from calib.information.rank import singular_values

RIDGE = 1e-6
"""Part of the pool's mean information put on the diagonal: before rank p every index is zero."""
LOST = 1e-5
"""What is known is lost beside a pose that tells more than its inverse times as much (rows)."""


class Grown(NamedTuple):
    """A set grown pose by pose."""

    chosen: list[int]
    trace: list[float]
    evaluated: int


def greedy(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator | None = None,  # noqa: ARG001 - the signature of all methods
    *,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """Pose set of size m, grown by the best next pose.

    Where prior and given poses tell (almost) nothing of a direction, a ridge stands in for it. It
    is relative per column, so that D chooses the same poses in any units; the value reported is
    without it.
    `trace` holds the figure after each pose, with the ridge.

    Parameters
    ----------
    blocks, m, criterion, prior, given, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng : numpy.random.Generator, optional
        Unused: nothing is random here.
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
    grown = grow(problem)
    return finished(
        problem, grown.chosen, trace=grown.trace, method="greedy", evaluations=grown.evaluated
    )


def grow(problem: Problem) -> Grown:
    """Poses in the order in which they are worth most."""
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
    if sees_all(problem.before):
        unit = np.sqrt(np.where(mean > 0, mean, np.diagonal(problem.base)))
        if singular_values(problem.before / unit)[-1] >= LOST:
            return problem.base
    return np.asarray(problem.base + np.diag(RIDGE * mean))
