"""Body frames of a serial arm, rigid or elastically bent, and the axes of its bends."""

from typing import NamedTuple

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, grown_lengths, link_rotation_parts
from calib.geometry.frames import transform

X, Y, Z = range(3)
"""Index of each axis of a bend; z is the axis of the joint itself."""


class Bodies(NamedTuple):
    """Frames just after each joint, in the world; the last one is the flange."""

    rotation: Array
    """(m, n + 1, 3, 3) body axes as columns."""
    origin: Array
    """(m, n + 1, 3) a point on the joint axis, which a prismatic joint carries along [m]."""
    axes: Array
    """(m, n, 3, 3) unit axes x, y, z of the bends of each joint, one a row, in the world; each as
    the rotations before it have turned it."""


def bodies(
    chain: Chain, q: Array, bends: Array | None = None, growth: Array | None = None
) -> Bodies:
    """Body frames of a chain with elastically bent joints.

    Joint i turns by Rz(q + theta + b_z), its bearing bends by Rx(b_x) Ry(b_y), and the link
    follows: Tz(d) Tx(a) Rx(alpha) Ry(beta). A prismatic joint turns by theta and moves by q + b_z
    along z. Without bends the flange is that of `chain.forward` to the bit.

    Parameters
    ----------
    chain : Chain
        Geometry; the tool plays no part.
    q : (m, n) array
        Checked joint values [rad, m].
    bends : (m, n, 3) array, optional
        Bends b about x, y and z of every joint [rad]; along z of a prismatic one [m].
    growth : (m,) array, optional
        Relative thermal expansion of the link lengths at each pose.
    """
    m, n = q.shape
    bent = np.zeros((m, n, 3)) if bends is None else bends
    value = q + bent[:, :, Z]
    kind = np.result_type(value, chain.links)
    rotation, origin = np.empty((m, n + 1, 3, 3), kind), np.empty((m, n + 1, 3), kind)
    axes = np.empty((m, n, 3, 3), kind)
    x, y, z = (np.broadcast_to(chain.T_world_base[:3, k], (m, 3)) for k in range(3))
    p = np.broadcast_to(chain.T_world_base[:3, 3], (m, 3))
    slide = value * chain.prismatic
    d, _ = grown_lengths(chain, growth)
    cosine, sine = np.cos(bent[..., None]), np.sin(bent[..., None])
    for i, (*rows, ca, sa, cb, sb) in enumerate(link_rotation_parts(chain, value, growth)):
        c, s, shift, a = (row[..., None] for row in rows)
        axes[:, i, Z], before = z, z
        x, y = c * x + s * y, c * y - s * x
        origin[:, i] = p + slide[:, i, None] * z
        axes[:, i, X] = x
        if bends is None:
            axes[:, i, Y] = y
        else:
            (cx, cy), (sx, sy) = cosine[:, i, :Z].swapaxes(0, 1), sine[:, i, :Z].swapaxes(0, 1)
            y, z = cx * y + sx * z, cx * z - sx * y
            axes[:, i, Y] = y
            x, z = cy * x - sy * z, sy * x + cy * z
        rotation[:, i] = np.stack([x, y, z], -1)
        # slide and link together, as in `forward`; the link lies along the bent axis
        p = p + shift * before + d[..., i, None] * (z - before) + a * x
        y, z = ca * y + sa * z, ca * z - sa * y
        x, z = cb * x - sb * z, sb * x + cb * z
    rotation[:, n], origin[:, n] = np.stack([x, y, z], -1), p
    return Bodies(rotation, origin, axes)


def bent_forward(chain: Chain, q: Array, bends: Array, growth: Array | None = None) -> Array:
    """Tool poses T_world_tool (m, 4, 4) of an arm with bent joints; arguments as in `bodies`."""
    at = bodies(chain, q, bends, growth)
    return transform(at.rotation[:, -1], at.origin[:, -1]) @ chain.T_flange_tool
