"""How many poses are enough: indices of random sets against their size, and where they settle."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.design.blocks import fewest_poses
from calib.design.problem import problem_of
from calib.errors import InputError
from calib.information.observability import (
    CRITERIA,
    Criterion,
    Form,
    index_of,
    index_of_singular,
    known,
    singular_of_information,
)

WINDOW = 10
"""Values on either side of a pose number that are compared."""
SETTLED = 0.005
"""The index has settled when the two means differ by less than this part."""
LARGEST = 150
"""Largest pose number looked at unless told otherwise."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseCount:
    """Mean index of random sets against the number of poses."""

    criterion: Criterion
    """Index."""
    form: Form
    """Its form; O3 to O5 settle only per pose."""
    counts: Index
    """(k,) numbers of poses."""
    mean: Array
    """(k,) mean of the index over the random sets."""
    sd: Array
    """(k,) standard deviation over the random sets."""
    chosen: int | None
    """First number of poses from which the mean is stable; None if it is not within `counts`."""


def pose_count(
    blocks: ArrayLike,
    criterion: Criterion,
    *,
    rng: np.random.Generator,
    counts: Iterable[int] | None = None,
    sets: int = 50,
    form: Form = "per_pose",
) -> PoseCount:
    """Number of poses from which an index no longer improves, from random sets.

    Each set grows by one random pose at a time, so every size sees `sets` random sets.

    Parameters
    ----------
    blocks : (N, r, p) array
        Whitened, scaled rows of each candidate pose.
    criterion : Criterion
        ``"O1"`` to ``"O5"``.
    rng : numpy.random.Generator
        Draws the sets.
    counts : iterable of int, optional
        Ascending numbers of poses; by default from the fewest that can reach full rank to 150.
    sets : int
        Random sets per number.
    form : Form
        Form of the index.

    References
    ----------
    Wen et al. 2022, section 3.1 ("is stable"); the rule is that of `settled`.
    """
    known(criterion, form)
    blocks, sizes = _checked(blocks, counts, sets)
    values = np.array(
        [index_of(M, sizes, criterion, form) for M in _growing(blocks, sizes, sets, rng)]
    )
    return _summary(values, sizes, criterion, form)


def pose_counts(
    blocks: ArrayLike,
    *,
    rng: np.random.Generator,
    counts: Iterable[int] | None = None,
    sets: int = 50,
    form: Form = "per_pose",
) -> tuple[PoseCount, ...]:
    """The curves of all five indices O1 to O5 from the same random sets; see `pose_count`."""
    known(CRITERIA[0], form)
    blocks, sizes = _checked(blocks, counts, sets)
    values = []
    for M in _growing(blocks, sizes, sets, rng):
        singular = singular_of_information(M)
        # the determinant is exact where the smallest eigenvalue is mostly rounding
        one = index_of(M, sizes, "O1", form)
        others = (index_of_singular(singular, sizes, c, form) for c in CRITERIA[1:])
        values.append([one, *others])
    return tuple(
        _summary(curve, sizes, criterion, form)
        for curve, criterion in zip(np.swapaxes(values, 0, 1), CRITERIA, strict=True)
    )


def settled(
    counts: ArrayLike, mean: ArrayLike, *, window: int = WINDOW, tolerance: float = SETTLED
) -> int | None:
    """First count whose next `window` means, itself included, average like the previous `window`.

    None if that never happens.

    References
    ----------
    Wen et al. 2022, section 3.1, made definite: |mean after - mean before| < 0.5 % of the latter.
    """
    sizes, values = np.asarray(counts), np.asarray(mean)
    if len(values) < 2 * window:
        return None
    total = np.concatenate([[0.0], np.cumsum(values)])
    average = (total[window:] - total[:-window]) / window
    before, after = average[: -window or None], average[window:]
    stable = np.abs(after - before) < tolerance * np.abs(before)
    return int(sizes[window + np.argmax(stable)]) if stable.any() else None


def _checked(blocks: ArrayLike, counts: Iterable[int] | None, sets: int) -> tuple[Array, Index]:
    """Blocks and pose numbers, after refusing those that cannot be."""
    given = None if counts is None else np.asarray(list(counts), dtype=np.int64)
    if given is not None and (not given.size or (np.diff(given) <= 0).any()):
        raise InputError("counts must ascend", code="A3", field="counts", allowed="at least one")
    if sets < 1:
        raise InputError(
            f"sets is {sets}", code="A3", field="sets", value=sets, allowed="at least 1"
        )
    if given is not None:
        problem_of(blocks, int(given[0]), "D")
        return problem_of(blocks, int(given[-1]), "D").blocks, given
    blocks = problem_of(blocks, max(len(np.asarray(blocks)), 1), "D").blocks
    return blocks, np.arange(fewest_poses(blocks), min(LARGEST, len(blocks)) + 1)


def _growing(blocks: Array, sizes: Index, sets: int, rng: np.random.Generator) -> Iterable[Array]:
    """Per random order of the pool, the information (k, p, p) of its first sizes[k] poses."""
    for _ in range(sets):
        B = blocks[rng.permutation(len(blocks))[: sizes[-1]]]
        yield np.cumsum(np.swapaxes(B, 1, 2) @ B, axis=0)[sizes - 1]


def _summary(values: Array, sizes: Index, criterion: Criterion, form: Form) -> PoseCount:
    """Curve of index values (sets, k)."""
    mean = values.mean(0)
    # a single set has no spread
    sd = values.std(0, ddof=1) if len(values) > 1 else np.zeros(len(sizes))
    return PoseCount(
        criterion, form, frozen(sizes, np.int64), frozen(mean), frozen(sd), settled(sizes, mean)
    )
