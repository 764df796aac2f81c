"""Least-squares fits of the same numbers to many tables, as arrays with the robots first."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.many import ManyModels
from calib.geometry.parameters import Parameters
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class ManyFits(Shown):
    """R fits of the same f numbers; one that is not `converged` is no estimate."""

    parameters: Parameters
    """Which numbers are free."""
    models: ManyModels
    """Models at which the fits ended."""
    steps: Array
    """(R, f) estimates minus nominal [m, rad]."""
    covariance: Array
    """(R, f, f) as in `Identification` [m^2, m rad, rad^2]."""
    normal: Array
    """(R, f, f) A'A + D'Lambda0 D there; in paper mode H'H of the twelve rows."""
    variance: Array
    """(R,) factor of the covariance: 1, or s^2 in paper mode."""
    chi_square: Array
    """(R,) whitened sums of squares of the rows; nan in paper mode."""
    dof: Array
    """(R,) rows minus numbers learned from them; see `Identification.dof_effective`."""
    p_value: Array
    """(R,) probability of a larger chi-square; nan in paper mode."""
    log_evidence: Array
    """(R,) as in `Identification`; nan without a prior."""
    certificate: Array
    """(R,) relative offset before the last step, see `tangent.Tangent.certificate`."""
    converged: Bool
    """(R,) whether the certificate of each is below its limit; fit the others by `identify`."""

    def __len__(self) -> int:
        return len(self.models)

    def __repr__(self) -> str:
        return f"ManyFits({len(self)} fits, {int(self.converged.sum())} converged)"

    @property
    def standard_uncertainty(self) -> Array:
        """(R, f) square roots of the diagonals of the covariances [m, rad]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def joined_fits(parts: list[ManyFits]) -> ManyFits:
    """Fits of all parts joined in order."""
    names = [name for name in ManyFits.__slots__ if name not in ("parameters", "models")]
    return ManyFits(
        parts[0].parameters,
        ManyModels.joined([part.models for part in parts]),
        *(np.concatenate([getattr(part, name) for part in parts]) for name in names),
    )
