"""How many poses a target needs: what designed sets reach, and what is proven out of reach."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index, frozen, require_count
from calib.design.borders import require_counts, require_search
from calib.design.certificate import certificate_of_bound
from calib.design.exchange import best_exchange
from calib.design.problem import NO_POSES, Problem
from calib.design.random import UNTOLD
from calib.design.relaxation import Grams, relaxation
from calib.errors import InputError, refuse
from calib.information.criteria.base import Certifiable
from calib.shown import ResultTable, Shown, length_unit

RESTARTS = 3
"""Number of local searches at each number of poses."""
STEP = 1.25
"""Ratio of neighboring numbers of poses on the curve."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseBudget(Shown):
    """Uncertainty against the number of poses: of designed sets, and its proven lower bound."""

    criterion: str
    """``"V"`` or ``"G"``, or another criterion whose figure falls with more poses."""
    target: float
    """Figure asked for: standard uncertainty of the tool point [m]."""
    counts: Index
    """(k,) numbers of poses, ascending."""
    reached: Array
    """(k,) figure of the designed set of each size [m]; inf if none was found that determines all
    numbers."""
    possible: Array
    """(k,) lower bound on the figure of any set of that size [m]."""
    sets: tuple[Index, ...]
    """(k,) designed sets (m,); empty where there is none."""
    smallest: int | None
    """Fewest poses with which a designed set reaches the target; None if none does."""
    proven: int | None
    """No set of fewer poses reaches the target; 0 if it is reached without any, None if the bound
    excludes every number looked at."""
    chosen: Index
    """(m,) designed set of `smallest` poses, or of the largest number looked at."""
    sentence: str
    """The result in words."""

    def __repr__(self) -> str:
        return f"PoseBudget({self.criterion}: {self.sentence})"

    def tables(self) -> dict[str, ResultTable]:
        """``curve``: figures against the number of poses, reached and possible at all."""
        curve = {"poses": self.counts, "reached": self.reached, "possible": self.possible}
        return {"curve": ResultTable(curve)}


class _Point(NamedTuple):
    """One number of poses."""

    chosen: Index  # the designed set
    reached: float  # its figure
    possible: float  # the figure that no set of so many poses can better


class _Curve:
    """Designed sets and bounds of one problem at any number of poses, each computed once."""

    def __init__(
        self, problem: Problem, criterion: Certifiable, rng: np.random.Generator, restarts: int
    ) -> None:
        self.problem, self.criterion, self.rng, self.restarts = problem, criterion, rng, restarts
        self.packed = Grams(problem.blocks[problem.open])
        self.points: dict[int, _Point] = {}

    def at(self, m: int) -> _Point:
        """Designed set and bound for m poses."""
        if m not in self.points:
            problem = self.problem.resize(m)
            relaxed = relaxation(problem, packed=self.packed)
            try:
                best = best_exchange(problem, self.rng, restarts=self.restarts)
            except InputError as error:
                if error.code != UNTOLD:
                    raise
                # there are equations enough, and still each set leaves a direction undetermined
                self.points[m] = _Point(NO_POSES, np.inf, relaxed.figure)
            else:
                limit = certificate_of_bound(problem, self.criterion, best.value, relaxed.bound)
                self.points[m] = _Point(best.chosen, limit.figure, limit.figure_bound)
        return self.points[m]

    def fewest(
        self, figure: Callable[[_Point], float], target: float, low: int, high: int
    ) -> int | None:
        """Fewest poses in low..high whose figure reaches the target, by bisection."""
        if figure(self.at(high)) > target:
            return None
        while low < high:
            middle = (low + high) // 2
            if figure(self.at(middle)) <= target:
                high = middle
            else:
                low = middle + 1
        return high


def pose_budget(
    problem: Problem,
    target: float,
    rng: np.random.Generator,
    *,
    counts: Sequence[int] | None = None,
    restarts: int = RESTARTS,
) -> PoseBudget:
    """Fewest poses that reach a target, the proven least number, and the curve of both.

    Parameters
    ----------
    problem : Problem
        With criterion V or G (or A); its number of poses is the largest looked at.
    target : float
        Standard uncertainty of the tool point asked for, RMS (V) or largest (G) over the goal [m];
        U / 2 for an expanded uncertainty U with k = 2.
    rng : numpy.random.Generator
        Draws the starts of each design.
    counts : sequence of int, optional
        Numbers of poses to look at; by default from the fewest possible, each a quarter more than
        the last, to the first beyond the target.
    restarts : int
        Number of local searches at each number of poses.

    Raises
    ------
    InputError
        A4: the criterion is not V, G or A; A3: `target` is not above zero; M27: `counts` holds
        numbers of poses that the pool does not allow.
    """
    require_search(problem, rng)
    criterion, restarts = problem.criterion, require_count("restarts", restarts)
    if not isinstance(criterion, Certifiable) or criterion.larger_is_better:
        raise refuse(
            "criterion",
            criterion.name,
            "V or G, with goal poses",
            code="A4",
            message=f"a pose budget cannot be made by {criterion.name}",
        )
    if not (isinstance(target, Real) and 0 < target < np.inf):
        raise refuse("target", target, "above zero", code="A3", message=f"target is {target} m")
    # where poses may repeat, a set may be larger than the pool
    most, least = np.inf if problem.repeats else int(problem.open.sum()), problem.fewest
    curve = _Curve(problem, criterion, rng, restarts)
    grid = _grid(least, problem.m) if counts is None else np.unique(require_counts(counts)).tolist()
    if not grid or grid[0] < least or grid[-1] > most:
        wanted = f"{least} or more" if problem.repeats else f"{least} to {most}"
        message = "counts holds numbers of poses that cannot be"
        raise refuse("counts", allowed=wanted, code="M27", message=message)
    # climb the grid until a designed set reaches the target
    low, high = grid[0], grid[-1]
    if counts is None:
        for high in grid:
            if curve.at(high).reached <= target:
                break
            low = high + 1
        shown = [m for m in grid if m <= high or grid.index(m) == grid.index(high) + 1]
    else:
        shown = grid
    # bisect between the last two numbers, and below for the bound
    smallest = curve.fewest(lambda point: point.reached, target, min(low, high), high)
    if smallest is None:
        # with inputs common to all readings a larger set may be worse than a smaller one
        smallest = next((m for m in shown if curve.at(m).reached <= target), None)
    if smallest is not None:
        # a larger designed set is not always better: take the smallest of all that were made
        smallest = min(m for m, point in curve.points.items() if point.reached <= target)
    last = high if smallest is None else smallest
    proven = curve.fewest(lambda point: point.possible, target, least, last)
    known = np.inf
    if not problem.is_singular(()):
        known = criterion.figure(problem.base, max(len(problem.given), 1))
        proven = 0 if known <= target else proven
    sizes = sorted({*shown, *filter(None, (smallest, proven))})
    points = [curve.at(m) for m in sizes]
    return PoseBudget(
        criterion=criterion.name,
        target=float(target),
        counts=frozen(sizes, np.int64),
        reached=frozen([point.reached for point in points]),
        possible=frozen([point.possible for point in points]),
        sets=tuple(frozen(point.chosen, np.int64) for point in points),
        smallest=smallest,
        proven=proven,
        chosen=frozen(curve.at(last).chosen, np.int64),
        sentence=_sentence(target, smallest, proven, high, curve, known),
    )


def _grid(least: int, top: int) -> list[int]:
    """Numbers of poses from `least` to `top`, each a quarter more than the last."""
    grid = [least]
    while grid[-1] < top:
        grid.append(min(max(round(grid[-1] * STEP), grid[-1] + 1), top))
    return grid


def _sentence(
    target: float, smallest: int | None, proven: int | None, high: int, curve: _Curve, known: float
) -> str:
    """The budget in words; `known` is the figure before any pose of it."""
    figure = bound = np.inf
    if smallest is None and known > target:
        _, figure, bound = curve.at(high)
    scale, unit = length_unit([target, figure, bound])
    asked = f"u = {target * scale:.4g} {unit}"
    if known <= target:
        without = f"{known * scale:.4g} {unit} without a pose"
        return f"{asked} is reached by what is known before: {without}"
    if smallest is None:
        words = f"{asked} is not reached with {high} poses: "
        if np.isfinite(figure):
            words += f"the designed set gives {figure * scale:.4g} {unit}"
        else:
            words += "no set of so many was found that tells all numbers apart"
        if proven is None:
            return words + f", and no set of {high} gives less than {bound * scale:.4g} {unit}"
        return words + f"; fewer than {proven} poses are proven to be too few"
    reach = "1 pose reaches" if smallest == 1 else f"{smallest} poses reach"
    if proven == smallest:
        return f"{reach} {asked}, and no fewer can"
    return f"{reach} {asked}; fewer than {proven} are proven to be too few"
