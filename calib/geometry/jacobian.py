"""Poses and the whole identification Jacobian in one batched pass along the chain.

Every geometric number is a unit screw: a translation along an axis, or a rotation about an axis
through a point, which moves the tool origin by axis x (p_tool - point).
"""

from functools import cache

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.bodies import X, Y, Z, bodies
from calib.geometry.chain import (
    BATCH,
    Chain,
    JointKind,
    grown_lengths,
    held,
    link_rotation_parts,
    on_base,
)
from calib.geometry.frames import transform

SWEPT = 400
"""Poses per pass of the Jacobian: all its screws stay in the cache."""


def pose_and_jacobian(chain: Chain, q: Array, growth: Array | None = None) -> tuple[Array, Array]:
    """Tool poses (m, 4, 4) and identification Jacobian (m, 6, 12 + 5 n) at joint values q (m, n).

    Rows are [dp (m); dr (rad)]: displacement of the tool origin and rotation vector, both in world
    axes. Columns follow `chain_names`; base and tool columns are steps in their own axes. Under
    thermal `growth` (m,) the columns of d and a are per meter of the grown lengths.

    References
    ----------
    Wen et al. 2022, eqs. (2)-(4), in six rows instead of twelve.
    """
    T = np.empty((len(q), 4, 4))
    J = np.empty((len(q), 6, chain.n_numbers))
    # one place for the screws of all batches: fresh memory costs more than the arithmetic
    screws = np.zeros((6, chain.n_numbers, min(len(q), SWEPT)))
    for start in range(0, len(q), SWEPT):
        part = slice(start, start + SWEPT)
        _fill_batch(chain, q[part], _part(growth, part), screws, T[part], J[part])
    return T, J


def _part(growth: Array | None, part: slice) -> Array | None:
    return None if growth is None else growth[part]


def bent_pose_and_jacobian(
    chain: Chain, q: Array, bends: Array, growth: Array | None = None
) -> tuple[Array, Array]:
    """Tool poses (m, 4, 4) and Jacobian (m, 6, 12 + 8 n) of an arm whose joints are deflected.

    Columns: the numbers of the chain as in `pose_and_jacobian`, then the bends of each joint about
    x, y and z, each about its axis as the rotations before it have turned it.

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
    T = np.empty((len(q), 4, 4))
    J = np.empty((len(q), 6, chain.n_numbers + 3 * chain.n_joints))
    for start in range(0, len(q), BATCH):
        part = slice(start, start + BATCH)
        _fill_bent_batch(chain, q[part], bends[part], _part(growth, part), T[part], J[part])
    return T, J


def _fill_bent_batch(
    chain: Chain, q: Array, bends: Array, growth: Array | None, T_out: Array, J_out: Array
) -> None:
    """Fill poses and Jacobian of one batch of a bent arm, from the screws in its body frames."""
    m, n = q.shape
    at = bodies(chain, q, bends, growth)
    turned, start = at.rotation[:, :n], at.origin[:, :n]
    x, y, z = turned[..., X], turned[..., Y], turned[..., Z]
    alpha = chain.links[:, 3, None]
    d, a = grown_lengths(chain, growth)
    end = start + d[..., None] * z + a[..., None] * x
    beta = np.cos(alpha) * y + np.sin(alpha) * z
    screws = np.zeros((6, 12 + 8 * n, m))
    links, bent = slice(6, 6 + 5 * n), slice(12 + 5 * n, None)
    screws[3:, links] = _in_rows(np.stack([at.axes[:, :, Z], z, x, x, beta], 2))
    screws[:3, links] = _in_rows(np.stack([start, start, end, end, end], 2))
    screws[3:, bent] = _in_rows(at.axes)
    screws[:3, bent] = _in_rows(np.stack([start] * 3, 2))
    np.matmul(transform(at.rotation[:, n], at.origin[:, n]), chain.T_flange_tool, out=T_out)
    _fill_columns(chain, screws, T_out, J_out)


def _in_rows(vectors: Array) -> Array:
    """Vectors (m, n, k, 3) of joints as rows (3, n k, m)."""
    return vectors.reshape(len(vectors), -1, 3).T


def _fill_batch(
    chain: Chain, q: Array, growth: Array | None, screws: Array, T_out: Array, J_out: Array
) -> None:
    """Fill poses and Jacobian of one batch; `screws` (6, 12 + 5 n, m or more) are overwritten."""
    screws = screws[:, :, : len(q)]
    axes, points = screws[3:], screws[:3]
    parts = link_rotation_parts(chain, q, growth)
    x, y, z, p = on_base(chain, len(q))
    for k, (c, s, d, a, ca, sa, cb, sb) in zip(range(6, chain.n_numbers, 5), parts, strict=False):
        axes[:, k : k + 2] = z[:, None]  # theta, d
        points[:, k] = p
        x, y = c * x + s * y, c * y - s * x
        p = p + d * z + a * x
        axes[:, k + 2 : k + 4] = x[:, None]  # a, alpha
        points[:, k + 3 : k + 5] = p[:, None]
        y, z = ca * y + sa * z, ca * z - sa * y
        axes[:, k + 4] = y  # beta
        x, z = cb * x - sb * z, sb * x + cb * z
    held(x, y, z, p, chain.T_flange_tool, T_out)
    _fill_columns(chain, screws, T_out, J_out)


def _fill_columns(chain: Chain, screws: Array, T_out: Array, J_out: Array) -> None:
    """Add the screws of base and tool to those of links and bends, and fill in the Jacobian.

    Parameters
    ----------
    chain : Chain
        Geometry.
    screws : (6, P, m) array
        Point on each axis [m] (any point for a translation), then its unit direction, in the world;
        overwritten.
    T_out, J_out : (m, 4, 4) and (m, 6, P) array
        Tool poses, and the Jacobian that is filled in.
    """
    axes, points = screws[3:], screws[:3]
    k, base = 6 + 5 * chain.n_joints, chain.T_world_base[:3, :, None]
    axes[:, 0:3] = axes[:, 3:6] = base[:, :3]
    axes[:, k : k + 3] = axes[:, k + 3 : k + 6] = T_out[:, :3, :3].transpose(1, 2, 0)
    origin = T_out[:, :3, None, 3].swapaxes(0, 1).swapaxes(1, 2)
    points[:, 3:6], points[:, k + 3 : k + 6] = base[:, 3:], origin
    # slides move along their axis, turns move by axis x arm
    slides, turns = _slides_and_turns(chain.kinds, screws.shape[1])
    axis, arm = axes[:, turns], origin - points[:, turns]
    points[0, turns] = axis[1] * arm[2] - axis[2] * arm[1]
    points[1, turns] = axis[2] * arm[0] - axis[0] * arm[2]
    points[2, turns] = axis[0] * arm[1] - axis[1] * arm[0]
    points[:, slides], axes[:, slides] = axes[:, slides], 0.0
    J_out[:] = screws.transpose(2, 0, 1)


@cache
def _slides_and_turns(kinds: tuple[JointKind, ...], numbers: int) -> tuple[Index, Index]:
    """Indices of translations and of rotations among the numbers of a chain (and its bends)."""
    k = 6 + 5 * len(kinds)
    slide = np.zeros(numbers, dtype=bool)
    slide[0:3] = slide[7:k:5] = slide[8:k:5] = slide[k : k + 3] = True
    if numbers > k + 6:
        slide[k + 8 :: 3] = [kind == "prismatic" for kind in kinds]
    return frozen(np.flatnonzero(slide), np.int64), frozen(np.flatnonzero(~slide), np.int64)


def joint_columns(chain: Chain) -> list[int]:
    """Index (n,) of each joint's own column: theta for revolute, d for prismatic joints."""
    return [6 + 5 * i + (kind == "prismatic") for i, kind in enumerate(chain.kinds)]


def matrix_rows(T: Array, J: Array) -> Array:
    """Twelve-row Jacobian H (m, 12, P) of Wen et al.: dn, do, da (1) and dp (m), from J (m, 6, P).

    Exactly H'H = 2 Jw'Jw + Jp'Jp: the twelve rows carry the information of six.

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
    """World positions (m, 3) [m] and Jacobian (m, 3, P) of tool points `offset` (m, 3) [m].

    `T` (m, 4, 4) and `J` (m, 6, P) are the poses and the Jacobian of the tool.
    """
    arm = (T[:, :3, :3] @ offset[:, :, None])[..., 0]
    rows = J[:, :3] + np.cross(J[:, 3:], arm[:, :, None], axisa=1, axisb=1, axisc=1)
    return T[:, :3, 3] + arm, rows
