"""Noise of measurements: the covariance of each observation, and the matrices that whiten it.

Every 6 x 6 covariance is of [position (m); rotation vector (rad)] in world axes.
"""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import InputError, refuse
from calib.geometry.frames import skew
from calib.geometry.jacobian import joint_columns, reflector_rows
from calib.geometry.model import RobotModel

SMALLEST_PIVOT = 1e-13
"""Pivot of the correlation matrix below which it is singular to rounding."""


def spherical_covariance(
    target: ArrayLike,
    T_world_tracker: ArrayLike,
    *,
    range_sd: tuple[float, float],
    transverse_sd: tuple[float, float],
    rotation_sd: tuple[float, float, float],
    centering_sd: float = 0.0,
    R_world_target: ArrayLike | None = None,
) -> Array:
    """Covariances (m, 6, 6) of a laser tracker, in world axes: small along the beam, larger across.

    The position part is s_rho^2 u u' + s_T^2 (I - u u') + s_c^2 I for the unit beam u and range
    rho, with s_rho = a + b rho and s_T = c + e rho. The rotation is independent of the position.

    Parameters
    ----------
    target : (m, 3) array_like
        Target positions in the world [m].
    T_world_tracker : (4, 4) array_like
        Tracker in the world, origin at the gimbal point [m].
    range_sd : (a, b)
        Standard deviation along the beam: a [m] plus b [m/m] times range.
    transverse_sd : (c, e)
        Standard deviation across the beam: c [m] plus e [m/m] times range.
    rotation_sd : (rx, ry, rz)
        Standard deviation of the target's rotation about its own axes [rad].
    centering_sd : float
        Standard deviation of the target's center along each axis [m].
    R_world_target : (m, 3, 3) array_like, optional
        Axes that `rotation_sd` refers to; the world's by default.

    Raises
    ------
    InputError
        A3: a target lies at the tracker's origin.
    """
    target, T = check("m 3, 4 4", target=target, T_world_tracker=T_world_tracker)
    beam = target - T[:3, 3]
    distance = np.linalg.norm(beam, axis=1)
    if (distance == 0).any():
        row = int(np.argmin(distance))
        message = f"target[{row}] lies at the tracker's own origin"
        raise refuse("target", row, "a beam needs a length", code="A3", message=message)
    # variances along and across the unit beam
    u = beam / distance[:, None]
    along = (range_sd[0] + range_sd[1] * distance) ** 2
    across = (transverse_sd[0] + transverse_sd[1] * distance) ** 2
    # position: (along - across) u u' + (across + centering) I
    covariance = np.zeros((len(target), 6, 6))
    covariance[:, :3, :3] = (along - across)[:, None, None] * (u[:, :, None] * u[:, None, :])
    covariance[:, :3, :3] += (across + centering_sd**2)[:, None, None] * np.eye(3)
    # rotation: in the axes of the target, then of the world
    covariance[:, 3:, 3:] = np.diag(np.square(rotation_sd))
    if R_world_target is not None:
        _, R = check("m 3, m 3 3", target=target, R_world_target=R_world_target)
        covariance[:, 3:, 3:] = R @ covariance[:, 3:, 3:] @ np.swapaxes(R, -1, -2)
    return covariance


def with_joint_noise(
    model: RobotModel,
    q: ArrayLike,
    covariance: ArrayLike,
    sigma_q: ArrayLike,
    *,
    offset: ArrayLike | None = None,
) -> Array:
    """Covariances (m, 6, 6) of device noise and joint repeatability: Sigma + J_q diag(s^2) J_q'.

    Joint repeatability is input noise; to first order this weighting equals that of a fit which
    estimates the joint values too.

    Parameters
    ----------
    model : RobotModel
        Model at which the joint columns J_q are taken.
    q : (m, n) array_like
        Commanded joint values [rad, m].
    covariance : (m, 6, 6) array_like
        Covariances of the measuring device alone, in world axes [m^2, m rad, rad^2].
    sigma_q : (n,) array_like
        Standard deviation of each joint value [rad or m].
    offset : (m, 3) array_like, optional
        Reflector in the tool frame, for point observations [m]; the tool origin by default.

    References
    ----------
    Hollerbach & Wampler 1996 (input noise).
    """
    n = model.chain.n_joints
    q, covariance, sigma_q = check(
        f"m {n}, m 6 6, {n}", q=q, covariance=covariance, sigma_q=sigma_q
    )
    T, J = model.poses_and_jacobian(q)
    J_q = J[:, :, joint_columns(model.chain)]
    if offset is not None:
        _, offset = check("m 6 6, m 3", covariance=covariance, offset=offset)
        J_q[:, :3] = reflector_rows(T, J_q, offset)[1]
    # joint scatter at the tool
    J_q = J_q * sigma_q
    return np.asarray(covariance + J_q @ np.swapaxes(J_q, -1, -2))


def inverse_covariance(T: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariances (m, 6, 6) of the inverses of transforms whose own are known.

    An error (d, w) of T = (R, t) is -R' (d + t x w, w) in the inverse: what turns T moves it.

    Parameters
    ----------
    T : (m, 4, 4) array_like
        Transforms as they were read [m].
    covariance : (m, 6, 6) array_like
        Their covariances, in the axes that `T` leads to [m^2, m rad, rad^2].
    """
    T, covariance = check("m 4 4, m 6 6", T=T, covariance=covariance)
    back = np.swapaxes(T[:, :3, :3], -1, -2)
    moved = np.zeros_like(covariance)
    moved[:, :3, :3] = moved[:, 3:, 3:] = back
    moved[:, :3, 3:] = back @ skew(T[:, :3, 3])
    return np.asarray(moved @ covariance @ np.swapaxes(moved, -1, -2))


def whiteners(covariance: ArrayLike) -> Array:
    """Inverse lower Cholesky factors N (m, r, r) of covariances (m, r, r): N Sigma N' = I.

    Raises
    ------
    InputError
        M34: a covariance is not symmetric positive definite; the observation is named. This is
        judged on the correlation matrix, so that meters and radians do not mix.
    """
    (covariance,) = check("m r r", covariance=covariance)
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    if (variance <= 0).any():
        raise _indefinite(covariance, int(np.argwhere((variance <= 0).any(1))[0, 0]))
    # correlations: meters and radians do not mix
    scale = np.sqrt(variance)
    correlation = covariance / (scale[:, :, None] * scale[:, None, :])
    asymmetry = np.abs(correlation - np.swapaxes(correlation, -1, -2)).max((-1, -2), initial=0.0)
    if (asymmetry > 1e-9).any():
        row = int(np.argmax(asymmetry))
        message = f"covariance[{row}] is not symmetric, by {asymmetry[row]:.1e} of its scale"
        fix = "give the full symmetric matrix"
        raise refuse("covariance", row, code="M34", message=message, fix=fix)
    try:
        L = np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        worst = int(np.argmin(np.linalg.eigvalsh(correlation)[:, 0]))
        raise _indefinite(covariance, worst) from None
    pivots = np.square(np.diagonal(L, axis1=1, axis2=2)).min(-1, initial=1.0)
    if (pivots < SMALLEST_PIVOT).any():
        raise _indefinite(covariance, int(np.argmin(pivots)))
    return np.linalg.solve(L, np.eye(L.shape[-1])) / scale[:, None, :]


def _indefinite(covariance: Array, row: int) -> InputError:
    """The error for one covariance that is not positive definite."""
    smallest = float(np.linalg.eigvalsh(covariance[row])[0])
    return refuse(
        "covariance",
        smallest,
        "every direction must scatter a little",
        code="M34",
        message=f"covariance[{row}] is not positive definite: smallest eigenvalue {smallest:.3g}",
        fix="give each axis a standard deviation above zero",
    )
