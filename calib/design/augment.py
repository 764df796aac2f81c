"""What to measure next, beside poses already measured: the best few, and a ranking of the rest."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.design.exchange import STARTS, exchange
from calib.design.problem import problem_of
from calib.design.selection import Selection
from calib.errors import InputError
from calib.information.criteria.base import Criterion

SHOWN = 10
"""Poses in a ranking unless told otherwise."""


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


def augment(
    blocks: ArrayLike,
    given: ArrayLike,
    k: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    starts: int = STARTS,
    prior: ArrayLike | None = None,
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """The best k poses to add to a set already measured.

    Parameters
    ----------
    blocks : (N, r, p) array_like
        Whitened, scaled rows of each candidate pose.
    given : (g,) array_like of int
        Places of the poses already measured; for poses outside the pool put B'B into `prior`.
    k : int
        Poses to add.
    criterion, prior, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng, starts
        Of the exchange.
    """
    return exchange(
        blocks,
        k,
        criterion,
        rng,
        starts=starts,
        prior=prior,
        given=given,
        allowed=allowed,
        repeats=repeats,
        names=names,
    )


def best_next(
    blocks: ArrayLike,
    given: ArrayLike,
    criterion: str | Criterion,
    *,
    shown: int = SHOWN,
    prior: ArrayLike | None = None,
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Ranking:
    """The poses that would each add most to a set already measured, best first.

    Parameters
    ----------
    blocks, given, criterion, prior, allowed, repeats, names
        As in `augment`.
    shown : int
        Poses to list at most.
    """
    problem = problem_of(
        blocks,
        1,
        criterion,
        prior=prior,
        given=given,
        allowed=allowed,
        repeats=repeats,
        names=names,
    )
    if problem.is_singular(()):
        raise InputError(
            "the poses already measured leave a direction unseen: each next pose is as good as any",
            code="M28",
            field="given",
            fix="choose several poses at once (calib.design.augment.augment)",
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
