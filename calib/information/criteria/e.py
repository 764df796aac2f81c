"""E: the weakest direction; its figure is the observability index O3."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from calib.arrays import Array
from calib.information.criteria.base import Certifiable
from calib.information.criteria.spectral import Extremes
from calib.information.criteria.whitened import relative_rounding
from calib.information.observability import IndexName


@dataclass(frozen=True, slots=True, eq=False)
class E(Extremes, Certifiable):
    """Value lambda_min of M; figure O3, its root.

    No set has a lambda_min above tr(Z M*), for any Z with trace one and no negative eigenvalue. Of
    order k, Z goes with M^-(k+1): the gradient of the mean tr(M^-k)^(-1/k), which tends to
    lambda_min.

    References
    ----------
    Nahvi and Hollerbach 1996 (O3); Pukelsheim 1993 (matrix means).
    """

    name: str = "E"

    convex: ClassVar[bool] = True
    unit: ClassVar[str] = "1"
    meaning: ClassVar[str] = "smallest singular value, strength of the weakest direction (O3)"
    index: ClassVar[IndexName | None] = "O3"
    larger_is_better: ClassVar[bool] = True
    sharpness: ClassVar[tuple[float, ...]] = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)

    def of_extremes(self, low: Array, high: Array) -> Array:
        """The smallest eigenvalue."""
        return low

    def needed(self, value: float, high: Array) -> Array:
        """The value itself."""
        return np.full_like(high, value)

    def figure(self, M: Array, n_poses: int) -> float:
        """O3."""
        return self.figure_of_value(float(self.value(M)), len(M), n_poses)

    def figure_of_value(self, value: float, p: int, n_poses: int) -> float:
        """Root of the value."""
        return float(np.sqrt(value))

    def dual(self, M: Array, sharpness: float) -> Array:
        """Z, near the weakest directions, with trace one."""
        w, U = np.linalg.eigh(M)
        # any such Z will do: rounding must not make one negative
        w = np.maximum(w, len(w) * np.finfo(np.float64).eps * w[-1])
        share = (w[0] / w) ** (sharpness + 1)
        return np.asarray((U * (share / share.sum())) @ U.T)

    def ceiling(self, M: Array, S: Array, top: float) -> float:
        """Tr(Z M*) itself."""
        return top

    def widened(self, bound: float, M: Array) -> float:
        """The bound plus the rounding of M's smallest eigenvalue."""
        return bound * (1 + relative_rounding(M, any_units=False))

    def exponent(self, sharpness: float) -> float:
        """1 / (k + 1)."""
        return 1 / (sharpness + 1)

    def efficiency(self, value: float, bound: float, p: int) -> float:
        """O3 over the largest possible."""
        return float(np.sqrt(max(value, 0.0) / bound))
