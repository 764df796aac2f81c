"""Points at the poses identified from, as they would be known had each pose been left out.

The numbers follow the noise and the misfit of the poses that they were identified from, and points
are surer there than at further poses drawn alike.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.applicability import REFUSED, Proven, over_usual, unheld
from calib.uncertainty.statement.gain import estimator_gain

KEPT = 1e-9
"""Share of its readings that a pose keeps when it is left out: what no other tells stays finite."""


def left_out_covariance(fit: Identification, train: Measurements, rows: Array) -> Array:
    """What the noise adds to points at the poses identified from, where each is left out.

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
    C, one = fit.full_covariance[np.ix_(free, free)], np.eye(len(free))
    out = np.empty((len(rows), 3, 3))
    for k, (_, _, told) in enumerate(_each(fit, train)):
        J = rows[k][:, free]
        more = J @ np.linalg.solve(one - told, told @ C) @ J.T
        out[k] = (more + more.T) / 2
    return out


def left_out_growth(fit: Identification, train: Measurements, proven: Proven) -> Array:
    """Growth (N,) of a misfit's variance at the poses identified from, where each is left out.

    At most `REFUSED`: no region is stated where it is larger.

    Parameters
    ----------
    fit, train
        As for `left_out_covariance`.
    proven : Proven
        By these poses.

    References
    ----------
    What is left at pose i of errors that no number holds: B_i - J_i inv(1 - F_i A_i) (a - F_i B_i),
    a = F B how the estimate follows them.
    """
    free = fit.parameters.free_index
    one, wide = np.eye(len(free)), predict(proven.wide, train).rows
    seen = unheld(proven.wide, proven.columns, proven.up, train.q, wide)
    first = np.unique(train.pose_id, return_index=True)[1]
    left = np.empty((3, len(first)))
    for k, (own, F, told) in enumerate(_each(fit, train)):
        follows = proven.absorbed.copy()
        follows[free] -= np.einsum("mfe,mek->fk", F, seen[own])
        follows[free] = np.linalg.solve(one - told, follows[free])
        row = first[k : k + 1]
        left[:, k] = proven.left(train.q[row], train.conditions.rows(row), follows)[:, 0]
    of_terms, of_foot, _ = over_usual(left, proven.usual)
    return np.asarray(np.clip(np.maximum(of_terms, of_foot), 1.0, REFUSED))


def _each(fit: Identification, train: Measurements) -> Iterator[tuple[Index, Array, Array]]:
    """Rows (r,) of each pose, their gains F (r, f, 6), and what they tell, F A (f, f)."""
    F, A = estimator_gain(fit, train), predict(fit.model, train).rows
    A = A[:, :, fit.parameters.free_index]
    order = np.argsort(train.pose_id, kind="stable")
    starts = np.unique(train.pose_id[order], return_index=True)[1]
    for own in np.split(order, starts[1:]):
        yield own, F[own], np.einsum("mfi,mig->fg", F[own], A[own]) * (1 - KEPT)
