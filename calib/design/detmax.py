"""DETMAX: add the best pose, drop the worst, until nothing improves; shake the set and repeat."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index
from calib.design.blocks import checked_blocks, information, is_singular
from calib.design.exchange import Scorer, scorer
from calib.design.sampling import nonsingular_set
from calib.design.selection import Selection, finished
from calib.errors import InputError
from calib.information.observability import Criterion, index_of

RISE = 1e-12
"""A set counts as better when its index is higher by more than this part; ties would cycle."""
SHAKES = 100
"""Shakes tried before a set that tells all numbers apart is drawn anew."""


class _Local(NamedTuple):
    """End of one add-and-drop search."""

    chosen: Index
    value: float
    evaluated: int


def detmax(
    blocks: ArrayLike,
    m: int,
    criterion: Criterion,
    rng: np.random.Generator,
    *,
    a: int = 40,
    b: int = 2,
    c: int = 1,
    d: int = 80,
    start: ArrayLike | None = None,
) -> Selection:
    """Pose set of size m that maximizes an observability index, by the paper's exchange.

    Each local search adds the pose, of all those outside, that lifts the index most, and drops the
    one that lowers it least. After it, b poses of the current set are swapped for random ones (c,
    once a searches in a row brought nothing); after d such searches the best set seen is returned.

    Parameters
    ----------
    blocks : (N, r, p) array
        Whitened, scaled rows of each candidate pose.
    m : int
        Poses to choose.
    criterion : Criterion
        ``"O1"`` to ``"O5"``, maximized in its correct form.
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
    blocks = checked_blocks(blocks, m)
    _check_constants(a, b, c, d)
    chosen = nonsingular_set(blocks, m, rng) if start is None else _checked_start(blocks, m, start)
    return search(blocks, chosen, criterion, rng, scorer(blocks, criterion), (a, b, c, d))


def search(
    blocks: Array,
    chosen: Index,
    criterion: Criterion,
    rng: np.random.Generator,
    moves: Scorer,
    constants: tuple[int, int, int, int] = (40, 2, 1, 80),
) -> Selection:
    """The whole exchange from a set `chosen` (m,), with moves from any scorer."""
    a, b, c, d = constants
    best, winner, trace = -np.inf, chosen, list[float]()
    fails = evaluated = 0
    while fails < d:
        end = _local_search(blocks, chosen, criterion, moves)
        evaluated += end.evaluated
        if end.value > best * (1 + RISE) or not trace:
            best, winner, fails = end.value, end.chosen, 0
        else:
            fails += 1
        trace.append(best)
        if len(winner) == len(blocks):
            break  # the whole pool: nothing to exchange
        chosen = _shaken(blocks, end.chosen, c if fails >= a else b, rng)
    return finished(blocks, winner, criterion, trace=trace, method="detmax", evaluations=evaluated)


def _local_search(blocks: Array, chosen: Index, criterion: Criterion, moves: Scorer) -> _Local:
    """Add the best and drop the worst until they are the same pose or the index stops rising.

    The set stays in ascending order and its information is summed afresh each round, so that a
    value belongs to a set and not to the way to it.
    """
    m, evaluated = len(chosen), 0
    inside = np.zeros(len(blocks), dtype=bool)
    inside[chosen] = True
    M = information(blocks[chosen])
    value = float(index_of(M, m, criterion))
    while not inside.all():
        added = moves.add(M, inside)
        larger = np.sort(np.append(chosen, added.place))
        B = blocks[added.place]
        dropped = moves.drop(M + B.T @ B, larger)
        evaluated += added.evaluated + dropped.evaluated
        if larger[dropped.place] == added.place:
            break
        candidate = np.delete(larger, dropped.place)
        M = information(blocks[candidate])
        reached = float(index_of(M, m, criterion))
        if not reached > value * (1 + RISE):
            break
        inside[added.place], inside[larger[dropped.place]] = True, False
        chosen, value = candidate, reached
    return _Local(chosen, value, evaluated)


def _shaken(blocks: Array, chosen: Index, swaps: int, rng: np.random.Generator) -> Index:
    """The set with `swaps` of its poses exchanged for others of the pool; still nonsingular."""
    outside = np.setdiff1d(np.arange(len(blocks)), chosen, assume_unique=True)
    swaps = min(swaps, len(chosen), len(outside))
    for _ in range(SHAKES):
        leaving = rng.choice(len(chosen), swaps, replace=False)
        entering = rng.choice(outside, swaps, replace=False)
        shaken = np.sort(np.concatenate([np.delete(chosen, leaving), entering]))
        if not is_singular(blocks[shaken]):
            return shaken
    return nonsingular_set(blocks, len(chosen), rng)


def _checked_start(blocks: Array, m: int, start: ArrayLike) -> Index:
    """A first set (m,) given by the caller, in ascending order."""
    chosen = np.unique(np.asarray(start, dtype=np.int64))
    if np.shape(start) != (m,) or len(chosen) != m or chosen[0] < 0 or chosen[-1] >= len(blocks):
        raise InputError(
            "start is not a set of places in the pool",
            code="A3",
            field="start",
            allowed=f"{m} different numbers from 0 to {len(blocks) - 1}",
        )
    if is_singular(blocks[chosen]):
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
