"""A plan of poses that free ways lead to: it is made anew without those that none does."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.errors import InputError
from testbed.laboratory.pool import PosePool
from testbed.plan.for_joints import Suited
from testbed.plan.records import Curve, Tour
from testbed.plan.task import DesignTask

ANEW = 5
"""Times that a plan is made anew at most."""
CUT_OFF = "no free way"
"""Why a candidate is left out that is feasible by itself."""


class Made(NamedTuple):
    """A set, its tour, and what both are chosen from."""

    pool: PosePool
    apart: Array
    """(h, n) held-out poses [rad, m]."""
    task: DesignTask
    suited: Suited
    """The set."""
    method: str
    curve: Curve
    tour: Tour


def reached(
    made: Callable[[PosePool, Array], Made], pool: PosePool, beside: Callable[[Array, Array], Bool]
) -> Made:
    """A plan whose poses free ways lead to, if it can be had.

    As it is at first where no way leads to most of its poses, for then it is the start that none
    leads away from, where there is no end of such poses, or too few others.

    Parameters
    ----------
    made : callable
        Makes a plan from a pool, without poses (k, n) among those held out [rad, m].
    pool : PosePool
        Candidates.
    beside : callable
        Which of some postures (N, n) lie beside others (k, n): a free move leads there. To what
        lies beside a pose that no way leads to, none does.
    """
    lost = np.zeros((0, pool.q.shape[1]))
    first = found = made(pool, lost)
    for _ in range(ANEW):
        cut = np.array(found.tour.cut_off, dtype=np.int64)
        if not len(cut):
            return found
        if 2 * len(cut) > len(found.tour):
            break
        lost = np.vstack([lost, found.tour.q[cut]])
        gone = beside(found.pool.q, lost)
        places = found.tour.pool_place[cut]
        gone[places[places >= 0]] = True
        try:
            found = made(without(found.pool, np.flatnonzero(gone)), lost)
        except InputError:
            break
    return first if found.tour.cut_off else found


def elsewhere(
    draw: Callable[[Array], Array], lost: Array, beside: Callable[[Array, Array], Bool]
) -> Array:
    """Held-out poses (h, n) that do not lie beside poses lost (k, n), as far as they can be had.

    Drawn without those that `draw` is told of.
    """
    found = draw(lost)
    for _ in range(ANEW if len(lost) else 0):
        gone = beside(found, lost)
        if not gone.any():
            break
        lost = np.vstack([lost, found[gone]])
        found = draw(lost)
    return found


def without(pool: PosePool, places: Index) -> PosePool:
    """A pool without candidates at some places (k,), counted among those refused."""
    names, counts = pool.rejection_names, pool.rejection_counts
    if CUT_OFF not in names:
        names, counts = (*names, CUT_OFF), np.append(counts, 0)
    kept = np.setdiff1d(np.arange(len(pool.q)), places)
    now = np.array([name == CUT_OFF for name in names])
    return replace(
        pool,
        q=frozen(pool.q[kept]),
        T=frozen(pool.T[kept]),
        rejected_q=frozen(np.vstack([pool.rejected_q, pool.q[places]])),
        rejected_reason=(*pool.rejected_reason, *[CUT_OFF] * len(places)),
        rejection_names=names,
        rejection_counts=frozen(counts + len(places) * now, np.int64),
    )
