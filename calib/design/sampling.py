"""Random pose sets: one, or many with their index values for comparison."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.design.blocks import checked_blocks, is_singular
from calib.design.exchange import first_best
from calib.design.selection import Selection, finished, set_value
from calib.errors import InputError
from calib.information.observability import Criterion, known

DRAWS = 1000
"""Random sets drawn before giving up on one that tells all numbers apart."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomSets:
    """Many random pose sets of one size, and the best of them."""

    indices: Index
    """(k, m) places in the pool, each row ascending."""
    criterion: Criterion
    """Index they are judged by."""
    values: Array
    """(k,) that index, of each set."""
    best: Selection
    """The set with the largest value."""


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


def nonsingular_set(blocks: Array, m: int, rng: np.random.Generator) -> Index:
    """Random set (m,) of the pool (N, r, p) that tells all p numbers apart."""
    for _ in range(DRAWS):
        chosen = random_selection(len(blocks), m, rng)
        if not is_singular(blocks[chosen]):
            return chosen
    raise InputError(
        f"none of {DRAWS} random sets of {m} poses tells all {blocks.shape[2]} numbers apart",
        code="M28",
        field="m",
        value=m,
        fix="choose more poses, or a pool with fewer poses alike",
    )


def best_of_random(
    blocks: ArrayLike,
    m: int,
    criterion: Criterion,
    rng: np.random.Generator,
    *,
    sets: int = 100,
) -> RandomSets:
    """Draw random sets of m poses from a pool of blocks (N, r, p) and judge each by an index."""
    known(criterion)
    blocks = checked_blocks(blocks, m)
    if sets < 1:
        raise InputError(
            f"sets is {sets}", code="A3", field="sets", value=sets, allowed="at least 1"
        )
    drawn = np.array([random_selection(len(blocks), m, rng) for _ in range(sets)])
    values = np.array([set_value(blocks, chosen, criterion) for chosen in drawn])
    best = finished(
        blocks,
        drawn[first_best(values)],
        criterion,
        trace=np.maximum.accumulate(values).tolist(),
        method="random",
        evaluations=sets,
    )
    return RandomSets(frozen(drawn, np.int64), criterion, frozen(values), best)
