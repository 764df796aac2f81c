"""The result of a pose selection: which poses, how good, by which method, what is proven."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import LATER, Array, Index, frozen
from calib.design.blocks import has_full_rank
from calib.design.certificate import Certificate, certificate_of, no_proof
from calib.design.problem import NO_POSES, Problem
from calib.information.criteria.base import Criterion
from calib.information.observability import index_of_singular
from calib.information.rank import singular_values
from calib.shown import ResultTable, Shown


@dataclass(frozen=True, slots=True, eq=False)
class Selection(Shown):
    """A pose set chosen from a pool."""

    indices: Annotated[Index, "m"]
    """(m,) indices in the pool, none twice unless repeats are allowed."""
    criterion: str
    """Name of the criterion that was optimized, as it was asked for."""
    value: float
    """Figure of the criterion, with the poses given: O1 to O5 from the singular values of the
    stacked rows (D as O1, E as O3); u of the tool point for V and G [m]; for A the root of the sum
    of variances, in scaled units. This is `Certificate.figure`, not `Certificate.value`."""
    trace: Annotated[Array, "t"]
    """(t,) best figure after each local search, draw or step."""
    method: str
    """Name of the algorithm, such as ``"greedy"``, ``"detmax"`` or ``"exchange"``."""
    searches: int
    """Number of local searches, draws or steps."""
    evaluations: int
    """Number of candidate sets evaluated exactly; bounds excluded the others."""
    certificate: Certificate | None = None
    """Proven bound; None where there is none (see `proof`)."""
    given: Annotated[Index, "k"] = field(default_factory=lambda: NO_POSES)
    """(k,) indices of poses already measured, counted in the value."""
    prior: bool = False
    """Whether a prior precision is counted in the value."""
    way: Annotated[Index, "w", "m", LATER] | None = None
    """(w, m) sets on the way: the first one, those after each exchange of the first search, and the
    better results of later searches; None where nothing was exchanged."""
    way_figures: Annotated[Array, "w", LATER] | None = None
    """(w,) figures of these sets."""

    def __repr__(self) -> str:
        figure = f"{self.criterion} = {self.value:.4g}"
        return f"Selection({len(self)} poses by {self.method}, {figure}; {self.proof})"

    def __len__(self) -> int:
        return len(self.indices)

    def tables(self) -> dict[str, ResultTable]:
        """``poses``: the places in the pool."""
        return {"poses": ResultTable({"place": self.indices})}

    @property
    def proof(self) -> str:
        """How close this is to the best possible set, or why that is not known, in one sentence."""
        return no_proof(self.criterion) if self.certificate is None else self.certificate.sentence


def figure_of_rows(rows: Array, n_poses: int, criterion: Criterion) -> float:
    """Figure of stacked rows (n, p); for an index, from their singular values.

    Zero or infinite, the worst there is, if they leave a direction undetermined: the smallest
    singular value is then rounding.
    """
    if not has_full_rank(rows):
        return 0.0 if criterion.larger_is_better else float("inf")
    if criterion.index is not None:
        return float(index_of_singular(singular_values(rows), n_poses, criterion.index))
    return criterion.figure(rows.T @ rows, n_poses)


def selection_of(
    problem: Problem,
    indices: ArrayLike,
    method: str,
    trace: Sequence[float],
    evaluations: int,
    way: Sequence[Index] = (),
) -> Selection:
    """A selection with its value computed afresh and, where there is one, its certificate."""
    figures = [problem.criterion.figure(problem.information(one), problem.n_poses) for one in way]
    return Selection(
        indices=frozen(indices, np.int64),
        criterion=problem.criterion.name,
        value=figure_of_rows(problem.rows(indices), problem.n_poses, problem.criterion),
        trace=frozen(trace),
        method=method,
        searches=len(trace),
        evaluations=evaluations,
        certificate=certificate_of(problem, indices),
        given=problem.given,
        prior=problem.prior,
        way=frozen(way, np.int64) if way else None,
        way_figures=frozen(figures) if way else None,
    )
