"""Any sequence of joint axes as a chain: MDH numbers, with Hayati's where axes are parallel.

No length of such a chain is larger than the path from joint to joint to the tip. The common normal
of nearly parallel axes may be kilometers away. If it is too far, beta is used instead, and as a
last resort the frame of the link is on the next joint itself.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, JointKind, forward
from calib.geometry.frames import inverse, nearest_rigid, rot_x, rot_y, rot_z, slide, transform
from testbed.robots.placements import link_poses

ROUNDING = 1e-15
"""Rounding error of a zero after a few products of rotations [rad or m]."""
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
        the world's z axis. No |d| or |a| exceeds the way through base, points and tip.

    References
    ----------
    Hayati 1983 for neighbors within 1 degree of parallel, and where a common normal lies too far.
    """
    frame = base_frame(points[0], axes[0])
    base, links = frame, []
    ends = np.vstack([points[1:], T_world_tip[:3, 3]])
    directions = np.vstack([axes[1:], T_world_tip[:3, 2]])
    steps = np.linalg.norm(np.diff(np.vstack([frame[:3, 3], points, ends[-1]]), axis=0), axis=1)
    longest = float(steps.sum())
    for i, (point, axis) in enumerate(zip(ends, directions, strict=True)):
        last = i == len(ends) - 1
        R = frame[:3, :3]
        # how far the new origin may lie from the joint it belongs to, so that the next link fits
        room = longest if last else longest - float(steps[i + 2])
        link = link_to_axis(
            R.T @ (point - frame[:3, 3]), R.T @ axis, keep_height=last, longest=longest, room=room
        )
        link = _without_rounding(link)
        links.append(link)
        frame = frame @ link_transform(link)
    return Chain(np.array(links), tuple(kinds), base, nearest_rigid(inverse(frame) @ T_world_tip))


def reach(chain: Chain) -> float:
    """Way [m] from the base over the joint axes to the tool at joint zero, each time the shortest.

    A longer length is a property of the gauge, not of the robot.
    """
    points = _nearest_points(chain)
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def regauged(chain: Chain) -> Chain:
    """The same robot in human-sized numbers: same poses at every q, no link longer than `reach`.

    Base and tool keep what the links cannot express.
    """
    local = replace(chain, T_world_base=np.eye(4), T_flange_tool=np.eye(4))
    points = _nearest_points(local)
    bodies = link_poses(local, np.zeros((1, chain.n_joints)))[0, 1:]
    flange = forward(local, np.zeros((1, chain.n_joints)))[0]
    again = chain_from_axes(points[1:-1], bodies[:, :3, 2], chain.kinds, flange)
    return replace(
        again,
        T_world_base=chain.T_world_base @ again.T_world_base,
        T_flange_tool=again.T_flange_tool @ chain.T_flange_tool,
    )


def _nearest_points(chain: Chain) -> Array:
    """The base, on each axis (n of them) the point nearest to the one before, the tool (n + 2, 3).

    At joint zero, in the world [m].
    """
    zero = np.zeros((1, chain.n_joints))
    points = [chain.T_world_base[:3, 3]]
    for body in link_poses(chain, zero)[0, 1:]:
        origin, axis = body[:3, 3], body[:3, 2]
        points.append(origin + axis * (axis @ (points[-1] - origin)))
    return np.array([*points, forward(chain, zero)[0, :3, 3]])


def base_frame(point: Array, axis: Array) -> Array:
    """Frame (4, 4) with z along the first axis; the world itself where that is possible."""
    if np.hypot(axis[0], axis[1]) < 1e-12 and axis[2] > 0 and np.hypot(*point[:2]) < 1e-12:
        return np.eye(4)
    side = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, side)
    x /= np.linalg.norm(x)
    return transform(np.stack([x, np.cross(axis, x), axis], -1), point)


def link_to_axis(
    point: Array,
    axis: Array,
    *,
    keep_height: bool = False,
    longest: float = np.inf,
    room: float = np.inf,
) -> Array:
    """Link numbers (5,) from a z axis to the axis through `point` (3,) along `axis` (3,).

    Among parallel axes d is free: zero, or with `keep_height` the height of the point. Lengths
    above `longest`, or an end further than `room` from the point, are avoided [m].
    """
    parallel = np.hypot(axis[0], axis[1]) < np.sin(PARALLEL)
    choices = []
    if not parallel:
        choices.append(_common_normal(point, axis))
    if abs(axis[2]) > 0.5 and not (parallel and keep_height):
        foot = point - axis * (point[2] / axis[2])
        choices.append(_through(np.array([foot[0], foot[1], 0.0]), axis))
    for link in choices:
        away = float(np.linalg.norm(link_transform(link)[:3, 3] - point))
        if max(abs(link[1]), abs(link[2])) <= longest and away <= room:
            return link
    return _through(point, axis)


def _without_rounding(link: Array) -> Array:
    """The link with rounding taken off angles that are multiples of 90 degrees and zero lengths."""
    angle = np.array([True, False, False, True, True])
    whole = np.where(angle, np.round(link / (np.pi / 2)) * (np.pi / 2), 0.0)
    return np.where(np.abs(link - whole) < ROUNDING, whole, link) + 0.0


def _common_normal(point: Array, axis: Array) -> Array:
    """Link numbers (5,) along the common normal of z and the axis, beta zero."""
    across = float(np.hypot(axis[0], axis[1]))
    theta = float(np.arctan2(axis[0], -axis[1]))  # along z cross axis
    alpha = float(np.arctan2(across, axis[2]))
    if not -np.pi / 2 < theta <= np.pi / 2:
        theta, alpha = theta - np.copysign(np.pi, theta), -alpha
    local = rot_z(-theta)[:3, :3] @ point
    along = local[1] / np.sin(alpha)
    return np.array([theta, local[2] + along * np.cos(alpha), local[0], alpha, 0.0])


def _through(foot: Array, axis: Array) -> Array:
    """Link numbers (5,) of Hayati to the point `foot` (3,) of an axis, with any beta."""
    a = float(np.hypot(foot[0], foot[1]))
    theta = float(np.arctan2(foot[1], foot[0])) if a > 1e-12 else 0.0
    turned = rot_z(-theta)[:3, :3] @ axis
    alpha = float(np.arctan2(-turned[1], turned[2]))
    beta = float(np.arctan2(turned[0], np.hypot(turned[1], turned[2])))
    return np.array([theta, foot[2], (rot_z(-theta)[:3, :3] @ foot)[0], alpha, beta])


def link_transform(link: Array) -> Array:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), (4, 4)."""
    theta, d, a, alpha, beta = link
    return rot_z(theta) @ slide(a, 0.0, d) @ rot_x(alpha) @ rot_y(beta)
