"""How well a point is known at poses like those identified from: at each of them, left out."""

import numpy as np

from calib.arrays import Array
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import estimator_gain

SURE = 1e-9
"""Share of what a pose tells that is kept of a number that no other pose tells."""


def left_out_covariance(fit: Identification, train: Measurements, rows: Array) -> Array:
    """What the noise adds to points at the poses identified from, where each is left out.

    The numbers follow the noise of the poses that they were identified from, and points are surer
    there than at further poses drawn alike.

    Parameters
    ----------
    fit : Identification
        By weighted least squares, from `train`.
    train : Measurements
        Of N poses.
    rows : (N, 3, P) array
        Derivatives of the point at each pose, in the order of `pose_id` [m per unit].

    Returns
    -------
    (N, 3, 3) array
        J (C_i - C) J', C_i the covariance of the numbers without the readings of pose i [m^2].

    References
    ----------
    C_i = inv(inv(C) - A_i'W_i A_i) = inv(1 - F_i A_i) C with the gain F_i = C A_i'W_i: Sherman,
    Morrison & Woodbury.
    """
    free = fit.parameters.free_index
    F, A = estimator_gain(fit, train), predict(fit.model, train).rows[:, :, free]
    C, one = fit.full_covariance[np.ix_(free, free)], np.eye(len(free))
    order = np.argsort(train.pose_id, kind="stable")
    starts = np.unique(train.pose_id[order], return_index=True)[1]
    out = np.empty((len(rows), 3, 3))
    for k, own in enumerate(np.split(order, starts[1:])):
        told = np.einsum("mfi,mig->fg", F[own], A[own]) * (1 - SURE)
        J = rows[k][:, free]
        more = J @ np.linalg.solve(one - told, told @ C) @ J.T
        out[k] = (more + more.T) / 2
    return out
