"""The outcome of a pose selection: which poses, how good, and how it was found."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.information.observability import Criterion, index_of_singular
from calib.information.rank import singular_values


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """A pose set chosen from a pool."""

    indices: Index
    """(m,) places in the pool, none twice."""
    criterion: Criterion
    """Index that was maximized, in its correct form."""
    value: float
    """That index, from the singular values of the stacked rows."""
    trace: Array
    """(t,) best value known after each local search, draw or step."""
    method: str
    """``"random"``, ``"greedy"`` or ``"detmax"``."""
    searches: int
    """Local searches, draws or steps taken."""
    evaluations: int
    """Candidate sets evaluated exactly; bounds disposed of the others."""

    def __len__(self) -> int:
        return len(self.indices)


def set_value(blocks: Array, indices: ArrayLike, criterion: Criterion) -> float:
    """Index of a pose set, recomputed from the rows: no update, no squaring."""
    chosen = np.asarray(indices)
    singular = singular_values(blocks[chosen].reshape(-1, blocks.shape[-1]))
    return float(index_of_singular(singular, len(chosen), criterion))


def finished(
    blocks: Array,
    indices: ArrayLike,
    criterion: Criterion,
    *,
    trace: Sequence[float],
    method: str,
    evaluations: int,
) -> Selection:
    """A selection with its value computed afresh."""
    return Selection(
        indices=frozen(indices, np.int64),
        criterion=criterion,
        value=set_value(blocks, indices, criterion),
        trace=frozen(trace),
        method=method,
        searches=len(trace),
        evaluations=evaluations,
    )
