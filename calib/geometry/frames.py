"""Rigid-body algebra on stacks: rotations, rotation vectors, transforms, in SI units.

`T_a_b` (..., 4, 4) maps b coordinates into a. A rotation vector is axis times angle [rad].
"""

import numpy as np

from calib.arrays import Array
from calib.errors import refuse

LEVEL = 1e-9
"""A base is level within this: what rounding leaves of its stated turn [rad]."""
STEEP = 0.5**0.5
"""Rise of an axis at 45 degrees."""
ROUNDED, EXACT = 5e-3, 1e-9
"""Largest entry of |R'R - I| that a rotation read from a file may have, and that float64 rounding
alone explains."""


def length(v: Array) -> Array:
    """Length (...,) of vectors v (..., 3), without the overhead of `numpy.linalg.norm` for few."""
    return np.asarray(np.sqrt(np.add.reduce(v * v, axis=-1)))


def skew(v: Array) -> Array:
    """Cross-product matrix [v]x (..., 3, 3) of v (..., 3): [v]x w = v x w."""
    out = np.zeros((*v.shape, 3), dtype=v.dtype)
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out


def exp_so3(w: Array) -> Array:
    """Rotation matrix (..., 3, 3) of a rotation vector (..., 3) [rad] (Rodrigues)."""
    angle = length(w)[..., None, None]
    K = skew(w)
    # sinc keeps both factors exact down to angle = 0
    return np.asarray(
        np.eye(3) + _sinc(angle / np.pi) * K + 0.5 * _sinc(angle / (2 * np.pi)) ** 2 * (K @ K),
        dtype=np.float64,
    )


def _sinc(x: Array) -> Array:
    """As `numpy.sinc`, without its overhead for few."""
    y = np.pi * x
    y = np.where(y, y, 1e-30)
    return np.asarray(np.sin(y) / y)


def turn_angle(R: Array) -> Array:
    """Angle (...,) in [0, pi] of a rotation matrix (..., 3, 3) [rad]: the length of its `log_so3`.

    It comes from atan2 of sine and cosine, exact near 0 and near pi.
    """
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    cosine = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2] - 1
    return np.asarray(np.arctan2(np.sqrt(x * x + y * y + z * z), cosine), dtype=np.float64)


def log_so3(R: Array) -> Array:
    """Rotation vector (..., 3) [rad] of a rotation matrix (..., 3, 3), angle in [0, pi].

    The angle comes from atan2 of sine and cosine, exact near 0 and near pi; near pi the axis comes
    from the symmetric part, whose largest column is far from zero there.
    """
    sine_axis = np.empty(R.shape[:-1])
    sine_axis[..., 0] = R[..., 2, 1] - R[..., 1, 2]
    sine_axis[..., 1] = R[..., 0, 2] - R[..., 2, 0]
    sine_axis[..., 2] = R[..., 1, 0] - R[..., 0, 1]
    sine_axis *= 0.5
    sine = length(sine_axis)
    cosine = (R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2] - 1) / 2
    angle = np.arctan2(sine, cosine)
    small = sine < 1e-7
    factor = np.where(small, 1.0, angle / np.where(small, 1.0, sine))
    w = factor[..., None] * sine_axis
    flip = small & (cosine < 0)
    near_pi = (cosine < 0) & (sine < 1e-3)
    if np.any(near_pi):
        S = 0.5 * (R + np.swapaxes(R, -1, -2)) - cosine[..., None, None] * np.eye(3)
        column = np.argmax(np.diagonal(S, axis1=-2, axis2=-1), axis=-1)
        axis = np.take_along_axis(S, column[..., None, None], axis=-1)[..., 0]
        axis = axis / np.maximum(np.linalg.norm(axis, axis=-1), 1e-300)[..., None]
        sign = np.where(np.sum(axis * sine_axis, axis=-1) < 0, -1.0, 1.0)
        exact = (sign * angle)[..., None] * axis
        w = np.where((near_pi | flip)[..., None], exact, w)
    return np.asarray(w, dtype=np.float64)


def right_jacobian_inverse(e: Array) -> Array:
    """Inverse right Jacobian Jr^-1 (..., 3, 3) of SO(3) at rotation vectors e (..., 3) [rad].

    It is defined by Log(Exp(e) Exp(w)) = e + Jr^-1(e) w + O(w^2).

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144).
    """
    t = length(e)[..., None, None]
    K = skew(e)
    small = t < 1e-3  # series: 1/12 + t^2/720 + t^4/30240
    safe = np.where(small, 1.0, t)
    factor = np.where(
        small, 1 / 12 + t**2 / 720, 1 / safe**2 - (1 + np.cos(safe)) / (2 * safe * np.sin(safe))
    )
    return np.asarray(np.eye(3) + 0.5 * K + factor * (K @ K), dtype=np.float64)


def transform(R: Array, p: Array) -> Array:
    """Homogeneous transforms (..., 4, 4) from rotations (..., 3, 3) and positions (..., 3)."""
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    T = np.zeros((*shape, 4, 4), dtype=np.result_type(R, p))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, p, 1
    return T


def inverse(T: Array) -> Array:
    """Inverse (..., 4, 4) of rigid transforms."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform(Rt, -(Rt @ T[..., :3, 3, None])[..., 0])


def step_transform(step: Array) -> Array:
    """[Exp(r), t; 0, 1] (..., 4, 4) of a frame step [t (m); r (rad)] (..., 6)."""
    return transform(exp_so3(step[..., 3:]), step[..., :3])


def transform_step(T: Array) -> Array:
    """Frame step [t (m); Log R (rad)] (6,) of a transform: the inverse of `step_transform`."""
    return np.concatenate([T[:3, 3], log_so3(T[:3, :3])])


def target_points(T: Array, target: Array) -> Array:
    """World positions (..., 3) of tool point `target` (3,) at tool poses T (..., 4, 4) [m]."""
    return np.asarray(T[..., :3, 3] + T[..., :3, :3] @ target)


def points_of_frames(T: Array, points: Array) -> Array:
    """World positions (m, 3) of points (m, 3), each in its own frame T (m, 4, 4) [m]."""
    return np.asarray(T[:, :3, 3] + (T[:, :3, :3] @ points[:, :, None])[:, :, 0])


def transform_points(T: Array, points: Array) -> Array:
    """World positions (..., 3) of points (..., 3) in one frame T (4, 4) [m]."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def rot_x(angle: float) -> Array:
    """Transform (4, 4) of a rotation about x by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]], dtype=np.float64)


def rot_y(angle: float) -> Array:
    """Transform (4, 4) of a rotation about y by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]], dtype=np.float64)


def rot_z(angle: float) -> Array:
    """Transform (4, 4) of a rotation about z by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)


def slide(x: float, y: float, z: float) -> Array:
    """Transform (4, 4) of a translation by x, y, z [m]."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def leveled(T_world_base: Array) -> Array:
    """Axes (3, 3) in the world of an instrument that was leveled beside a base (4, 4).

    z is up; x goes where the base's x goes as seen from above or, where that is steep as on a wall,
    where the base's z goes. They are the base's own axes if it stands level.
    """
    R, up = T_world_base[:3, :3], np.array([0.0, 0.0, 1.0])
    if np.abs(R[:, 2] - up).max() < LEVEL:
        return R
    ahead = R[:, 0] if abs(R[2, 0]) < STEEP else R[:, 2]
    x = ahead - ahead[2] * up
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up], axis=1)


def nearest_rigid(T: Array) -> Array:
    """Rigid transforms (..., 4, 4) nearest to almost rigid ones, so that rounding never piles up.

    The rotation is U V' of the singular value decomposition U S V'.
    """
    U, _, Vt = np.linalg.svd(T[..., :3, :3])
    return transform(U @ Vt, T[..., :3, 3])


def is_rigid(T: Array) -> bool:
    """Whether T (4, 4) is a rigid transform: R'R = I within 1e-9, det R > 0, last row."""
    R = T[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond sense are no rotation
        off = float(np.abs(R.T @ R - np.eye(3)).max())
    return off <= 1e-9 and float(np.linalg.det(R)) > 0 and bool((T[3] == [0, 0, 0, 1]).all())


def require_rigid(T: Array, field: str, name: str = "", value: object = None) -> None:
    """Raise an `InputError` (A3) if T (4, 4) is not rigid; the message calls it `name`."""
    if not is_rigid(T):
        raise refuse(
            field,
            value,
            "an orthonormal right-handed rotation, last row 0 0 0 1",
            code="A3",
            message=f"{name or field} is not a rigid transform",
        )


def rigid(T: Array) -> Array:
    """Transforms T (m, 4, 4) with the rounding of a file's decimals removed.

    Raises
    ------
    InputError
        A3: a matrix is no rigid transform within `ROUNDED`; the first such row is named.
    """
    R = T[:, :3, :3]
    skewed = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    for wrong, why in (
        (
            np.abs(T[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) > ROUNDED,
            "does not end in 0, 0, 0, 1",
        ),
        (
            skewed > ROUNDED,
            "has no rotation in it: its axes are not at right angles and of length 1",
        ),
        (np.linalg.det(R) < 0, "is left-handed"),
    ):
        if wrong.any():
            row = int(np.argmax(wrong))
            allowed = "rigid transforms; transposed or scaled ones are none"
            raise refuse("T", row, allowed, code="A3", message=f"T[{row}] {why}")
    return nearest_rigid(T) if len(T) and skewed.max() > EXACT else T
