"""How an estimate follows what was measured: the gain of weighted least squares with its prior."""

import numpy as np

from calib.arrays import Array, frozen
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict


def estimator_gain(identification: Identification, table: Measurements) -> Array:
    """F (m, f, 6): how the estimate follows each row of its table [m, rad]; zero where unfilled.

    References
    ----------
    F = inv(A'WA + Lambda0) A'W, each row by its weight where a robust loss gave it one.
    """
    seen, scale = predict(identification.model, table), identification.parameters.free_scale
    filled = seen.filled[:, :, None]
    A = np.where(filled, seen.rows[:, :, identification.parameters.free_index] * scale, 0.0)
    both = filled & np.swapaxes(filled, 1, 2)
    WA = np.linalg.solve(np.where(both, table.covariance, np.eye(6)), A)
    if len(identification.weights):
        WA = WA * identification.weights[:, None, None]
    AW = np.swapaxes(WA, 1, 2)
    H = (AW @ A).sum(axis=0) + prior_precision(identification)
    return np.asarray(scale[:, None] * np.linalg.solve(H, AW))


def of_all_numbers(identification: Identification, covariance: Array) -> Array:
    """Covariance (P, P) of all numbers from that of the free ones (f, f); zero elsewhere."""
    full = np.zeros((len(identification.parameters.names),) * 2)
    index = identification.parameters.free_index
    full[np.ix_(index, index)] = (covariance + covariance.T) / 2
    return frozen(full)


def prior_precision(identification: Identification) -> Array:
    """Lambda0 (f, f) of the free numbers in scaled columns; zero without a prior."""
    parameters, prior = identification.parameters, identification.prior
    precision = np.zeros((parameters.n_free,) * 2)
    if prior is not None:
        at = [parameters.free_names.index(name) for name in prior.names]
        scale = parameters.free_scale[at]
        precision[np.ix_(at, at)] = prior.precision * scale[:, None] * scale
    return precision
