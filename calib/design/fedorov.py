"""Fedorov's exchange: always the best of all pairs, one pose out and another in."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from calib.design.detmax import checked_start
from calib.design.local import best_pairs
from calib.design.problem import problem_of
from calib.design.sampling import nonsingular_set
from calib.design.selection import Selection, finished
from calib.information.criteria.base import Criterion


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
