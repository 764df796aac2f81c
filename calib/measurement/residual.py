"""Whitened residuals, measured minus predicted, with Jacobians; the twelve rows of Wen et al."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen
from calib.errors import refuse
from calib.geometry.jacobian import matrix_rows, reflector_rows
from calib.geometry.model import RobotModel
from calib.measurement.noise import whiteners
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class Stack(Shown):
    """Linearized equations of one model and one table: r = A dx to first order in a step dx."""

    r: Array
    """(N,) measured minus predicted: whitened [1], or [1] and [mm] for the twelve rows."""
    A: Array
    """(N, P) derivative of the prediction by every number of the model, per m and rad."""
    row_of: Index
    """(N,) observation that each equation belongs to."""

    def __repr__(self) -> str:
        return f"Stack({self.A.shape[0]} rows, {self.A.shape[1]} numbers)"

    def __post_init__(self) -> None:
        for name, kind in (("r", np.float64), ("A", np.float64), ("row_of", np.int64)):
            object.__setattr__(self, name, frozen(getattr(self, name), kind))


def table_whiteners(measurements: Measurements) -> Array:
    """Whitening matrices (m, 6, 6) of a table; the identity for entries that a row does not have.

    Points use their first 3 x 3 covariance, distances the variance at [0, 0].
    """
    return whiteners(padded_covariance(measurements))


def padded_covariance(measurements: Measurements) -> Array:
    """Covariances (m, 6, 6) of a table; unit, uncorrelated for entries that a row does not have."""
    missing = np.arange(6) >= measurements.equations[:, None]
    if not missing.any():
        return measurements.covariance
    covariance = np.where(missing[:, :, None] | missing[:, None, :], 0.0, measurements.covariance)
    covariance[:, range(6), range(6)] += missing
    return covariance


def linearize(
    model: RobotModel, measurements: Measurements, *, whitening: Array | None = None
) -> Stack:
    """Whitened residual and Jacobian: six rows per pose, three per point, one per distance.

    A pose row is [p_seen - p; Log(R_seen R')] in the axes of its station; see
    `prediction.predict_at` for the derivatives.

    Parameters
    ----------
    model : RobotModel
        Model that predicts, and whose numbers are the columns.
    measurements : Measurements
        What was measured.
    whitening : (m, 6, 6) array, optional
        `table_whiteners(measurements)` if already at hand; it does not depend on the model.
    """
    N = table_whiteners(measurements) if whitening is None else whitening
    prediction = predict(model, measurements)
    return Stack(
        (N @ prediction.residual[:, :, None])[:, :, 0][prediction.filled],
        (N @ prediction.rows)[prediction.filled],
        np.nonzero(prediction.filled)[0],
    )


def whitened_blocks(model: RobotModel, q: ArrayLike, covariance: ArrayLike) -> Array:
    """Whitened Jacobians (m, 6, P) of poses yet to be measured, at joint values q (m, n).

    `covariance` (m, 6, 6) is in world axes [m^2, m rad, rad^2].
    """
    q, covariance = check("m n, m 6 6", q=q, covariance=covariance)
    return np.asarray(whiteners(covariance) @ model.poses_and_jacobian(q)[1])


def point_blocks(
    model: RobotModel, q: ArrayLike, covariance: ArrayLike, offset: ArrayLike
) -> Array:
    """Whitened Jacobians (m, 3, P) of reflectors yet to be measured, at joint values q (m, n).

    `offset` (m, 3) is in the tool frame [m], `covariance` (m, 3, 3) in world axes [m^2].
    """
    q, covariance, offset = check("m n, m 3 3, m 3", q=q, covariance=covariance, offset=offset)
    T, J = model.poses_and_jacobian(q)
    return np.asarray(whiteners(covariance) @ reflector_rows(T, J, offset)[1])


def paper_stack(model: RobotModel, measurements: Measurements) -> Stack:
    """The twelve unweighted equations per pose of Wen et al.: dn, do, da [1] and dp [mm].

    The columns stay per m and rad: unweighted least squares depends on the units of its rows, but
    not on those of its columns.

    Raises
    ------
    InputError
        A3: a row is no pose, or is of a further station or tool.

    References
    ----------
    Wen et al. 2022, eqs. (3)-(5).
    """
    fix = 'use the mode "whitened"'
    if not measurements.is_pose.all():
        row = int(np.argmin(measurements.is_pose))
        kind = f"row {row} is a {measurements.kind[row]}"
        message = f"{kind}; the twelve rows need position and rotation"
        raise refuse("kind", row, code="A3", message=message, fix=fix)
    for name in ("station", "tool"):
        further = getattr(measurements, name) > 0
        if further.any():
            row = int(np.argmax(further))
            message = f"row {row} was measured with a further {name}; the twelve rows know one"
            raise refuse(name, row, code="A3", message=message, fix=fix)
    T, J = model.poses_and_jacobian(measurements.q, measurements.conditions)
    turned = np.swapaxes(measurements.rotation - T[:, :3, :3], -1, -2).reshape(-1, 9)
    shifted = 1e3 * (measurements.position - T[:, :3, 3])
    rows = matrix_rows(T, J)
    rows[:, 9:] *= 1e3
    return Stack(
        np.concatenate([turned, shifted], axis=1).ravel(),
        rows.reshape(-1, rows.shape[-1]),
        np.repeat(np.arange(len(T)), 12),
    )
