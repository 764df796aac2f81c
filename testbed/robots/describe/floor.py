"""The floor below an arm that a URDF or an MJCF describes, which neither of them states."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.meshes.files import read_mesh
from testbed.robots.parts import Primitive, Visual
from testbed.robots.room import LEANS, beyond_rail


def floor_of(parts: Sequence[Visual | Primitive], chain: Chain, limits: Array) -> float:
    """Height of the floor in the base frame [m]: where the base ends, else the world's z = 0.

    An arm on a rail has none: it lies beyond all that the arm reaches.
    """
    if (beyond := beyond_rail(chain, limits)) is not None:
        return beyond
    up, lowest = float(chain.T_world_base[2, 2]), []
    for part in parts:
        up_of_part, height = np.array(part.affine)[2, :3], part.affine[2][3]
        if part.link == 0 and isinstance(part, Visual):
            lowest.append(height + float((read_mesh(part.file)[0] @ up_of_part).min()))
        elif part.link == 0 and isinstance(part, Primitive):
            lowest.append(height - part.form.support(up_of_part))
    if lowest:
        return min(lowest)
    return float(-chain.T_world_base[2, 3] / up) if up > LEANS else 0.0
