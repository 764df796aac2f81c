"""Where a robot is at work by default: the box it states, or one derived from its reach."""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import inverse
from testbed.robots.robot import Robot, Workspace
from testbed.units import in_units

SAMPLE = 2000
"""Postures in the joint limits from which the reach is derived."""
SHARE = (10.0, 90.0)
"""The box holds what lies between these percentiles of the reach, axis by axis."""
ABOVE = 0.1
"""Postures whose tool is lower above the floor than this do not count [m]."""
STAND = 0.675
"""Height of the drawn tracker's beam above its floor [m]."""
AWAY = 3.0
"""The tracker stands so many halves of the box's diagonal from its center, and 2 m or more."""
NEAREST = 2.0
ASIDE = np.radians(-40.0)
"""Direction of the tracker from the base, about the base's z [rad]."""
TURNS = 1.5
"""Joints that turn farther than so many turns are kept to half a turn about their middle."""
STEP = 0.01
"""All numbers are rounded to this, for people [m]."""


def workspace(robot: Robot) -> Workspace:
    """The workspace that a robot states, else one derived from its reach.

    A fixed sample of postures in the joint limits is used: the answer belongs to the robot.

    Examples
    --------
    >>> from testbed.robots.catalog import load_robot
    >>> workspace(load_robot("staubli_tx60")).box_size_mm
    (900.0, 1200.0, 800.0)
    """
    return robot.workspace or workspace_of_reach(robot)


def workspace_of_reach(robot: Robot) -> Workspace:
    """A box that holds the middle 80 % of the reach along each axis, and a tracker beside it."""
    lower, upper = (ranges := joint_ranges(robot)).T
    q = np.random.default_rng(0).uniform(lower, upper, (SAMPLE, len(lower)))
    T = inverse(robot.model.chain.T_world_base) @ robot.model.poses(q)
    place = T[:, :3, 3]
    above = place[:, 2] > robot.base_offset + ABOVE
    low, high = np.percentile(place[above] if above.any() else place, SHARE, axis=0)
    center, size = (low + high) / 2, np.maximum(high - low, STEP)
    away = max(AWAY * float(np.linalg.norm(size)) / 2, NEAREST)
    station = np.array(
        [
            center[0] + away * np.cos(ASIDE),
            center[1] + away * np.sin(ASIDE),
            robot.base_offset + STAND,
        ]
    )
    kept: tuple[tuple[float, float], ...] = ()
    if not np.array_equal(ranges, robot.limits):
        slides = robot.model.chain.prismatic.astype(bool)[:, None]
        kept = tuple((float(a), float(b)) for a, b in in_units(ranges, slides).round(6))
    return Workspace(in_mm(center), in_mm(size), in_mm(station), kept)


def joint_ranges(robot: Robot) -> Array:
    """The joint limits (n, 2), but no more than a turn where a joint may turn on and on."""
    middle, reach = robot.limits.mean(axis=1), np.ptp(robot.limits, axis=1) / 2
    many = (reach > TURNS * np.pi) & ~robot.model.chain.prismatic.astype(bool)
    reach = np.where(many, np.pi, reach)
    return np.where(many[:, None], np.stack([middle - reach, middle + reach], 1), robot.limits)


def in_mm(point: Array) -> tuple[float, float, float]:
    """A point (3,) [m] in mm, rounded to whole centimeters."""
    x, y, z = (np.round(point / STEP) * STEP * 1e3).round(6) + 0.0
    return float(x), float(y), float(z)
