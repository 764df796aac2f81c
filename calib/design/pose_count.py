"""How many poses are enough: observability indices of random sets against their size."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen, require_count, require_numbers, wrong_shape
from calib.design.borders import require_counts, require_search
from calib.design.problem import Problem
from calib.errors import refuse
from calib.information.observability import (
    CRITERIA,
    Form,
    IndexName,
    check_index,
    index_of,
    index_of_singular,
    singular_of_information,
)
from calib.shown import ResultTable, Shown

WINDOW = 10
"""Number of values on either side of a number of poses whose means are compared."""
SETTLED = 0.005
"""The index is stable if the two means differ by less than this part."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseCount(Shown):
    """Mean index of random sets against the number of poses."""

    criterion: IndexName
    """Observability index."""
    form: Form
    """Form of the index; O3 to O5 become stable only per pose."""
    counts: Index
    """(k,) numbers of poses."""
    mean: Array
    """(k,) mean of the index over the random sets."""
    sd: Array
    """(k,) standard deviation over the random sets."""
    chosen: int | None
    """First number of poses from which the mean is stable; None if it is not within `counts`."""

    def __repr__(self) -> str:
        stable = "not stable" if self.chosen is None else f"stable from {self.chosen}"
        return f"PoseCount({self.criterion} of {self.counts[0]} to {self.counts[-1]}, {stable})"

    def tables(self) -> dict[str, ResultTable]:
        """``curve``: the index against the number of poses."""
        return {"curve": ResultTable({"poses": self.counts, "mean": self.mean, "sd": self.sd})}


def pose_count(
    problem: Problem,
    rng: np.random.Generator,
    *,
    counts: Iterable[int] | None = None,
    sets: int = 50,
    form: Form = "per_pose",
) -> tuple[PoseCount, ...]:
    """For each index O1 to O5, its mean over random sets and the number of poses that suffices.

    Each random set grows by one random pose at a time, so that every size has `sets` random sets of
    the poses that may be chosen; with `repeats` a pose may come more than once.

    Parameters
    ----------
    problem : Problem
        The pool; its criterion and what is known before play no part.
    rng : numpy.random.Generator
        Draws the sets.
    counts : iterable of int, optional
        Ascending numbers of poses; by default from the fewest that can reach full rank to the
        problem's own.
    sets : int
        Number of random sets of each size.
    form : Form
        Form of the indices.

    Raises
    ------
    InputError
        A3: `counts` does not ascend; A4: there is no such `form`; M27: a number of poses is not
        possible.

    References
    ----------
    Wen et al. 2022, section 3.1 ("is stable"); the rule is that of `stable_count`.
    """
    require_search(problem, rng)
    check_index(CRITERIA[0], form)
    sizes = _sizes(problem, counts)
    sets = require_count("sets", sets)
    values = []
    for M in _growing(problem, sizes, sets, rng):
        singular = singular_of_information(M)
        # the determinant is exact where the smallest eigenvalue is mostly rounding
        one = index_of(M, sizes, "O1", form)
        others = (index_of_singular(singular, sizes, c, form) for c in CRITERIA[1:])
        values.append([one, *others])
    return tuple(
        _curve(curve, sizes, criterion, form)
        for curve, criterion in zip(np.swapaxes(values, 0, 1), CRITERIA, strict=True)
    )


def stable_count(counts: ArrayLike, mean: ArrayLike, *, window: int = WINDOW) -> int | None:
    """First number of poses at which the index is stable; None if there is none.

    The mean of the `window` values from it on differs from that of the `window` values before it by
    less than the part `SETTLED`.

    References
    ----------
    Wen et al. 2022, section 3.1, made definite: |mean after - mean before| < 0.5 % of mean before.
    """
    sizes, values = np.asarray(counts), require_numbers("mean", mean)
    window = require_count("window", window)
    if sizes.shape != values.shape or sizes.ndim != 1:
        raise wrong_shape("mean", values.shape, "one for each of counts")
    if len(values) < 2 * window:
        return None
    total = np.concatenate([[0.0], np.cumsum(values)])
    average = (total[window:] - total[:-window]) / window
    before, after = average[: -window or None], average[window:]
    stable = np.abs(after - before) < SETTLED * np.abs(before)
    return int(sizes[window + np.argmax(stable)]) if stable.any() else None


def _sizes(problem: Problem, counts: Iterable[int] | None) -> Index:
    """Checked numbers of poses (k,), ascending."""
    if counts is None:
        return np.arange(problem.fewest, problem.m + 1)
    sizes = require_counts(counts)
    if not sizes.size or (np.diff(sizes) <= 0).any():
        raise refuse("counts", allowed="at least one", code="A3", message="counts must ascend")
    for size in sizes[[0, -1]]:
        problem.resize(int(size))
    return sizes


def _growing(
    problem: Problem, sizes: Index, sets: int, rng: np.random.Generator
) -> Iterable[Array]:
    """For each random order of the poses, the information (k, p, p) of its first sizes[k] poses."""
    places = np.flatnonzero(problem.open)
    for _ in range(sets):
        if problem.repeats:
            order = rng.choice(len(places), sizes[-1])
        else:
            order = rng.permutation(len(places))[: sizes[-1]]
        B = problem.blocks[places[order]]
        yield np.cumsum(np.swapaxes(B, 1, 2) @ B, axis=0)[sizes - 1]


def _curve(values: Array, sizes: Index, criterion: IndexName, form: Form) -> PoseCount:
    """Mean, spread and stable number of index values (sets, k)."""
    mean = values.mean(0)
    # a single set has no spread
    sd = values.std(0, ddof=1) if len(values) > 1 else np.zeros(len(sizes))
    return PoseCount(
        criterion,
        form,
        frozen(sizes, np.int64),
        frozen(mean),
        frozen(sd),
        stable_count(sizes, mean),
    )
