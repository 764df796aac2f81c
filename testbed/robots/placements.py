"""Where the bodies of a chain sit: chain numbers to body frames, flange and tool, and their poses.

The link product is split after the joint: body i+1 is placed in body i at L_i Rz(theta_(i+1)) with
L_i = Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i), so a joint value is always the commanded q.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.frames import rot_x, rot_y, rot_z, slide, step_transform
from calib.geometry.inverse import spread

ROUNDING = 1e-12
"""Differences of poses below which only this bound is stated [m, rad]."""
UPRIGHT = 1e-14
"""Cosine of a pitch below which it is a quarter turn, to rounding [1]."""
LIMIT = 1e-9
"""Largest difference between a file and the robot it stands for [m or rad]."""


class Placements(NamedTuple):
    """Fixed frames of a chain's bodies."""

    frames: Array
    """(n, 4, 4) joint frame i+1 in body i, joint value zero; the first one in the world [m]."""
    flange: Array
    """(4, 4) flange in the last body [m]."""
    tool: Array
    """(4, 4) tool in the last body [m]."""


def placements(chain: Chain) -> Placements:
    """Frames of the n joint bodies in their parents, then flange and tool in the last body.

    A revolute body turns about its z, a prismatic one slides along its z; theta lives in the frame.

    References
    ----------
    Wen et al. 2022, eq. (1), regrouped.

    Examples
    --------
    >>> placements(Chain([[0, 0.3, 0.1, 0, 0]])).flange[:3, 3]
    array([0.1, 0. , 0.3])
    """
    frames, carry = [], chain.T_world_base
    for theta, d, a, alpha, beta in chain.links:
        frames.append(tidy(carry @ rot_z(theta)))
        carry = slide(a, 0.0, d) @ rot_x(alpha) @ rot_y(beta)
    return Placements(frozen(frames), tidy(carry), tidy(carry @ chain.T_flange_tool))


def tidy(T: Array) -> Array:
    """Copy with rotation entries within 1e-15 of 0, 1, -1 replaced by these.

    cos(90 deg) is 6e-17, and its last bits depend on the processor, but files must not.
    """
    R = T[:3, :3]
    near = np.round(R)
    out = T.copy()
    out[:3, :3] = np.where(np.abs(R - near) < 1e-15, near, R)
    return frozen(out + 0.0)  # + 0.0 turns -0.0 into 0.0


def link_poses(chain: Chain, q: ArrayLike) -> Array:
    """World poses (m, n + 1, 4, 4) of the base and of every link body at q (m, n) [rad, m].

    These are the frames the drawings of a robot live in; the flange is not among them.
    """
    q = joint_vectors(chain, q)
    out = np.empty((len(q), chain.n_joints + 1, 4, 4))
    out[:, 0] = chain.T_world_base
    parent: Array = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for i, frame in enumerate(placements(chain).frames):
        parent = parent @ frame @ joint_motion(chain, i, q[:, i])
        out[:, i + 1] = parent
    return out


def joint_motion(chain: Chain, joint: int, value: Array) -> Array:
    """Transforms (m, 4, 4) of one joint: a turn about z by [rad], or a slide along z by [m]."""
    T = np.zeros((len(value), 4, 4))
    T[:, range(4), range(4)] = 1.0
    if chain.kinds[joint] == "prismatic":
        T[:, 2, 3] = value
    else:
        T[:, 0, 0] = T[:, 1, 1] = np.cos(value)
        T[:, 1, 0] = np.sin(value)
        T[:, 0, 1] = -T[:, 1, 0]
    return T


def quaternion_wxyz(R: Array) -> Array:
    """Unit quaternions (..., 4), scalar first and not negative, of rotations (..., 3, 3).

    The largest of the four squared components is the pivot, so nothing small is divided by.

    References
    ----------
    Shepperd, J. Guidance and Control 1(3), 1978, 223-224.
    """
    R = np.asarray(R, dtype=np.float64)
    trace = np.trace(R, axis1=-2, axis2=-1)
    sizes = np.concatenate([trace[..., None], np.diagonal(R, axis1=-2, axis2=-1)], -1)
    # four times the outer product of the quaternion with itself
    outer = np.empty((*R.shape[:-2], 4, 4))
    for k in range(4):
        outer[..., k, k] = 1 - trace + 2 * sizes[..., k]
    outer[..., 0, 0] = 1 + trace
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0)), start=1):
        outer[..., 0, k] = outer[..., k, 0] = R[..., i, j] - R[..., j, i]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        outer[..., i + 1, j + 1] = outer[..., j + 1, i + 1] = R[..., i, j] + R[..., j, i]
    pivot = np.argmax(sizes, axis=-1)[..., None, None]
    quaternion = np.take_along_axis(outer, pivot, axis=-2)[..., 0, :]
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion *= np.where(quaternion[..., :1] < 0, -1.0, 1.0)
    return np.asarray(quaternion + 0.0, dtype=np.float64)


def rpy(T: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll), |pitch| at most a quarter turn [rad].

    At a pitch of a quarter turn rounding determines roll; yaw is the exact rest of R.
    """
    R = T[:3, :3]
    level = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], level))
    roll = float(np.arctan2(R[2, 1], R[2, 2])) if level > UPRIGHT else 0.0
    side = np.cos(roll) * R[:, 1] - np.sin(roll) * R[:, 2]  # y of Rz(yaw) Ry(pitch)
    yaw = float(np.arctan2(-side[0], side[1]))
    return roll + 0.0, pitch + 0.0, yaw + 0.0  # + 0.0 turns -0.0 into 0.0


def frame_of(position_mm: Sequence[float], rotation_vector_deg: Sequence[float]) -> Array:
    """A frame (4, 4) by its place and its rotation vector in a file [m]."""
    place, turn = np.array(position_mm) / 1e3, np.radians(rotation_vector_deg)
    return step_transform(np.concatenate([place, turn]))


def difference(T: Array, other: Array) -> tuple[float, float]:
    """Largest distance [m] and largest angle [rad] between poses (m, 4, 4)."""
    position = np.linalg.norm(T[:, :3, 3] - other[:, :3, 3], axis=1)
    # |R - S| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm: exact for small angles too
    apart = np.linalg.norm(T[:, :3, :3] - other[:, :3, :3], axis=(1, 2)) / np.sqrt(8)
    return float(position.max()), float(2 * np.arcsin(np.clip(apart, 0, 1)).max())


def require_agreement(name: str, position: float, rotation: float) -> None:
    """Raise a RuntimeError if a file that we wrote has other poses [m, rad]."""
    if not max(position, rotation) <= LIMIT:
        raise RuntimeError(
            f"{name} differs from the robot by {position:.3g} m and {rotation:.3g} rad"
        )


def proof_joints(limits: Array, count: int) -> Array:
    """Joint values (count, n) at which files are compared: zero, and spread over the limits."""
    return np.vstack([np.zeros(len(limits)), spread(limits, count)[1:]])


def agreement(name: str, position: float, rotation: float) -> str:
    """Sentence that a file has the robot's poses, with the largest differences [m, rad].

    Examples
    --------
    >>> agreement("robot.toml", 2e-16, 3e-10)
    "robot.toml has the robot's poses to < 1e-12 m and 3e-10 rad"
    """
    m, rad = (f"{x:.1g}" if x > ROUNDING else f"< {ROUNDING:g}" for x in (position, rotation))
    return f"{name} has the robot's poses to {m} m and {rad} rad"
