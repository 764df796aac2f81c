"""How many poses a target needs of an arm whose joints sag and wave, as those of most arms do."""

from collections.abc import Callable
from math import sqrt
from typing import NamedTuple

import numpy as np

from calib.arrays import Index
from calib.identification.folds import FEWEST_TO_CONFIRM, FOLDS
from testbed.plan.design import MOST_POSES, quick_design
from testbed.plan.rehearsal import Rehearsals
from testbed.plan.sufficiency import Sufficiency
from testbed.plan.task import DesignTask

FEWEST = FOLDS * FEWEST_TO_CONFIRM
"""Poses below which no joint error can be confirmed, so that none is identified."""
BALL = 2.0
"""Times the standard uncertainty of a target: a ball of that radius holds at least 95 %."""
BESIDE = 1.25
"""Radii that are stated over rehearsed ones: waves that readings do not ask for are misfit of real
arms, and no rehearsal has it. Set by five virtual arms with such waves; of ten, with these among
them, seven keep to it."""
WORTH = 0.95
"""Twice as many poses must leave less than this part of a radius, or still more are not tried."""
NEAR = 1.15
"""Ratio of two numbers of poses between which no other is tried."""


class Suited(NamedTuple):
    """A set of poses, with what its calibration will state where that was looked at."""

    places: Index
    """(m,) in the pool."""
    stated: Rehearsals | None = None
    sufficiency: Sufficiency | None = None


def for_joints(
    task: DesignTask,
    places: Index,
    rehearse: Callable[[Index], Rehearsals] | None,
    rng: np.random.Generator,
) -> Suited:
    """A set for an arm whose joints sag and wave, from one that reaches the target of its links.

    It has at least as many poses as joint errors need to be confirmed, with those measured already.

    Parameters
    ----------
    task : DesignTask
        With a target.
    places : (m,) array of int
        A set that reaches it if the links alone are off, in the pool.
    rehearse : callable, optional
        What calibrations from a set state; None where no pose is held out and nothing is stated.
    rng : numpy.random.Generator
        For the search for larger sets.
    """
    before = len(task.before) // task.blocks.shape[1]
    if len(places) < (m := min(FEWEST - before, len(task.blocks))):
        places = np.sort(quick_design(task, m, rng))
    return Suited(places) if rehearse is None else _suited(task, places, before, rehearse, rng)


def _suited(
    task: DesignTask,
    places: Index,
    before: int,
    rehearse: Callable[[Index], Rehearsals],
    rng: np.random.Generator,
) -> Suited:
    """The smallest set found, no smaller than the given one, after which the target is stated.

    Where it never is, the given one: more poses were tried as long as they helped. Numbers of poses
    are compared with those measured `before`.
    """
    target, most = task.target or np.inf, min(MOST_POSES, len(task.blocks))
    allowed, worst = BALL * target, task.settings.target_is == "worst"

    def tried(places: Index) -> Suited:
        """A set and what its calibration will state."""
        stated = rehearse(places)
        radius = BESIDE * stated.mostly(worst=worst)
        return Suited(places, stated, Sufficiency(radius, allowed, len(places), radius))

    def of_size(m: int) -> Suited:
        """The same of so many poses."""
        return tried(np.sort(quick_design(task, m, rng)))

    first = low = high = tried(places)
    while not _reaches(high) and len(high.places) < most:
        low, high = high, of_size(min(2 * len(high.places) + before, most))
        if WORTH * _radius(low) < _radius(high) < np.inf:
            break
    if not _reaches(high):
        found = Sufficiency(_radius(first), allowed, len(high.places), _radius(high))
        return first._replace(sufficiency=found)
    while _many(high, before) > max(NEAR * _many(low, before), _many(low, before) + 1):
        middle = of_size(round(sqrt(_many(low, before) * _many(high, before))) - before)
        low, high = (low, middle) if _reaches(middle) else (middle, high)
    return high


def _many(one: Suited, before: int) -> int:
    """Number of poses with those measured before."""
    return len(one.places) + before


def _radius(one: Suited) -> float:
    """R95 of a set that was tried [m]."""
    return np.inf if one.sufficiency is None else one.sufficiency.radius


def _reaches(one: Suited) -> bool:
    """Whether a set that was tried reaches the target."""
    return one.sufficiency is not None and one.sufficiency.reached
