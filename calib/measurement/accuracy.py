"""Errors of stated poses against true ones, and the statistics that sum them up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, FloatOrNan, check
from calib.errors import refuse
from calib.geometry.frames import turn_angle


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Statistics of error sizes over a set of poses, in the unit of the errors [m or rad]."""

    mean: float
    rms: float
    sd: FloatOrNan
    """Experimental standard deviation, n - 1; nan for one pose."""
    p95: float
    """95th percentile, linear between order statistics."""
    maximum: float
    count: int
    """Poses."""


def position_errors(T_true: ArrayLike, T_stated: ArrayLike) -> Array:
    """Distance (m,) [m] between the origins of true and stated poses (m, 4, 4)."""
    true, stated = check("m 4 4, m 4 4", T_true=T_true, T_stated=T_stated)
    return np.asarray(np.linalg.norm(stated[:, :3, 3] - true[:, :3, 3], axis=1))


def rotation_errors(T_true: ArrayLike, T_stated: ArrayLike) -> Array:
    """Angle (m,) [rad] of the rotation between true and stated poses (m, 4, 4)."""
    true, stated = check("m 4 4, m 4 4", T_true=T_true, T_stated=T_stated)
    turn = stated[:, :3, :3] @ np.swapaxes(true[:, :3, :3], -1, -2)
    return turn_angle(turn)


def error_statistics(errors: ArrayLike) -> Accuracy:
    """Statistics of error sizes (m,) [m or rad].

    Raises
    ------
    InputError
        A3: there are no errors, or one is negative.
    """
    (errors,) = check("m", errors=errors)
    if len(errors) == 0 or errors.min() < 0:
        message = f"errors has the value {errors.min():.3g}" if len(errors) else "errors is empty"
        allowed = "at least one error size, none negative"
        raise refuse("errors", allowed=allowed, code="A3", message=message)
    return Accuracy(
        mean=float(errors.mean()),
        rms=float(np.sqrt(np.mean(errors**2))),
        sd=float(errors.std(ddof=1)) if len(errors) > 1 else float("nan"),
        p95=float(np.quantile(errors, 0.95)),
        maximum=float(errors.max()),
        count=len(errors),
    )


def point_distances(a: Array, b: Array) -> Array:
    """Distances (m,) [m] between points (m, 3)."""
    return np.asarray(np.linalg.norm(a - b, axis=1))
