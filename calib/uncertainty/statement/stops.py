"""Noise that the rows of one stop share: what it does to an estimate and to its residuals."""

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array
from calib.identification.fit_statistics import squared_notes
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize, table_whiteners
from calib.uncertainty.covariance import covariance_factor
from calib.uncertainty.statement.gain import covariance_of_groups, estimator_gain, of_all_numbers


def stop_covariance(identification: Identification, train: Measurements, root: Array) -> Array:
    """What P (P, P) of independent rows lacks, where rows of one stop share noise of a root.

    References
    ----------
    F V F' less the same by rows, V = S S' of the stops and S (m, 6, j) their root.
    """
    each = estimator_gain(identification, train) @ root
    alone = covariance_of_groups(each, np.arange(len(train))[:, None])
    stop = np.column_stack([train.pose_id, train.repeat])
    return of_all_numbers(identification, covariance_of_groups(each, stop) - alone)


def judged_by_stops(
    identification: Identification, train: Measurements, root: Array
) -> Identification:
    """The same fit with the p-value of its residuals for noise that rows of one stop share.

    Several targets of one stop scatter together: their squares sum to other sizes than those of
    rows apart, and the numbers follow more of them. Fits stay as they are where no stop has two
    rows, where the loss is robust, or where a prior was weighed against larger noise.

    Parameters
    ----------
    identification : Identification
        From `train`.
    train : Measurements
        The shared noise is in their covariances.
    root : (m, 6, j) array
        Root of that noise, from `Circumstances.stops`.

    References
    ----------
    Satterthwaite 1946: r'r is E / nu times chi-square of nu = E^2 / tr(V^2), E = tr V, with V the
    covariance of r.
    """
    fit, stops = identification, np.column_stack([train.pose_id, train.repeat])
    if len(np.unique(stops, axis=0)) == len(train) or not root.any():
        return fit
    if fit.mode != "whitened" or fit.loss != "squared" or fit.tightened != 1.0:
        return fit
    E, spread = _traces(fit, train, root)
    nu = E**2 / spread
    p = float(chdtrc(nu, fit.chi_square * nu / E))
    said, lack = (fit.chi_square, fit.dof_effective), fit.lack_of_fit
    old = squared_notes(*said, fit.p_value, lack)
    notes = (*(note for note in fit.notes if note not in old), *squared_notes(*said, p, lack))
    return replace(fit, p_value=p, notes=notes)


def _traces(fit: Identification, train: Measurements, root: Array) -> tuple[float, float]:
    """Tr V and tr V^2 of the covariance V of whitened residuals.

    References
    ----------
    V = M + M S M, M = I - B B', B B' = A C A', and S what whitened rows of a stop share. Nothing
    (n, n) is made: M^k = I - B P_k B', and S has zeros where a row meets itself.
    """
    stack = linearize(fit.model, train)
    B = stack.A[:, fit.parameters.free_index] @ covariance_factor(fit.covariance)
    filled = np.arange(6) < train.equations[:, None]
    own = np.where(filled[:, :, None], table_whiteners(train) @ root, 0.0)
    R = own[filled]  # (n, j) in the order of the equations
    _, stop = np.unique(np.column_stack([train.pose_id, train.repeat]), axis=0, return_inverse=True)
    SB, square = np.zeros_like(B), 0.0
    for group, sign in ((stop.ravel(), 1.0), (np.arange(len(train)), -1.0)):
        of = group[stack.row_of]  # all pairs of a stop, less those of a row with itself
        across = np.zeros((int(of.max()) + 1, R.shape[1], B.shape[1]))
        np.add.at(across, of, R[:, :, None] * B[:, None])
        SB += sign * np.einsum("nj,njf->nf", R, across[of])
        inner = np.zeros((len(across), R.shape[1], R.shape[1]))
        np.add.at(inner, of, R[:, :, None] * R[:, None])
        square += sign * float((inner**2).sum())
    G, T, one = B.T @ B, B.T @ SB, np.eye(B.shape[1])
    second = 2 * one - G  # P_2
    third = second + one - second @ G
    first = len(B) - np.trace(G) - np.trace(second @ T)
    spread = len(B) - np.trace(second @ G) - 2 * np.trace(third @ T) + square
    spread += np.trace(second @ T @ second @ T) - 2 * np.trace(second @ SB.T @ SB)
    return float(first), float(spread)
