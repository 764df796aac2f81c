"""Reach of an arm, and the places beside it where a tracker can stand."""

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse
from testbed.robots.placements import placements

BESIDE = 0.5
"""Least distance of a tracker from the robot's reach [m]."""
LEANS, ROOM = 0.5, 1.0
"""Cosine up to which a z axis is not upright; spare distance of the floor set beyond the reach of
an arm on a rail [m]."""
SPARE, TRIES = 0.05, 1000
"""Spare distance of a proposed place [m], and most steps to find one."""


def leading_slides(chain: Chain) -> int:
    """Sliding joints before the first one that turns: they carry the arm without turning it."""
    return next((k for k, kind in enumerate(chain.kinds) if kind != "prismatic"), chain.n_joints)


def reach(chain: Chain, limits: Array) -> float:
    """Length of the stretched arm from where it begins to turn, later slides at their farthest [m].

    It begins at the base, or at the end of slides that carry it.
    """
    frames, _, tool = placements(chain)
    k = leading_slides(chain)
    # a frame up to that joint says where the arm begins, not how long it is
    parts = [*frames[k + 1 :], tool] if k < chain.n_joints else []
    lengths = sum(float(np.linalg.norm(frame[:3, 3])) for frame in parts)
    slides = chain.prismatic.astype(bool)
    slides[:k] = False
    return lengths + float(np.abs(limits[slides]).max(axis=1, initial=0.0).sum())


def beyond_rail(chain: Chain, limits: Array) -> float | None:
    """A place on the base's z axis below all that an arm on a rail reaches [m]; None of others.

    A slide along the ground has its z axis there: nothing across it is a floor.
    """
    if not leading_slides(chain) or abs(chain.T_world_base[2, 2]) > LEANS:
        return None
    return beyond_arm(chain, limits) - float(np.abs(limits[0]).max())


def beyond_arm(chain: Chain, limits: Array) -> float:
    """A place on the base's z axis below all that an arm reaches [m]."""
    return -(reach(chain, limits) + ROOM)


def from_arm(chain: Chain, limits: Array, station: Array) -> float:
    """Distance of a station (3,) in the base frame from the nearest place where the arm begins [m].

    The place that slides carry it to is linear in their values, which have limits.
    """
    from scipy.optimize import lsq_linear

    frames, _, tool = placements(chain)
    k = leading_slides(chain)
    if not k:
        return float(np.linalg.norm(station))
    T, axes = inverse(chain.T_world_base), list[Array]()
    for number, frame in enumerate((*frames, tool)[: k + 1]):
        T = T @ frame
        if number < k:
            axes.append(T[:3, 2])
    nearest = lsq_linear(np.column_stack(axes), station - T[:3, 3], limits[:k].T)
    return float(np.sqrt(2 * nearest.cost))


def outside(chain: Chain, limits: Array, station: Array, direction: Array) -> Array:
    """A station (3,) in the base frame, moved along a direction until a tracker can stand there.

    Farther by a few centimeters than it must, so that its place can be rounded [m].
    """
    needed = reach(chain, limits) + BESIDE + SPARE
    for _ in range(TRIES):
        lacking = needed - from_arm(chain, limits, station)
        if lacking <= 0:
            break
        station = station + max(lacking, SPARE) * direction
    return station
