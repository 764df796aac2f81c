"""Poses and the whole identification Jacobian in one batched pass along the chain.

Every geometric number is a unit screw: a slide along an axis, or a turn about an axis through a
point. The pass visits all axes in turn; a turn moves the tool origin by axis x (p_tool - point).
"""

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.bodies import X, Y, Z, bodies
from calib.geometry.chain import BATCH, Chain, grown_lengths, link_rotation_parts
from calib.geometry.frames import transform


def pose_and_jacobian(chain: Chain, q: Array, growth: Array | None = None) -> tuple[Array, Array]:
    """Tool poses (m, 4, 4) and identification Jacobian (m, 6, 12 + 5 n) at checked joints (m, n).

    Rows are [dp (m); dr (rad)]: displacement of the tool origin and rotation vector, both in world
    axes. Columns follow `chain_names`; base and tool columns are steps in their own axes. Where
    lengths have grown by parts (m,), those of d and a are along the axes of the links as they are.

    References
    ----------
    Wen et al. 2022, eqs. (2)-(4), in six rows instead of twelve.
    """
    T = np.zeros((len(q), 4, 4))
    J = np.zeros((len(q), 6, chain.n_numbers))
    for start in range(0, len(q), BATCH):
        part = slice(start, start + BATCH)
        _fill_batch(chain, q[part], _part(growth, part), T[part], J[part])
    return T, J


def _part(growth: Array | None, part: slice) -> Array | None:
    return None if growth is None else growth[part]


def bent_pose_and_jacobian(
    chain: Chain, q: Array, bends: Array, growth: Array | None = None
) -> tuple[Array, Array]:
    """Tool poses (m, 4, 4) and Jacobian (m, 6, 12 + 8 n) of an arm whose joints give way.

    The numbers of the chain come first, as in `pose_and_jacobian`, then the bends joint by joint
    about x, y and z; a bend turns about its axis as the turns before it have left it.

    Parameters
    ----------
    chain : Chain
        Geometry.
    q : (m, n) array
        Checked joint values [rad, m].
    bends : (m, n, 3) array
        As in `bodies` [rad, m].
    growth : (m,) array, optional
        As in `bodies`.
    """
    T = np.zeros((len(q), 4, 4))
    J = np.zeros((len(q), 6, chain.n_numbers + 3 * chain.n_joints))
    for start in range(0, len(q), BATCH):
        part = slice(start, start + BATCH)
        _fill_bent_batch(chain, q[part], bends[part], _part(growth, part), T[part], J[part])
    return T, J


def _fill_bent_batch(
    chain: Chain, q: Array, bends: Array, growth: Array | None, T_out: Array, J_out: Array
) -> None:
    """Fill poses and Jacobian of one batch of a bent arm: all screws stand in its body frames."""
    m, n = q.shape
    at = bodies(chain, q, bends, growth)
    turned, start = at.rotation[:, :n], at.origin[:, :n]
    x, y, z = turned[..., X], turned[..., Y], turned[..., Z]
    alpha = chain.links[:, 3, None]
    d, a = grown_lengths(chain, growth)
    end = start + d[..., None] * z + a[..., None] * x
    beta = np.cos(alpha) * y + np.sin(alpha) * z
    axes, points = np.zeros((12 + 8 * n, m, 3)), np.zeros((12 + 8 * n, m, 3))
    slides = np.zeros(12 + 8 * n, dtype=bool)
    base = chain.T_world_base
    axes[0:3] = axes[3:6] = base[:3, :3].T[:, None, :]
    points[3:6], slides[:3] = base[:3, 3], True
    links, bent = slice(6, 6 + 5 * n), slice(12 + 5 * n, None)
    axes[links] = _in_rows(np.stack([at.axes[:, :, Z], z, x, x, beta], 2))
    points[links] = _in_rows(np.stack([start, start, end, end, end], 2))
    slides[links] = [False, True, True, False, False] * n
    axes[bent] = _in_rows(at.axes)
    points[bent] = _in_rows(np.stack([start] * 3, 2))
    slides[bent] = np.outer(chain.prismatic, [False, False, True]).ravel()
    T_out[:] = transform(at.rotation[:, n], at.origin[:, n]) @ chain.T_flange_tool
    _fill_columns(axes, points, slides, n, T_out, J_out)


def _in_rows(vectors: Array) -> Array:
    """Vectors (m, n, k, 3) of joints as rows (n k, m, 3)."""
    return np.moveaxis(vectors.reshape(len(vectors), -1, 3), 1, 0)


def _fill_batch(chain: Chain, q: Array, growth: Array | None, T_out: Array, J_out: Array) -> None:
    """Fill poses and Jacobian of one batch."""
    base, tool = chain.T_world_base, chain.T_flange_tool
    m, n = q.shape
    # all screws, from base to tool
    axes = np.zeros((chain.n_numbers, m, 3))  # one axis per number
    points = np.zeros((chain.n_numbers, m, 3))  # a point on it, for turns
    slides = np.zeros(chain.n_numbers, dtype=bool)
    axes[0:3] = axes[3:6] = base[:3, :3].T[:, None, :]
    points[3:6] = base[:3, 3]
    slides[0:3] = True
    x, y, z = (np.broadcast_to(base[:3, k], (m, 3)) for k in range(3))
    p = np.broadcast_to(base[:3, 3], (m, 3))
    for i, (c, s, d, a, ca, sa, cb, sb) in enumerate(link_rotation_parts(chain, q, growth)):
        k = 6 + 5 * i
        axes[k], points[k] = z, p  # theta
        axes[k + 1] = z  # d
        x, y = c * x + s * y, c * y - s * x
        p = p + d * z + a * x
        axes[k + 2] = x  # a
        axes[k + 3], points[k + 3] = x, p  # alpha
        y, z = ca * y + sa * z, ca * z - sa * y
        axes[k + 4], points[k + 4] = y, p  # beta
        x, z = cb * x - sb * z, sb * x + cb * z
        slides[k + 1] = slides[k + 2] = True
    T_out[:] = transform(np.stack([x, y, z], -1), p) @ tool
    _fill_columns(axes, points, slides, n, T_out, J_out)


def _fill_columns(
    axes: Array, points: Array, slides: Bool, n: int, T_out: Array, J_out: Array
) -> None:
    """Put the screws of the tool after those of n links, and turn all screws into columns."""
    k = 6 + 5 * n
    axes[k : k + 3] = axes[k + 3 : k + 6] = np.moveaxis(T_out[:, :3, :3], -1, 0)
    slides[k : k + 3] = True
    origin = T_out[:, :3, 3]
    points[k + 3 : k + 6] = origin
    # columns: slides move along their axis, turns move by axis x arm
    turns = ~slides
    J_out[:, :3, slides] = np.moveaxis(axes[slides], 0, -1)
    J_out[:, 3:, turns] = np.moveaxis(axes[turns], 0, -1)
    arm, axis = origin - points[turns], axes[turns]
    J_out[:, 0, turns] = (axis[..., 1] * arm[..., 2] - axis[..., 2] * arm[..., 1]).T
    J_out[:, 1, turns] = (axis[..., 2] * arm[..., 0] - axis[..., 0] * arm[..., 2]).T
    J_out[:, 2, turns] = (axis[..., 0] * arm[..., 1] - axis[..., 1] * arm[..., 0]).T


def joint_columns(chain: Chain) -> list[int]:
    """Index (n,) of each joint's own column: theta for revolute, d for prismatic joints."""
    return [6 + 5 * i + (kind == "prismatic") for i, kind in enumerate(chain.kinds)]


def matrix_rows(T: Array, J: Array) -> Array:
    """The paper's twelve rows (m, 12, P): dn, do, da (1) and dp (m), from six-row `J` (m, 6, P).

    Exact identity: H'H = 2 Jw'Jw + Jp'Jp, so twelve rows hold six freedoms.

    References
    ----------
    Wen et al. 2022, eq. (4).
    """
    Jw = J[:, 3:]
    blocks = []
    for k in range(3):
        column = T[:, :3, k]
        # d(column) = dr x column
        blocks.append(np.cross(Jw, column[:, :, None], axisa=1, axisb=1, axisc=1))
    return np.concatenate([*blocks, J[:, :3]], axis=1)


def reflector_rows(T: Array, J: Array, offset: Array) -> tuple[Array, Array]:
    """Positions (m, 3) and rows (m, 3, P) of reflectors at tool coordinates `offset` (m, 3) [m]."""
    arm = (T[:, :3, :3] @ offset[:, :, None])[..., 0]
    rows = J[:, :3] + np.cross(J[:, 3:], arm[:, :, None], axisa=1, axisb=1, axisc=1)
    return T[:, :3, 3] + arm, rows
