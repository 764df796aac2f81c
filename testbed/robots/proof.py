"""Do two kinematics agree: joint values spread over the limits, and how far poses are apart."""

import numpy as np

from calib.arrays import Array

LIMIT = 1e-9
"""Largest difference between a file and the robot it stands for [m or rad]."""


def spread(limits: Array, count: int) -> Array:
    """Joint values (count, n) spread evenly over limits (n, 2), always the same [rad or m].

    References
    ----------
    Additive recurrence on powers of the root of x^(n+1) = x + 1, the generalized golden ratio.
    """
    n = len(limits)
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (n + 1))
    share = (0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, n + 1)) % 1.0
    return np.asarray(limits[:, 0] + share * (limits[:, 1] - limits[:, 0]))


def difference(T: Array, other: Array) -> tuple[float, float]:
    """Largest distance [m] and largest angle [rad] between poses (m, 4, 4)."""
    position = np.linalg.norm(T[:, :3, 3] - other[:, :3, 3], axis=1)
    # |R - S| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm: exact for small angles too
    apart = np.linalg.norm(T[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / np.sqrt(8)
    return float(position.max()), float(2 * np.arcsin(np.clip(apart, 0, 1)).max())
