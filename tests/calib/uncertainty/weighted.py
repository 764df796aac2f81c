"""Weighted least squares written out: the second way to the covariance of an estimate."""

import numpy as np


def estimator(J, weight, prior=0.0):
    """F (m, f, r), from raw residual rows to the estimate: inv(sum J'WJ + Lambda0) J_j' W_j."""
    scale = np.linalg.norm(J.reshape(-1, J.shape[-1]), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    M = np.einsum("mrf,mrs,msg->fg", J, weight, J) + prior
    # scaled columns: metres and radians solve equally well
    pull = np.swapaxes(J, 1, 2) @ weight / scale[:, None]
    return np.linalg.solve(M / np.outer(scale, scale), pull) / scale[:, None]


def sandwich(J, weight, covariance, prior=0.0):
    """True covariance (f, f) of the estimate, whatever its weights; Lambda0 scatters as stated."""
    F = estimator(J, weight, prior)
    C = np.einsum("mfr,mrs,mgs->fg", F, covariance, F)
    if np.ndim(prior):
        H = np.einsum("mrf,mrs,msg->fg", J, weight, J) + prior
        C = C + np.linalg.solve(H, np.linalg.solve(H, prior).T)
    return (C + C.T) / 2
