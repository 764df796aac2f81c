"""Residuals, seen minus predicted, and Jacobians: whitened (6 or 3 rows) or the paper's 12 rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import InputError
from calib.geometry.frames import log_so3, right_jacobian_inverse
from calib.geometry.model import RobotModel
from calib.geometry.sweep import matrix_rows, reflector_rows
from calib.measurement.noise import whiteners
from calib.measurement.observations import Measurements


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """Linear system of one model and one table: r is about A dx for a small step dx."""

    r: Array
    """(N,) seen minus predicted: whitened rows, or [1] and [mm] for the paper's rows."""
    A: Array
    """(N, P) derivative of the prediction by every number of the model, per m and rad."""
    row_of: Index
    """(N,) observation each row belongs to."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "r", frozen(self.r))
        object.__setattr__(self, "A", frozen(self.A))
        object.__setattr__(self, "row_of", frozen(self.row_of, np.int64))


def table_whiteners(measurements: Measurements) -> Array:
    """Whitening matrices (m, 6, 6) of a table; point rows use their first 3 x 3 covariance."""
    covariance = measurements.covariance
    points = ~measurements.is_pose
    if points.any():
        covariance = covariance.copy()
        covariance[points, 3:] = 0
        covariance[points, :, 3:] = 0
        covariance[points, 3:, 3:] = np.eye(3)
    return whiteners(covariance)


def stacked(
    model: RobotModel, measurements: Measurements, *, whitening: Array | None = None
) -> Stack:
    """Whitened residual and Jacobian of a table: six rows per pose, three per point.

    A pose row is [p_seen - p; Log(R_seen R')] in world axes; the derivative of its rotation part is
    -Jr^-1(e) Jw, exact for any residual e.

    Parameters
    ----------
    model : RobotModel
        Predicts.
    measurements : Measurements
        What was seen.
    whitening : (m, 6, 6) array, optional
        `table_whiteners(measurements)` if already at hand; it does not depend on the model.

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144).
    """
    N = table_whiteners(measurements) if whitening is None else whitening
    T, J = model.poses_and_jacobian(measurements.q)
    p, is_pose = T[:, :3, 3], measurements.is_pose
    points = np.flatnonzero(~is_pose)
    if len(points):
        p = p.copy()
        p[points], J[points, :3] = reflector_rows(T[points], J[points], measurements.offset[points])
    e = log_so3(measurements.rotation @ np.swapaxes(T[:, :3, :3], -1, -2))
    J[:, 3:] = right_jacobian_inverse(e) @ J[:, 3:]
    raw = np.concatenate([measurements.position - p, e], axis=1)
    keep = np.ones((len(raw), 6), dtype=bool)
    keep[points, 3:] = False
    return Stack(
        (N @ raw[:, :, None])[:, :, 0][keep],
        (N @ J)[keep],
        np.nonzero(keep)[0],
    )


def whitened_blocks(model: RobotModel, q: ArrayLike, covariance: ArrayLike) -> Array:
    """Whitened Jacobians (m, 6, P) of poses not measured yet, at joint values q (m, n)."""
    q, covariance = check("m n, m 6 6", q=q, covariance=covariance)
    return np.asarray(whiteners(covariance) @ model.poses_and_jacobian(q)[1])


def point_blocks(
    model: RobotModel, q: ArrayLike, covariance: ArrayLike, offset: ArrayLike
) -> Array:
    """Whitened Jacobians (m, 3, P) of reflectors at tool coordinates `offset` (m, 3) [m]."""
    q, covariance, offset = check("m n, m 3 3, m 3", q=q, covariance=covariance, offset=offset)
    T, J = model.poses_and_jacobian(q)
    return np.asarray(whiteners(covariance) @ reflector_rows(T, J, offset)[1])


def paper_stack(model: RobotModel, measurements: Measurements) -> Stack:
    """The paper's twelve unweighted rows per pose: dn, do, da as numbers, dp in mm.

    The columns stay per m and rad: least squares without weights does not depend on column units,
    but it does on those of the rows.

    References
    ----------
    Wen et al. 2022, eqs. (3)-(5).
    """
    if not measurements.is_pose.all():
        row = int(np.argmin(measurements.is_pose))
        raise InputError(
            f"row {row} is a point; the twelve rows need position and rotation",
            code="A3",
            field="kind",
            value=row,
            fix='use the mode "whitened"',
        )
    T, J = model.poses_and_jacobian(measurements.q)
    turned = np.swapaxes(measurements.rotation - T[:, :3, :3], -1, -2).reshape(-1, 9)
    shifted = 1e3 * (measurements.position - T[:, :3, 3])
    rows = matrix_rows(T, J)
    rows[:, 9:] *= 1e3
    return Stack(
        np.concatenate([turned, shifted], axis=1).ravel(),
        rows.reshape(-1, rows.shape[-1]),
        np.repeat(np.arange(len(T)), 12),
    )
