"""O5: the inverse of the summed inverse singular values; no bound on the best set is offered."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.information.criteria.base import Move, Pool
from calib.information.criteria.lazy import best_first
from calib.information.criteria.spectral import (
    Spectral,
    changed,
    rounding,
    seen_along,
)
from calib.information.criteria.whitened import eigenvalues
from calib.information.observability import IndexName


@dataclass(frozen=True, slots=True, eq=False)
class O5(Spectral):
    """Value and figure 1 / sum of lambda^-1/2.

    In the eigenbasis of M the diagonal of the changed matrix is majorized by its eigenvalues and
    x^-1/2 is convex, so the sum over the diagonal is never above the sum over the eigenvalues.

    References
    ----------
    Wen et al. 2022, eq. (6), inverted; Schur-Horn theorem and Karamata's inequality.
    """

    name: str = "O5"

    convex: ClassVar[bool] = False
    unit: ClassVar[str] = "1"
    meaning: ClassVar[str] = "one over the sum of inverse singular values"
    index: ClassVar[IndexName | None] = "O5"
    larger_is_better: ClassVar[bool] = True

    def value(self, M: Array) -> Array:
        """The index (...,); 0 where M is singular."""
        return inverse_sum(eigenvalues(M))

    def figure(self, M: Array, n_poses: int) -> float:
        """The index."""
        return float(self.value(M))

    def best_add(self, M: Array, pool: Pool, allowed: Bool, floor: float = -np.inf) -> Move:
        """Best addition, met in the order of the diagonal's sum."""
        return self._best(M, pool, 1.0, allowed, floor)

    def best_drop(self, M: Array, blocks: Array) -> Move:
        """Best deletion, met in the order of the diagonal's sum."""
        return self._best(M, Pool(blocks), -1.0, np.ones(len(blocks), dtype=bool), -np.inf)

    def _best(self, M: Array, pool: Pool, sign: float, allowed: Bool, floor: float) -> Move:
        """Best of M + sign B'B over the allowed blocks of a pool."""
        w, V = np.linalg.eigh(M)
        C = seen_along(pool.pages, V)
        diagonal = w + sign * np.einsum("rjk,rjk->jk", C, C)
        diagonal += rounding(w, pool.squares)[:, None]
        upper = np.where(allowed, inverse_sum(diagonal), -np.inf)

        def exact(pick: Index) -> Array:
            return self.value(changed(M, pool.blocks[pick], sign))

        place, value, evaluated = best_first(upper, exact, floor=floor)
        return Move(place, value - float(inverse_sum(w)), evaluated)


def inverse_sum(eigenvalues: Array) -> Array:
    """1 / sum of lambda^-1/2 over the last axis; 0 where an eigenvalue is not positive."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (1.0 / np.sqrt(np.maximum(eigenvalues, 0.0))).sum(-1))
