"""Accuracy and repeatability of orientation after ISO 9283, by rotation vectors."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen
from calib.geometry.frames import exp_so3, log_so3
from calib.kinds import in_short
from calib.measurement.cycles import (
    covariances_of,
    jackknife,
    per_pose,
    require_rotations,
    rotations_of,
    sd_bias,
)
from calib.measurement.iso9283 import IsoFigure, accuracy


@in_short
def rotation_accuracy(
    R: ArrayLike, command: ArrayLike, *, common: ArrayLike | None = None
) -> IsoFigure:
    """AP of orientation: angle from the commanded to the mean attained rotation.

    Parameters
    ----------
    R : (..., n, 3, 3) array_like
        Attained rotations R_world_tool.
    command : (..., 3, 3) array_like
        Commanded rotation.
    common : (..., 3, 3) array_like, optional
        Covariance of the rotation error that all readings of a pose share, world axes [rad^2].

    Notes
    -----
    Rotation vectors about the mean rotation, in world axes: no Euler angles, so nothing depends on
    how the tool stands. Their mean is the vector from the commanded to the mean rotation, not the
    mean of vectors from the commanded one: half a turn away those would point to both sides.
    """
    R = rotations_of(R)
    mean = mean_rotation(R)
    target = require_rotations("command", per_pose(command, R.shape[:-3], "command", (3, 3)))
    away = rotation_vectors(mean[..., None, :, :], target)
    return accuracy(rotation_vectors(R, mean) + away, np.zeros(3), common=common)


@in_short
def rotation_repeatability(R: ArrayLike, *, noise: ArrayLike | None = None) -> IsoFigure:
    """RP of orientation: three standard deviations of the rotation about each world axis (..., 3).

    Parameters
    ----------
    R : (..., n, 3, 3) array_like
        Attained rotations R_world_tool.
    noise : (..., 3, 3) array_like, optional
        Covariance of the rotation of one reading, world axes [rad^2]; the floor needs it.
    """
    R = rotations_of(R)
    turn = rotation_vectors(R, mean_rotation(R))
    n = turn.shape[-2]

    def spread(x: Array) -> Array:
        """Three standard deviations, per axis."""
        return np.asarray(3 * x.std(axis=-2, ddof=1))

    value = spread(turn)
    floor = np.full(value.shape, np.nan)
    if noise is not None:
        variance = np.diagonal(covariances_of(noise, "noise", R.shape[:-3]), axis1=-2, axis2=-1)
        floor = 3 * sd_bias(n) * np.sqrt(variance)
    return IsoFigure(frozen(value), frozen(jackknife(spread, turn)), frozen(floor))


def mean_rotation(R: Array) -> Array:
    """Rotation (..., 3, 3) about which the rotation vectors of R (..., n, 3, 3) have mean zero."""
    mean = R[..., 0, :, :]
    for _ in range(20):
        step = rotation_vectors(R, mean).mean(axis=-2)
        mean = exp_so3(step) @ mean
        if np.abs(step).max(initial=0.0) < 1e-15:
            break
    return np.asarray(mean)


def rotation_vectors(R: Array, about: Array) -> Array:
    """Rotation vectors (..., n, 3) from one rotation (..., 3, 3) to each of R, world axes [rad]."""
    return log_so3(R @ np.swapaxes(about, -1, -2)[..., None, :, :])
