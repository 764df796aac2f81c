"""DETMAX: add the best pose, drop the worst, until nothing improves; shake the set and repeat."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Index
from calib.design.local import add_and_drop, shaken
from calib.design.problem import Problem, problem_of
from calib.design.random import nonsingular_set
from calib.design.selection import Selection, finished
from calib.errors import InputError
from calib.information.criteria.base import Criterion


def detmax(
    blocks: ArrayLike,
    m: int,
    criterion: str | Criterion,
    rng: np.random.Generator,
    *,
    a: int = 40,
    b: int = 2,
    c: int = 1,
    d: int = 80,
    start: ArrayLike | None = None,
    prior: ArrayLike | None = None,
    given: ArrayLike = (),
    allowed: ArrayLike | None = None,
    repeats: bool = False,
    names: Sequence[str] = (),
) -> Selection:
    """Pose set of size m that maximizes a criterion, by the paper's exchange.

    Each local search adds the pose, of all those outside, that lifts the value most, and drops the
    one that lowers it least. After it, b poses of the current set are swapped for random ones (c,
    once a searches in a row brought nothing); after d such searches the best set seen is returned.

    Parameters
    ----------
    blocks, m, criterion, prior, given, allowed, repeats, names
        The problem, as in `calib.design.problem.problem_of`.
    rng : numpy.random.Generator
        Draws the first set and the swaps.
    a, b, c, d : int
        The paper's constants.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    References
    ----------
    Wen et al. 2022, section 2.3, with candidates 1..X in step 4 and the root 1/p in O1;
    Mitchell 1974.
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
    _check_constants(a, b, c, d)
    chosen = nonsingular_set(problem, rng) if start is None else checked_start(problem, start)
    return search(problem, chosen, rng, (a, b, c, d))


def search(
    problem: Problem,
    chosen: Index,
    rng: np.random.Generator,
    constants: tuple[int, int, int, int] = (40, 2, 1, 80),
) -> Selection:
    """The whole exchange of a checked problem, from a set `chosen` (m,)."""
    a, b, c, d = constants
    criterion = problem.criterion
    best, winner, trace = -np.inf, chosen, list[float]()
    fails = evaluated = 0
    while fails < d:
        end = add_and_drop(problem, chosen)
        evaluated += end.evaluated
        if not trace or criterion.rises(end.value, best):
            best, winner, fails = end.value, end.chosen, 0
            figure = criterion.figure(problem.information(winner), problem.n_poses)
        else:
            fails += 1
        trace.append(figure)
        if not problem.addable(end.chosen).any():
            break  # the whole pool: nothing to exchange
        chosen = shaken(problem, end.chosen, c if fails >= a else b, rng)
    return finished(problem, winner, trace=trace, method="detmax", evaluations=evaluated)


def checked_start(problem: Problem, start: ArrayLike) -> Index:
    """A first set (m,) given by the caller, in ascending order."""
    chosen = np.sort(problem.checked_set(start, "start"))
    if problem.is_singular(chosen):
        raise InputError(
            "start leaves a direction unseen", code="M28", field="start", fix="start elsewhere"
        )
    return chosen


def _check_constants(a: int, b: int, c: int, d: int) -> None:
    """Refuse constants that would never shake or never stop."""
    for name, value, lowest in (("a", a, 0), ("b", b, 1), ("c", c, 1), ("d", d, 1)):
        if value < lowest:
            raise InputError(
                f"{name} is {value}",
                code="A3",
                field=name,
                value=value,
                allowed=f"at least {lowest}",
            )
