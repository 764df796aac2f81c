"""Linear propagation: from the covariance of the parameters to that of the tool pose."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.geometry.model import RobotModel


def tool_covariance(model: RobotModel, q: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance (m, 6, 6) of the tool pose at joints q, propagated from that of the parameters.

    Rows and columns are [position (m); rotation vector (rad)] in world axes. Measurement noise and
    joint repeatability of the later move are not included.

    Parameters
    ----------
    model : RobotModel
        Identified model, at which the covariance was taken.
    q : (m, n) array_like
        Commanded joint values [rad, m].
    covariance : (P, P) array_like
        Covariance of the full parameter vector [m^2, m rad, rad^2]; zero rows and columns for fixed
        numbers.

    References
    ----------
    JCGM 102:2011: Sigma_t = J_t C J_t'.
    """
    (covariance,) = check(f"{model.n_numbers} {model.n_numbers}", covariance=covariance)
    moving = np.flatnonzero(np.diagonal(covariance))
    J = model.poses_and_jacobian(q)[1][:, :, moving]
    return propagated(J, covariance[np.ix_(moving, moving)])


def propagated(rows: Array, covariance: Array) -> Array:
    """Covariances R C R' (N, k, k), symmetric to the bit, for rows R (N, k, P) and C (P, P).

    All rows are multiplied with C at once; one product for each of the N is several times slower.
    """
    sigma = np.tensordot(rows, covariance, 1) @ np.swapaxes(rows, -1, -2)
    return np.asarray((sigma + np.swapaxes(sigma, -1, -2)) / 2)


def axis_uncertainty(sigma: Array) -> Array:
    """Standard uncertainties u_x, u_y, u_z (m, 3) [m] from covariances (m, 6, 6) or (m, 3, 3)."""
    # rounding may leave a hair below zero where nothing uncertain moves the tool
    return np.sqrt(np.maximum(np.diagonal(sigma, axis1=-2, axis2=-1)[..., :3], 0.0))


def point_uncertainty(sigma: Array) -> Array:
    """RMS length of the tool point's error, u_3D = sqrt(u_x^2 + u_y^2 + u_z^2) (m,) [m]."""
    return np.asarray(np.sqrt(np.square(axis_uncertainty(sigma)).sum(axis=-1)))


def distance_uncertainty(sigma: Array, position: Array) -> Array:
    """Standard uncertainty (m,) of the tool's distance |P| from the origin, as in Wen et al. [m].

    Only the radial part of the scatter changes the distance from the origin: at the zero pose of
    the TX60 about a fifth of the whole.

    Parameters
    ----------
    sigma : (m, 6, 6) or (m, 3, 3) array
        Tool covariances.
    position : (m, 3) array
        Tool positions P in the frame from whose origin the distance is taken [m].

    References
    ----------
    Wen et al. 2022, whose g is read as sqrt(Px^2 + Py^2 + Pz^2): the squares are missing in print.
    """
    radial = position / np.linalg.norm(position, axis=-1, keepdims=True)
    variance = np.einsum("mi,mij,mj->m", radial, sigma[..., :3, :3], radial)
    # a base that only turns leaves |P| alone: rounding must not make it negative
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
