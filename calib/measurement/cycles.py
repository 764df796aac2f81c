"""Border checks of repeated visits: stacks of positions, rotations and covariances."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.errors import InputError

FEWEST = 3
"""Cycles below which no scatter is worth stating."""


def cycles_of(position: ArrayLike) -> Array:
    """Positions (..., n, 3), checked."""
    x = np.asarray(position, dtype=np.float64)
    if x.ndim < 2 or x.shape[-1] != 3 or x.shape[-2] < FEWEST:
        raise InputError(
            f"position has shape {x.shape}", code="A1", field="position", value=x.shape,
            allowed=f"(..., n, 3) with at least {FEWEST} cycles",
        )  # fmt: skip
    require_finite(x, "position")
    return x


def rotations_of(R: ArrayLike) -> Array:
    """Rotations (..., n, 3, 3), checked."""
    array = np.asarray(R, dtype=np.float64)
    if array.ndim < 3 or array.shape[-2:] != (3, 3) or array.shape[-3] < FEWEST:
        raise InputError(
            f"R has shape {array.shape}", code="A1", field="R", value=array.shape,
            allowed=f"(..., n, 3, 3) with at least {FEWEST} cycles",
        )  # fmt: skip
    require_finite(array, "R")
    return array


def matching(values: ArrayLike, lead: tuple[int, ...], name: str, tail: tuple[int, ...]) -> Array:
    """Values that stand for every pose (..., *tail)."""
    array = np.asarray(values, dtype=np.float64)
    try:
        array = np.broadcast_to(array, (*lead, *tail))
    except ValueError:
        raise InputError(
            f"{name} has shape {array.shape}", code="A1", field=name, value=array.shape,
            allowed=f"expected {(*lead, *tail)}",
        ) from None  # fmt: skip
    require_finite(array, name)
    return array


def covariances_of(values: ArrayLike, name: str) -> Array:
    """Covariances (..., 3, 3), none with a negative direction."""
    C = np.asarray(values, dtype=np.float64)
    if C.shape[-2:] != (3, 3):
        raise InputError(
            f"{name} has shape {C.shape}", code="A1", field=name, allowed="expected (..., 3, 3)"
        )
    require_finite(C, name)
    least = np.linalg.eigvalsh(C)[..., 0].min(initial=0.0)
    if least < -1e-9 * max(float(np.abs(C).max()), 1e-300):
        raise InputError(
            f"{name} has the eigenvalue {least:.3g}", code="M34", field=name, value=float(least),
            allowed="a covariance has no negative eigenvalue",
        )  # fmt: skip
    return C


def require_finite(x: Array, name: str) -> None:
    """Refuse nan and inf by their place."""
    if not np.isfinite(x).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(x))[0])
        raise InputError(
            f"{name}{list(where)} is {x[where]}", code="A2", field=name, value=float(x[where]),
            allowed="every value must be finite",
        )  # fmt: skip
