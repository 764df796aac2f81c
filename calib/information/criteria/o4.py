"""O4: noise amplification, weakness and roundness together; no bound on the best set is known."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array
from calib.information.criteria.spectral import Extremes
from calib.information.observability import IndexName


@dataclass(frozen=True, slots=True, eq=False)
class O4(Extremes):
    """Value and figure lambda_min / sqrt(lambda_max); it may fall when a pose is added.

    References
    ----------
    Nahvi and Hollerbach 1996.
    """

    name: str = "O4"

    convex: ClassVar[bool] = False
    unit: ClassVar[str] = "1"
    meaning: ClassVar[str] = "smallest singular value squared over the largest"
    index: ClassVar[IndexName | None] = "O4"
    larger_is_better: ClassVar[bool] = True

    def of_extremes(self, low: Array, high: Array) -> Array:
        """lambda_min / sqrt(lambda_max); 0 of nothing."""
        return np.asarray(low / np.sqrt(np.where(high > 0, high, 1.0)))

    def needed(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue behind a value."""
        return np.asarray(value * np.sqrt(high))

    def figure(self, M: Array, n_poses: int) -> float:
        """The index."""
        return float(self.value(M))
