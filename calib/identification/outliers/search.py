"""Search for gross errors: observations that do not fit the others, by a robust fit."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Index, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import identify
from calib.identification.larger_noise import HONEST, noise_factor, with_noise
from calib.identification.outliers.scores import Outliers, inspect
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.shown import Shown

FAR = 4.0
"""Factor on the limits of scores if the noise factor exceeds `HONEST`; twice the distance in
millimeters. Model errors have longer tails than noise."""
CALMER = 0.8
"""If the robust fit has less than this fraction of the plain fit's noise factor, it is repeated
with its own."""


@dataclass(frozen=True, slots=True, eq=False)
class OutlierSearch(Shown):
    """Observations that do not fit the others, and the fit that shows it."""

    noise_factor: float
    """Typical residual in units of the stated noise; 1 if that noise is known to be right."""
    identification: Identification
    """The fit that was inspected: a robust one, unless the first fit had no suspects."""
    outliers: Outliers
    """Score of each observation after that fit."""
    suspects: Index
    """(k,) observations beyond their limits, worst first."""
    too_many: bool
    """Whether there are so many suspects that the model or the stated noise is to blame."""

    def __repr__(self) -> str:
        return f"OutlierSearch({len(self.suspects)} suspects, noise factor {self.noise_factor:.3g})"

    @property
    def rows(self) -> Index:
        """(k,) observations to leave out, worst first; none if there are too many."""
        return self.suspects[:0] if self.too_many else self.suspects


def search_outliers(
    nominal: RobotModel,
    first: Identification,
    measurements: Measurements,
    parameters: Parameters | None = None,
    *,
    chance: float = 0.05,
    noise_is_known: bool = True,
) -> OutlierSearch:
    """Find the observations that do not fit the others.

    One gross error spoils the scores of its neighbors in an ordinary fit. If that has suspects, the
    result comes from a fit with the Cauchy loss.

    Parameters
    ----------
    nominal : RobotModel
        Start of all fits.
    first : Identification
        A fit to all observations, ordinary or robust, in the mode *whitened*.
    measurements : Measurements
        The table it was identified from.
    parameters : Parameters, optional
        Free numbers of the robust fit; those of `first` by default.
    chance : float
        Probability that a table of sound observations with noise as stated has any suspect.
    noise_is_known : bool
        Whether the stated noise is right. If not, and if the residuals are much larger, the scatter
        of the residuals takes its place, and limits are `FAR` times as large.
    """
    factor = 1.0 if noise_is_known else noise_factor(first.model, measurements)
    if first.loss != "squared":
        judge, table = first, measurements
    else:
        if factor <= HONEST:
            outliers = inspect(nominal, first, measurements, chance=chance)
            if not outliers.suspect.any():
                nothing = frozen((), np.int64)
                return OutlierSearch(factor, first, outliers, nothing, False)
        own = first.parameters if parameters is None else parameters
        judge, table = _robust(nominal, measurements, own, first, factor)
        calmer = factor if noise_is_known else noise_factor(judge.model, measurements)
        if calmer < CALMER * factor:  # the gross errors had moved the plain fit
            factor = calmer
            judge, table = _robust(nominal, measurements, own, first, factor)
    outliers = inspect(nominal, judge, table, chance=chance)
    excess = outliers.score / (outliers.limit * (1.0 if factor <= HONEST else FAR))
    suspects = np.flatnonzero(excess > 1)
    suspects = suspects[np.argsort(-excess[suspects], kind="stable")]
    too_many = len(suspects) > MOST_OUTLIERS * len(measurements)
    return OutlierSearch(factor, judge, outliers, suspects, too_many)


def _robust(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    first: Identification,
    factor: float,
) -> tuple[Identification, Measurements]:
    """Fit with the Cauchy loss, and the table with its noise multiplied by `factor`."""
    table = with_noise(measurements, factor)
    return identify(nominal, table, parameters, prior=first.prior, loss="cauchy"), table
