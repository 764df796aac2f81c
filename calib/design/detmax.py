"""DETMAX: add the best pose, drop the worst, until nothing improves; shake the set and repeat."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Index, require_count
from calib.design.borders import require_search
from calib.design.local import add_and_drop, shake
from calib.design.problem import Problem
from calib.design.random import starting_set
from calib.design.selection import Selection, selection_of
from calib.errors import refuse
from calib.kinds import in_short

SWAPS = (2, 1)
"""Constants b and c of Wen et al.; fewer where set or pool are too small for them."""


@in_short
def detmax(
    problem: Problem,
    rng: np.random.Generator,
    *,
    a: int = 40,
    b: int = SWAPS[0],
    c: int = SWAPS[1],
    d: int = 80,
    start: ArrayLike | None = None,
) -> Selection:
    """Pose set by DETMAX: local searches from randomly perturbed sets.

    Each local search adds the outside pose that raises the value most and drops the one that lowers
    it least, until nothing improves. Then b poses of the current set are swapped for random ones,
    or c once a searches in a row brought no improvement; after d such searches the best set is
    returned.

    Parameters
    ----------
    problem : Problem
        Pool, number of poses and criterion.
    rng : numpy.random.Generator
        Draws the first set and the swaps.
    a, b, c, d : int
        Constants of Wen et al.; b and c at most the size of the set, and of the rest of the pool.
    start : (m,) array of int, optional
        First set, instead of a random one; the result is never worse.

    Raises
    ------
    InputError
        A3: a constant or `start` is not possible; M28: no set determines all numbers.

    References
    ----------
    Wen et al. 2022, section 2.3, with candidates 1..X in step 4 and the root 1/p in O1;
    Mitchell 1974.
    """
    require_search(problem, rng)
    for name, constant, lowest in (("a", a, 0), ("b", b, 1), ("c", c, 1), ("d", d, 1)):
        require_count(name, constant, lowest)  # else it would never shake, or never stop
    others = int(problem.open.sum()) - (0 if problem.repeats else problem.m)
    for name, constant, usual in zip("bc", (b, c), SWAPS, strict=True):
        if others and constant > min(problem.m, others) and constant != usual:
            allowed = f"at most {min(problem.m, others)}"
            here = f"the set has {problem.m} poses to swap, the pool {others} others"
            raise refuse(name, constant, allowed, code="A3", fix=here)
    chosen, criterion = starting_set(problem, rng, start), problem.criterion
    best, winner, trace = -np.inf, chosen, list[float]()
    fails, evaluated, way = 0, 0, list[Index]()
    while fails < d:
        end = add_and_drop(problem, chosen)
        evaluated += end.evaluated
        if not trace or criterion.rises(end.value, best):
            best, winner, fails = end.value, end.chosen, 0
            figure = criterion.figure(problem.information(winner), problem.n_poses)
            way += [winner] if way else end.way
        else:
            fails += 1
        trace.append(figure)
        if not problem.addable(end.chosen).any():
            break  # the whole pool: nothing to exchange
        chosen = shake(problem, end.chosen, c if fails >= a else b, rng)
    return selection_of(problem, winner, "detmax", trace, evaluated, way)
