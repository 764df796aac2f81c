"""Lack-of-fit test: the misfit of a model against the scatter of repeated measurements."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from calib.arrays import Array
from calib.measurement.grouping import count_distinct
from calib.measurement.observations import Measurements


@dataclass(frozen=True, slots=True)
class LackOfFit:
    """F test of the variance of the misfit against that of repeats."""

    ratio: float
    """F: near 1 if the model is right, whatever the size of the noise."""
    p_value: float
    """Chance of a larger ratio if the model is right."""
    dof_model: float
    """Degrees of freedom of the misfit of means over repeats."""
    dof_error: int
    """Degrees of freedom of the pure error, the scatter among repeats."""


def lack_of_fit(
    r: Array, measurements: Measurements, whitening: Array, learned: float
) -> LackOfFit | None:
    """Test the residual of a fit against the scatter of repeats of one pose.

    Repeats are rows of one kind, reflector and station at the same commanded joints and with the
    same payload. If the robot did not leave and approach the pose anew between them, they share its
    joint error and scatter too little.

    Parameters
    ----------
    r : (N,) array
        Whitened residual of the fit, rows in the order of the table.
    measurements : Measurements
        The table.
    whitening : (m, 6, 6) array
        `table_whiteners(measurements)`.
    learned : float
        Effective number of parameters learned from the data: N minus the dof of chi-square.

    Returns
    -------
    LackOfFit or None
        None where nothing was repeated or the repeats do not differ at all.

    References
    ----------
    Draper & Smith 1998, 2.1: F = [(SS - SS_pe) / (rows of distinct poses - p)] / [SS_pe / dof_pe].
    """
    if count_distinct(measurements.q) == len(measurements):
        return None
    hung = measurements.conditions.moments
    loads = np.zeros((len(measurements), 0)) if hung is None else hung
    key = np.column_stack([measurements.q, measurements.target_key, loads])
    distinct, group, visits = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    if len(distinct) == len(key):
        return None
    group = group.ravel()
    rows = measurements.equations
    padded = np.zeros((len(key), 6))
    padded[np.arange(6) < rows[:, None]] = r
    transposed = np.swapaxes(whitening, -1, -2)
    # about the mean of a group weighted by its covariances
    weight, moment = np.zeros((len(distinct), 6, 6)), np.zeros((len(distinct), 6))
    np.add.at(weight, group, transposed @ whitening)
    np.add.at(moment, group, (transposed @ padded[:, :, None])[:, :, 0])
    mean = np.linalg.solve(weight, moment[:, :, None])[:, :, 0]
    pure = float(np.sum((padded - (whitening @ mean[group][:, :, None])[:, :, 0]) ** 2))
    each = np.zeros(len(distinct), dtype=np.int64)
    each[group] = rows
    dof_error, dof_model = int(each @ (visits - 1)), float(each.sum() - learned)
    total = float(r @ r)
    if dof_model <= 0 or pure <= 1e-12 * max(total, dof_error):
        return None
    ratio = max(total - pure, 0.0) / dof_model / (pure / dof_error)
    return LackOfFit(ratio, float(fdtrc(dof_model, dof_error, ratio)), dof_model, dof_error)
