"""Joint values that bring the nominal tool to a wanted pose: every way found from many starts."""

import numpy as np

from calib.arrays import Array
from calib.geometry.inverse import inverse
from testbed.robots.catalog import Robot

STARTS = 64


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
    every = np.broadcast_to(T, (len(starts), 4, 4))
    found = inverse(robot.model, every, starts, robot.limits)
    if found.reached.any():
        return found.q[found.reached], 0.0
    return found.q[:0], float(found.position_error.min())
