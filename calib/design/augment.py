"""Design augmentation: which pose to measure next, beside those already measured."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen, require_count
from calib.design.borders import require_problem
from calib.design.problem import Problem
from calib.errors import refuse
from calib.shown import ResultTable, Shown

SHOWN = 10
"""Number of poses in a ranking by default."""


@dataclass(frozen=True, slots=True, eq=False)
class Ranking(Shown):
    """The best next poses, best first, each judged as the only one added."""

    indices: Index
    """(k,) indices in the pool."""
    gain: Array
    """(k,) change of the value of the criterion by each pose."""
    figure: Array
    """(k,) figure with that pose added."""
    before: float
    """Figure without any."""

    def __repr__(self) -> str:
        best = f"pose {self.indices[0]} takes {self.before:.4g} to {self.figure[0]:.4g}"
        return f"Ranking({len(self.indices)} next poses; {best})"

    def tables(self) -> dict[str, ResultTable]:
        """``poses``, best first: place in the pool, gain, figure with it."""
        columns = {"place": self.indices, "gain": self.gain, "figure": self.figure}
        return {"poses": ResultTable(columns)}


def best_next(problem: Problem, *, shown: int = SHOWN) -> Ranking:
    """The poses that would each add most to those already measured, best first.

    To choose several that are best together, solve the problem by `exchange`.

    Parameters
    ----------
    problem : Problem
        Its `given` or `prior` holds the poses already measured; its number of poses plays no part.
    shown : int
        Largest number of poses to list.

    Raises
    ------
    InputError
        M28: the poses already measured leave a direction undetermined.
    """
    require_problem(problem)
    shown = require_count("shown", shown)
    if problem.is_singular(()):
        raise refuse(
            "given",
            code="M28",
            message="the poses already measured leave a direction unseen: each next pose is as "
            "good as any",
            fix="choose several poses at once (calib.design.exchange)",
        )
    M = problem.base
    places = np.flatnonzero(problem.open)
    gains = problem.criterion.add(M, problem.blocks[places])
    # from the best down; of equal gains the lowest place first
    order = np.lexsort((places, -gains))[:shown]
    chosen, n = places[order], len(problem.given)
    after = [problem.criterion.figure(M + B.T @ B, n + 1) for B in problem.blocks[chosen]]
    return Ranking(
        frozen(chosen, np.int64),
        frozen(gains[order]),
        frozen(after),
        problem.criterion.figure(M, max(n, 1)),
    )
