"""O2: the roundness of the information ellipsoid; no bound on the best set is known."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array
from calib.information.criteria.spectral import Extremes
from calib.information.observability import IndexName


@dataclass(frozen=True, slots=True, eq=False)
class O2(Extremes):
    """Value and figure sqrt(lambda_min / lambda_max); it may fall when a pose is added.

    References
    ----------
    Wen et al. 2022, eq. (6).
    """

    name: str = "O2"

    convex: ClassVar[bool] = False
    unit: ClassVar[str] = "1"
    meaning: ClassVar[str] = "smallest over largest singular value"
    index: ClassVar[IndexName | None] = "O2"
    larger_is_better: ClassVar[bool] = True

    def of_extremes(self, low: Array, high: Array) -> Array:
        """sqrt(lambda_min / lambda_max); 0 of nothing."""
        high = np.where(high > 0, high, 1.0)
        return np.sqrt(low / high)

    def needed(self, value: float, high: Array) -> Array:
        """Smallest eigenvalue behind a value."""
        return np.asarray(value**2 * high)

    def figure(self, M: Array, n_poses: int) -> float:
        """The index."""
        return float(self.value(M))
