"""Noise larger than stated: its size from the residuals, and fits that allow for it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from calib.arrays import frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import identify
from calib.identification.prior import Prior
from calib.identification.result import Identification
from calib.identification.robust import Loss, sizes
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize

HONEST = 1.5
"""Typical residual, in units of the stated noise, up to which the stated noise is accepted."""


def noise_factor(model: RobotModel, measurements: Measurements) -> float:
    """Typical size of the residuals in units of the stated noise: about 1 if both are right."""
    stack = linearize(model, measurements)
    rows = np.bincount(stack.row_of)
    expected = np.sqrt(chdtri(rows, 0.5) / rows)
    return float(np.median(sizes(stack.r, stack.row_of) / expected))


def with_noise(measurements: Measurements, factor: float) -> Measurements:
    """The table with `factor` times the stated noise, if the factor exceeds `HONEST`."""
    if factor <= HONEST:
        return measurements
    return replace(measurements, covariance=measurements.covariance * factor**2)


def under_noise(
    nominal: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    prior: Prior,
    factor: float,
    *,
    loss: Loss = "squared",
    report: Callable[[int, float], None] | None = None,
    start: RobotModel | None = None,
) -> Identification:
    """Identify from data with `factor` times the stated noise, under a prior of unchanged width.

    The fit weighs the prior against the larger noise. Its covariance is that of the stated noise
    and of the prior as given: inv(H) (A'A + factor^4 Lambda0) inv(H), H = A'A + factor^2 Lambda0.
    """
    tighter = prior.weighed(factor**2)
    found = identify(
        nominal, measurements, parameters, prior=tighter, loss=loss, report=report, start=start
    )
    return as_believed(found, factor)


def as_believed(found: Identification, factor: float) -> Identification:
    """A fit under a prior whose sd is `factor` times too small, with its covariance corrected."""
    tighter = found.prior
    if tighter is None or factor == 1.0:
        return found
    at = [found.names.index(name) for name in tighter.names]
    spread = tighter.halved(found.covariance[:, at])
    wider = (factor**2 - 1) * (spread @ spread.T)
    return replace(found, covariance=frozen(found.covariance + wider), tightened=factor**2)
