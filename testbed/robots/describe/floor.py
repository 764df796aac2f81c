"""The floor below an arm that a URDF or an MJCF describes, which neither of them states."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.bounds import CELL
from testbed.robots.meshes.files import read_mesh
from testbed.robots.parts import Primitive, Visual
from testbed.robots.room import LEANS, beyond_arm, beyond_rail


def floor_of(
    parts: Sequence[Visual | Primitive], chain: Chain, limits: Array, *, stands: bool = False
) -> tuple[float, float | None]:
    """Height of the floor in the base frame, and of the base frame above a level floor [m].

    The floor is where the base ends, else at the world's z = 0. It lies across the first axis, and
    nothing is known of another one. Where that axis does not point up although the base `stands`
    upright (arms of KUKA turn clockwise), the floor is level, and nothing lies across the axis: as
    below an arm on a rail, that is beyond all that the arm reaches.
    """
    if (beyond := beyond_rail(chain, limits)) is not None:
        return beyond, None
    level = stands and chain.T_world_base[2, 2] <= LEANS
    up = chain.T_world_base[2, :3] if level else np.array([0.0, 0.0, 1.0])
    lowest = []
    for part in parts:
        affine = np.array(part.affine)
        up_of_part, height = up @ affine[:3, :3], float(up @ affine[:3, 3])
        if part.link == 0 and isinstance(part, Visual):
            lowest.append(height + float((read_mesh(part.file)[0] @ up_of_part).min()))
        elif part.link == 0 and isinstance(part, Primitive):
            lowest.append(height - part.form.support(up_of_part))
    rises = float(chain.T_world_base[2, :3] @ up)
    if not lowest and rises > LEANS:
        lowest.append(float(-chain.T_world_base[2, 3] / rises))
    floor = min(lowest, default=0.0)
    if not level:
        return floor, None
    return beyond_arm(chain, limits), max(-floor, CELL.least) if floor <= 0 else None
