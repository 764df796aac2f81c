"""Greedy selection: pose after pose, each the best next one; and what to measure next."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.design.blocks import has_full_rank
from calib.design.problem import Problem
from calib.design.selection import Selection, selection_of
from calib.errors import refuse
from calib.information.rank import singular_values

RIDGE = 1e-6
"""Part of the pool's mean information put on the diagonal: before rank p every index is zero."""
LOST = 1e-5
"""Prior rows smaller than this part of a pose's rows are lost in rounding."""
SHOWN = 10
"""Poses in a ranking by default."""


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
    return np.asarray(problem.base + np.diag(RIDGE * mean))


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """The best next poses, best first; each alone, not together."""

    indices: Index
    """(k,) places in the pool."""
    gain: Array
    """(k,) what each adds to the value of the criterion."""
    figure: Array
    """(k,) figure with that pose added."""
    before: float
    """Figure without it."""

    def __repr__(self) -> str:
        best = f"pose {self.indices[0]} takes {self.before:.4g} to {self.figure[0]:.4g}"
        return f"Ranking({len(self.indices)} next poses; {best})"


def best_next(problem: Problem, *, shown: int = SHOWN) -> Ranking:
    """The poses that would each add most to those already measured, best first.

    To choose several that are best together, solve the problem by `exchange`.

    Parameters
    ----------
    problem : Problem
        With the poses already measured in `given` or `prior`; its number of poses plays no part.
    shown : int
        Poses to list at most.
    """
    if problem.is_singular(()):
        raise refuse(
            "given",
            code="M28",
            message="the poses already measured leave a direction unseen: each next pose is as "
            "good as any",
            fix="choose several poses at once (calib.design.exchange)",
        )
    M = problem.base
    places = np.flatnonzero(problem.open)
    gains = problem.criterion.add(M, problem.blocks[places])
    # from the best down; of equal gains the lowest place first
    order = np.lexsort((places, -gains))[: max(shown, 1)]
    chosen, n = places[order], len(problem.given)
    after = [problem.criterion.figure(M + B.T @ B, n + 1) for B in problem.blocks[chosen]]
    return Ranking(
        frozen(chosen, np.int64),
        frozen(gains[order]),
        frozen(after),
        problem.criterion.figure(M, max(n, 1)),
    )
