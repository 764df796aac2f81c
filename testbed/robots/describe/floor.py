"""The floor below an arm that a URDF or an MJCF describes, which neither of them states."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.meshes.files import read_mesh
from testbed.robots.robot import Visual
from testbed.robots.room import leading_slides, reach

LEANS, ROOM = 0.5, 1.0
"""Cosine up to which a z axis is not upright; how far a floor that is none lies away [m]."""


def floor_of(visuals: Sequence[Visual], chain: Chain, limits: Array) -> float:
    """Height of the floor in the base frame [m]: where the base ends, else the world's z = 0.

    A slide along the ground has its z axis there: nothing across it is a floor, which then lies
    beyond all that the arm reaches.
    """
    up = float(chain.T_world_base[2, 2])
    if leading_slides(chain) and abs(up) <= LEANS:
        return -float(np.abs(limits[0]).max() + reach(chain, limits) + ROOM)
    lowest = []
    for visual in visuals:
        if visual.link == 0:
            affine = np.array(visual.affine)
            heights = read_mesh(visual.file)[0] @ affine[2, :3] + affine[2, 3]
            lowest.append(float(heights.min()))
    if lowest:
        return min(lowest)
    return float(-chain.T_world_base[2, 3] / up) if up > LEANS else 0.0
