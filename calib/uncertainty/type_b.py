"""Type B: inputs common to all rows of a campaign, and what they leave in the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.shown import Shown
from calib.uncertainty.covariance import common_input_covariance, covariance_factor
from calib.uncertainty.refit import Frozen
from calib.uncertainty.statement.gain import least_squares_gain


@dataclass(frozen=True, slots=True, eq=False)
class CommonInput(Shown):
    """Something wrong in the same way all campaign long: an offset, a scale, a mounting."""

    name: str
    sensitivity: Array
    """(m, 6, k) change of each row [m, rad], world axes, per unit of each of its k numbers."""
    covariance: Array
    """(k, k) of these numbers."""
    degrees_of_freedom: float = np.inf
    """How well the covariance is known; infinite where it is taken as given."""

    def __post_init__(self) -> None:
        B, S = check("m 6 k, k k", sensitivity=self.sensitivity, covariance=self.covariance)
        covariance_factor(S)
        if not self.degrees_of_freedom > 0:
            message = f'"{self.name}" has {self.degrees_of_freedom} degrees of freedom'
            allowed = "above zero; infinite where the covariance is taken as known"
            raise refuse(
                "degrees_of_freedom", self.degrees_of_freedom, allowed, code="A3", message=message
            )
        object.__setattr__(self, "sensitivity", B)
        object.__setattr__(self, "covariance", S)

    def __repr__(self) -> str:
        return f"CommonInput({self.name!r}, {len(self.covariance)} numbers)"


@checked_kinds
def common_inputs(
    names: Sequence[str],
    sensitivity: ArrayLike,
    variance: ArrayLike,
    *,
    degrees_of_freedom: float = np.inf,
) -> tuple[CommonInput, ...]:
    """Uncorrelated common inputs, those of one name together.

    Parameters
    ----------
    names : sequence of str
        Name of each of the k numbers; equal names make one source (``target offset`` three times).
    sensitivity : (m, 6, k) array_like
        B: change of each row [m, rad], world axes, per unit of each number.
    variance : (k,) array_like
        Variance of each number, in that unit squared.
    degrees_of_freedom : float
        Of all of them.
    """
    sensitivity, variance = check("m 6 k, k", sensitivity=sensitivity, variance=variance)
    if len(names) != len(variance) or (variance < 0).any():
        counts = f"{len(names)} names, {len(variance)} variances"
        message, allowed = (
            f"{counts}, smallest {variance.min():.3g}",
            "one name for each, none negative",
        )
        raise refuse("variance", allowed=allowed, code="A3", message=message)
    groups = {name: [k for k, other in enumerate(names) if other == name] for name in names}
    return tuple(
        CommonInput(name, sensitivity[:, :, k], np.diag(variance[k]), degrees_of_freedom)
        for name, k in groups.items()
    )


def estimator_maps(start: Frozen) -> Array:
    """F (m, f, 6): how the estimate follows each raw row [m, rad], dx = sum_j F_j r_j.

    References
    ----------
    F = inv(A'A + Lambda0) A'N; zero for the rotation of point rows, which nobody measured.
    """
    scale = start.parameters.free_scale
    precision = scale[:, None] * start.prior * scale
    return least_squares_gain(
        start.model, start.parameters, start.measurements, precision=precision
    )


def type_b_covariance(start: Frozen, common: Sequence[CommonInput]) -> Array:
    """Covariance (f, f) that common inputs add to the estimate: not reduced by more poses.

    References
    ----------
    F (B S B') F'; JCGM 100:2008, 4.3, 5.2.
    """
    F, f = estimator_maps(start), start.parameters.n_free
    total = np.zeros((f, f))
    for shared in common:
        total += common_input_covariance(F, shared.sensitivity, shared.covariance)
    return frozen(total)
