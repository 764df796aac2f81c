"""What an identification found: the model, the numbers estimated, their covariance and tests."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.lack_of_fit import LackOfFit
from calib.identification.least_squares import Status
from calib.identification.prior import Prior
from calib.identification.robust import Loss
from calib.information.reduction import Reduction

Mode = Literal["whitened", "paper"]


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """An identified robot with the numbers that were really estimated and their covariance."""

    model: RobotModel
    """Identified; numbers that were not estimated are those of the nominal model."""
    parameters: Parameters
    """Free are the f numbers that were estimated: the kept ones of `reduction`, and all that have a
    prior."""
    reduction: Reduction
    """What the measurements alone can tell apart, judged at the nominal model."""
    step: Array
    """(f,) estimate minus nominal [m, rad]."""
    covariance: Array
    """(f, f) of `step` [m^2, m rad, rad^2]: inv(A'A + Lambda0); with a robust loss the sandwich; in
    paper mode the claimed s^2 inv(H'H)."""
    chi_square: float
    """Whitened sum of squares of the measurements; nan in paper mode, which knows no noise to
    compare with. With a robust loss, without the observations that the notes name."""
    dof: int
    """Rows minus numbers estimated; with a prior the whole number nearest to `dof_effective`."""
    p_value: float
    """Chance of a larger chi-square if model and noise are right; nan in paper mode."""
    variance: float
    """Factor of the covariance: 1, or in paper mode s^2 = RSS / (12 m - f), row units squared."""
    rank: int
    """Numbers estimated, f."""
    certificate: float
    """Relative offset at the end; see `tangent.relative_offset`."""
    status: Status
    """How the fit ended; its value is a sentence."""
    iterations: int
    trace: Array
    """(iterations + 1,) sum of squares from the nominal model on, that of the prior included; with
    a robust loss the loss, from the answer on that it started with."""
    residual: Array
    """(N,) seen minus predicted at the end: whitened, or the paper's rows in 1 and mm."""
    mode: Mode
    notes: tuple[str, ...]
    """What a reader must know before believing the numbers."""
    prior: Prior | None = None
    """What was believed beforehand."""
    loss: Loss = "squared"
    weights: Array = field(default_factory=lambda: frozen(()))
    """(m,) how much each observation counts, 0 to 1; ones for the squared loss."""
    dof_effective: float = float("nan")
    """n - tr[inv(A'A + Lambda0) A'A]: rows minus numbers learned from the measurements."""
    log_evidence: float = float("nan")
    """How well model and prior together foretold the measurements, up to a constant of the table:
    -(loss + x'Lambda0 x)/2 + ln|Lambda0|/2 - ln|A'A + Lambda0|/2. nan unless every number estimated
    has a prior."""
    lack_of_fit: LackOfFit | None = None
    """Misfit against the scatter of repeats; None without repeats or with a robust loss."""

    @property
    def names(self) -> tuple[str, ...]:
        """(f,) names of the numbers estimated."""
        return self.parameters.free_names

    @property
    def standard_uncertainty(self) -> Array:
        """(f,) square roots of the diagonal of the covariance [m, rad]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def full_covariance(self) -> Array:
        """(P, P) covariance of all numbers; zero where a number was not estimated."""
        full = np.zeros((len(self.parameters.names),) * 2)
        index = self.parameters.free_index
        full[np.ix_(index, index)] = self.covariance
        return full
