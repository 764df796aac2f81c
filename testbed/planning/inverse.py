"""Joint values that bring the nominal tool to a wanted pose: damped Newton from many starts."""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import log_so3
from calib.geometry.sweep import joint_columns, pose_and_jacobian
from testbed.robots.catalog import Robot

STARTS = 64
ITERATIONS = 120
DAMPING = 1e-3
LONGEST = 0.5
"""Longest step of any joint in one iteration [rad or m]: keeps far starts from jumping about."""
POSITION, ROTATION = 1e-8, 1e-8
"""A start has arrived within this [m], [rad]."""


def reached_by(robot: Robot, T: Array, starts: Array) -> tuple[Array, float]:
    """Joint values (k, n) inside the limits that put the tool at T (4, 4), one per way found.

    Parameters
    ----------
    robot : Robot
        Nominal robot.
    T : (4, 4) array
        Wanted tool pose in the world [m].
    starts : (s, n) array
        Where the search begins [rad, m].

    Returns
    -------
    solutions : (k, n) array
        None or some; equal ones may come twice [rad, m].
    missed : float
        How near the tool position came in all [m]: zero if something was found.
    """
    columns, q = joint_columns(robot.model.chain), starts.copy()
    for _ in range(ITERATIONS):
        error, J = _error(robot, T, q, columns)
        JJ = J @ np.swapaxes(J, 1, 2) + DAMPING**2 * np.eye(6) * np.minimum(
            1.0, np.linalg.norm(error, axis=1)
        ).reshape(-1, 1, 1)
        # a floor of damping keeps singular postures solvable
        step = np.linalg.solve(JJ + 1e-12 * np.eye(6), error[..., None])
        step = (np.swapaxes(J, 1, 2) @ step)[..., 0]
        size = np.abs(step).max(axis=1, keepdims=True)
        q = within(robot, q + step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-12)))
    error, _ = _error(robot, T, q, columns)
    place = np.linalg.norm(error[:, :3], axis=1)
    turn = np.linalg.norm(error[:, 3:], axis=1)
    inside = ((q >= robot.limits[:, 0]) & (q <= robot.limits[:, 1])).all(axis=1)
    good = (place < POSITION) & (turn < ROTATION) & inside
    return q[good], 0.0 if good.any() else float(place.min())


def within(robot: Robot, q: Array) -> Array:
    """The same postures with each revolute joint turned by whole turns toward its range."""
    middle = robot.limits.mean(axis=1)
    turns = np.round((q - middle) / (2 * np.pi)) * (1 - robot.model.chain.prismatic)
    return np.asarray(q - 2 * np.pi * turns)


def _error(robot: Robot, T: Array, q: Array, columns: list[int]) -> tuple[Array, Array]:
    """Missing step (s, 6) to the wanted pose, world axes, and the joint Jacobian (s, 6, n)."""
    here, J = pose_and_jacobian(robot.model.chain, q)
    turn = log_so3(T[:3, :3] @ np.swapaxes(here[:, :3, :3], 1, 2))
    return np.hstack([T[:3, 3] - here[:, :3, 3], turn]), J[:, :, columns]
