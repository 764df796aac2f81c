"""Derivatives by central differences, which those that are written out are held against."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.frames import log_so3


def slopes(
    f: Callable[[Array], Array],
    x: ArrayLike,
    h: float = 1e-6,
    *,
    by: Iterable[int] | None = None,
    minus: Callable[[Array, Array], Array] = np.subtract,
) -> Array:
    """How `f` changes with each number of `x` (..., n), or of those at the places `by`; last axis.

    Off by h^2 / 6 of the third derivative, and by rounding, 1e-16 / h of what `f` is.
    """
    x = np.asarray(x, dtype=float)
    steps = h * np.eye(x.shape[-1])
    steps = steps if by is None else steps[list(by)]
    return np.stack([minus(f(x + e), f(x - e)) / (2 * h) for e in steps], axis=-1)


def twist(T: Array, other: Array) -> Array:
    """Rows [dp; dr] (m, 6) from one pose to another in world axes."""
    turn = log_so3(T[:, :3, :3] @ np.swapaxes(other[:, :3, :3], 1, 2))
    return np.hstack([T[:, :3, 3] - other[:, :3, 3], turn])
