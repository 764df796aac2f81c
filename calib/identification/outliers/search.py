"""The search for gross errors: a fit that these cannot pull names what does not fit the others."""

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
"""Beyond `HONEST`, scores that count: so many times the limit, twice as far in millimetres. What a
model leaves out has longer tails than noise has."""
CALMER = 0.8
"""Part of its typical residual to which a plain fit must calm down for a second look."""


@dataclass(frozen=True, slots=True, eq=False)
class OutlierSearch(Shown):
    """What does not fit the others, and the fit that shows it."""

    noise_factor: float
    """Typical residual in units of the stated noise; 1 where that was taken at its word."""
    identification: Identification
    """The fit that judged: a robust one, unless the first had none."""
    outliers: Outliers
    """Score of each observation after it."""
    suspects: Index
    """Observations beyond their limits, worst first."""
    too_many: bool
    """So many that the model or the stated noise is to blame, not they."""

    def __repr__(self) -> str:
        return f"OutlierSearch({len(self.suspects)} suspects, noise factor {self.noise_factor:.3g})"

    @property
    def rows(self) -> Index:
        """Observations to leave out, worst first; none where they are too many."""
        return self.suspects[:0] if self.too_many else self.suspects


def search_outliers(
    nominal: RobotModel,
    first: Identification,
    measurements: Measurements,
    parameters: Parameters | None = None,
    *,
    chance: float = 0.05,
    most: float = MOST_OUTLIERS,
    noise_is_known: bool = True,
) -> OutlierSearch:
    """Name the observations that do not fit the others.

    One gross error spoils the scores of its neighbors in a plain fit: where there are some, they
    are named after a Cauchy fit.

    Parameters
    ----------
    nominal : RobotModel
        Where fits begin.
    first : Identification
        A fit to all observations, plain or robust; in the mode *whitened*.
    measurements : Measurements
        What it was identified from.
    parameters : Parameters, optional
        What the robust fit frees; what `first` estimated by default.
    chance : float
        Chance that a table of sound observations, whose noise is as stated, has any suspect.
    most : float
        Part of the observations from which on suspects are too many to be gross errors.
    noise_is_known : bool
        Whether the stated noise is right. Else, where the residuals are much larger, observations
        are judged against the scatter of the residuals instead, and more mildly.
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
    too_many = len(suspects) > most * len(measurements)
    return OutlierSearch(factor, judge, outliers, suspects, too_many)


def _robust(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    first: Identification,
    factor: float,
) -> tuple[Identification, Measurements]:
    """A fit that few observations cannot pull, and the table with its noise."""
    table = with_noise(measurements, factor)
    return identify(nominal, table, parameters, prior=first.prior, loss="cauchy"), table
