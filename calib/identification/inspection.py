"""Which measurements an identification rests on most, and which do not fit it: named by pose."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.identification.diagnostics import Outliers, leverages, outliers
from calib.identification.prior import prior_rows
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.residual import stacked


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """Every observation of a table, judged after a fit."""

    outliers: Outliers
    leverage: Array
    """(m,) numbers that rest on each observation; at most its rows."""
    sentences: tuple[str, ...]
    """One per observation that does not fit, worst first, then those that nothing checks."""


def inspect(
    nominal: RobotModel,
    found: Identification,
    measurements: Measurements,
    *,
    chance: float = 0.05,
) -> Inspection:
    """Judge every observation of the table that a model was identified from.

    After a plain fit one gross error spoils the scores of its neighbors: where some are found,
    identify with a robust loss and inspect that fit.

    Parameters
    ----------
    nominal : RobotModel
        Start of the fit: the prior counts from there.
    found : Identification
        Result of the fit, in the mode *whitened*.
    measurements : Measurements
        The table it was identified from.
    chance : float
        Chance that a sound table has any suspect at all.
    """
    if found.mode != "whitened":
        raise InputError(
            "an identification in paper mode cannot be inspected: it knows no noise",
            code="A3",
            field="found",
            value=found.mode,
            fix='identify in the mode "whitened"',
        )
    stack = stacked(found.model, measurements)
    columns = found.parameters.free_index
    A, prior = stack.A[:, columns], None
    if found.prior is not None:
        prior = prior_rows(found.prior, nominal, found.parameters).at(found.model)[1][:, columns]
    weights = None if found.loss == "squared" else found.weights
    if weights is None:
        share = leverages(A, stack.row_of, prior=prior)
    else:
        share = leverages(np.sqrt(weights)[stack.row_of, None] * A, stack.row_of, prior=prior)
    judged = outliers(stack.r, A, stack.row_of, chance=chance, prior=prior, weights=weights)
    alone = [
        f"pose {measurements.pose_id[j]} (row {j}) is checked by no other observation"
        for j in np.flatnonzero(np.isinf(judged.limit))
    ]
    return Inspection(judged, share, (*judged.sentences(measurements), *alone))
