"""Estimates by any weights, and their true covariance, from raw rows: a second way to both."""

import numpy as np
from scipy.linalg import solve_triangular

from calib.uncertainty.covariance import covariance_factor


def estimator(J, weight, prior_precision=None):
    """F (m, f, r) of the raw rows, dx = sum_j F_j r_j, and the same (f, k) of the k prior rows.

    F_j = inv(sum J'WJ + Lambda0) J_j' W_j, by one QR factorization of the scaled rows.
    """
    m, r, f = J.shape
    root = np.swapaxes(np.linalg.cholesky(weight), -1, -2)
    rows = (root @ J).reshape(m * r, f)
    if prior_precision is not None:
        rows = np.concatenate([rows, covariance_factor(prior_precision).T])
    scale = np.linalg.norm(rows, axis=0)
    Q, R = np.linalg.qr(rows / scale)
    F = solve_triangular(R, Q.T) / scale[:, None]
    measured, prior = F[:, : m * r], F[:, m * r :]
    return np.moveaxis(measured.reshape(f, m, r), 0, 1) @ root, prior


def sandwich(J, weight, covariance, prior_precision=None):
    """Covariance (f, f) of a weighted estimate whose rows really have `covariance` (m, r, r).

    C = inv(H) (J'W S WJ + Lambda0) inv(H), H = J'WJ + Lambda0.
    """
    F, prior = estimator(J, weight, prior_precision)
    m, f, r = F.shape
    columns = np.moveaxis(F @ np.linalg.cholesky(covariance), 1, 0).reshape(f, m * r)
    return columns @ columns.T + prior @ prior.T
