"""Any sequence of joint axes as a chain: MDH numbers, with Hayati's where axes are parallel."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, JointKind, reorthonormalized
from calib.geometry.frames import inverse, rot_x, rot_y, rot_z, slide, transform

PARALLEL = np.radians(1.0)
"""Axes closer than this get Hayati's beta instead of d: their common normal is ill-defined."""


def chain_from_axes(
    points: Array, axes: Array, kinds: Sequence[JointKind], T_world_tip: Array
) -> Chain:
    """Chain through given joint axes: at joint zero the axes and the tip are where they were.

    Parameters
    ----------
    points : (n, 3) array
        A point on each axis at joint zero, in the world [m].
    axes : (n, 3) array
        Unit direction of each axis, in the world.
    kinds : sequence of n str
        revolute or prismatic.
    T_world_tip : (4, 4) array
        Tip at joint zero [m].

    Returns
    -------
    Chain
        With T_world_tool = T_world_tip at joint zero; the base frame is the world when axis 1 is
        the world's z axis.

    References
    ----------
    Hayati 1983 for neighbors within 1 degree of parallel.
    """
    frame = base_frame(points[0], axes[0])
    base, links = frame, []
    for i in range(len(points)):
        last = i == len(points) - 1
        point = T_world_tip[:3, 3] if last else points[i + 1]
        axis = T_world_tip[:3, 2] if last else axes[i + 1]
        R = frame[:3, :3]
        link = link_to_axis(R.T @ (point - frame[:3, 3]), R.T @ axis, keep_height=last)
        links.append(link)
        frame = frame @ link_transform(link)
    return Chain(
        np.array(links), tuple(kinds), base, reorthonormalized(inverse(frame) @ T_world_tip)
    )


def base_frame(point: Array, axis: Array) -> Array:
    """Frame (4, 4) with z along the first axis; the world itself where that is possible."""
    if np.hypot(axis[0], axis[1]) < 1e-12 and axis[2] > 0 and np.hypot(*point[:2]) < 1e-12:
        return np.eye(4)
    side = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, side)
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(axis, x), axis], -1), point)


def link_to_axis(point: Array, axis: Array, *, keep_height: bool = False) -> Array:
    """Link numbers (5,) from a z axis to the axis through `point` (3,) along `axis` (3,).

    Among parallel axes d is free: zero, or with `keep_height` the height of the point.
    """
    across = float(np.hypot(axis[0], axis[1]))
    if across < np.sin(PARALLEL):
        d = float(point[2]) if keep_height else 0.0
        foot = point - axis * ((point[2] - d) / axis[2])
        a = float(np.hypot(foot[0], foot[1]))
        theta = float(np.arctan2(foot[1], foot[0])) if a > 1e-12 else 0.0
        a = float((rot_z(-theta)[:3, :3] @ foot)[0])
        turned = rot_z(-theta)[:3, :3] @ axis
        alpha = float(np.arctan2(-turned[1], turned[2]))
        beta = float(np.arctan2(turned[0], np.hypot(turned[1], turned[2])))
        return np.array([theta, d, a, alpha, beta])
    theta = float(np.arctan2(axis[0], -axis[1]))  # along z cross axis
    alpha = float(np.arctan2(across, axis[2]))
    if not -np.pi / 2 < theta <= np.pi / 2:
        theta, alpha = theta - np.copysign(np.pi, theta), -alpha
    local = rot_z(-theta)[:3, :3] @ point
    along = local[1] / np.sin(alpha)
    return np.array([theta, local[2] + along * np.cos(alpha), local[0], alpha, 0.0])


def link_transform(link: Array) -> Array:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), (4, 4)."""
    theta, d, a, alpha, beta = link
    return rot_z(theta) @ slide(a, 0.0, d) @ rot_x(alpha) @ rot_y(beta)
