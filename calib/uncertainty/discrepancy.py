"""What the model leaves out, as a covariance from independent poses, added to the statement."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import fdtri

from calib.arrays import LATER, Array, frozen, require_probability
from calib.errors import refuse
from calib.held_out_counts import FEWEST
from calib.identification.fit_statistics import chance
from calib.kinds import checked_kinds
from calib.shown import Shown, length_words
from calib.uncertainty.held_out import HeldOut

LIKELY = 0.05
"""Chance of errors as large, from which on nothing is claimed of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Discrepancy(Shown):
    """Covariance of position errors beyond what parameters and measurements explain."""

    covariance: Annotated[Array, 3, 3]
    """(3, 3) Sigma_d, positive semidefinite, world axes [m^2]."""
    raw: Annotated[Array, 3, 3]
    """(3, 3) before negative directions were set to zero [m^2]."""
    n_poses: int
    """Held-out poses behind it."""
    p_value: Annotated[float, LATER] = 0.0
    """Chance of errors as large at these poses without any discrepancy."""

    def __repr__(self) -> str:
        size = length_words(float(np.sqrt(np.trace(self.covariance))), um=".3g")
        return f"Discrepancy({size} from {self.n_poses} poses)"

    def factor(self, probability: float = 0.95) -> float:
        """Factor of the region of Sigma_t + Sigma_d: as if all of it were known from n poses.

        Larger than the chi-square factor (2.80): 3.00 for 40 poses, 3.27 for 19.

        References
        ----------
        Hotelling's T^2 with n degrees of freedom: 3 n / (n - 2) F(3, n - 2).
        """
        require_probability(probability, "C41")
        n = self.n_poses
        return float(np.sqrt(3 * n / (n - 2) * fdtri(3, n - 2, probability)))

    @property
    def sentence(self) -> str:
        """The result in words."""
        size = float(np.sqrt(np.trace(self.covariance)))
        if size == 0:
            return (
                f"{self.n_poses} held-out poses show no error beyond what parameters and "
                "measurements explain"
            )
        if self.p_value >= LIKELY:
            return (
                f"{self.n_poses} held-out poses show no more error than parameters and "
                f"measurements make likely (p {chance(self.p_value)})"
            )
        return (
            f"{self.n_poses} held-out poses show {length_words(size)} (3-D, one standard "
            "deviation) that the model does not explain; the interval with this discrepancy is "
            "approximate: it treats a systematic error as if it were drawn anew at each pose"
        )


@checked_kinds
def discrepancy(validation: HeldOut) -> Discrepancy:
    """Sigma_d from independent held-out poses.

    References
    ----------
    Positive semidefinite part of mean(e e') - mean(Sigma_t) - mean(Sigma_meas).
    """
    n = len(validation)
    if n < FEWEST:
        allowed, message = f"{FEWEST} or more for a discrepancy", f"{n} validation poses"
        fix = "measure more poses where the robot will be used"
        raise refuse("validation", n, allowed, code="A3", message=message, fix=fix)
    e = validation.error
    raw = e.T @ e / n - validation.predicted.mean(axis=0) - validation.measured.mean(axis=0)
    values, vectors = np.linalg.eigh((raw + raw.T) / 2)
    positive = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return Discrepancy(frozen((positive + positive.T) / 2), frozen(raw), n, validation.p_value)
