"""Places of one fixed point as an instrument on the flange sees it, in the frame of that."""

import numpy as np

from calib.arrays import Array, Index
from calib.errors import InputError
from calib.geometry.frames import skew
from calib.identification.start.closed_forms import nearest_rotation
from testbed.files.frames_fit import FAR, TIMES, flange_poses
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.robots.robot import Robot
from testbed.units import MM, significant

FEWEST = 12
"""Readings: nine numbers are fitted to them, from fifteen that are found without a start."""
ROUNDS = 10
"""Fits of these, each to the rows nearest to the one before."""
COLUMNS = "reflector_x_mm, reflector_y_mm, reflector_z_mm"


def seen_from_flange(session: Session, robot: Robot) -> InputError | None:
    """The error where points are those of one fixed point, as seen from the flange.

    Nothing else explained them. Where the flange alone keeps such a point nearly as well, readings
    that hardly differ are no sign of it.
    """
    rows = session.measurements
    if (rows.is_pose | rows.is_distance).any() or len(rows) < FEWEST:
        return None
    F, seen = flange_poses(robot.model, rows.q), rows.position
    left = _left(F, seen)
    without = _left(F, np.broadcast_to(seen.mean(axis=0), seen.shape))
    if not left < FAR or without < TIMES * left:
        return None
    return refusal(
        session.where, "points",
        "the readings fit as those of one fixed point in the frame of an instrument on the flange "
        f"of a nominal {robot.name}, within {significant(left * MM, 2)} mm in the median",
        allowed="places of a target on the tool, in a frame that stands still",
        fix=f"call their columns {COLUMNS}, and write one place of that point, the same in all "
        "rows and not 0 0 0, beside them in columns x_mm, y_mm, z_mm",
    )  # fmt: skip


def _left(F: Array, seen: Array) -> float:
    """Median [m] by which readings (m, 3) leave the fixed point that they fit best.

    Seen from flange poses F (m, 4, 4) by an instrument that is anywhere on it.
    """
    near = np.arange(len(F))
    left = np.zeros(0)
    for _ in range(ROUNDS):
        R, t, x = _fitted(F, seen, near)
        left = np.linalg.norm(_missed(F, seen, R, t, x), axis=1)
        near = np.argsort(left)[: max(FEWEST, 3 * len(F) // 4)]
    return float(np.median(left))


def _missed(F: Array, seen: Array, R: Array, t: Array, x: Array) -> Array:
    """By how much readings (m, 3) miss the fixed point x [m]."""
    return (F[:, :3, :3] @ (seen @ R.T + t)[..., None])[..., 0] + F[:, :3, 3] - x


def _fitted(F: Array, seen: Array, rows: Index) -> tuple[Array, Array, Array]:
    """Rotation and place of the instrument in the flange, and the fixed point, from some rows.

    The nine elements of the rotation are free at first, where the readings tell them; then the
    rotation nearest to them is turned until nothing is gained.
    """
    F, seen = F[rows], seen[rows]
    G, eye = F[:, :3, :3], np.broadcast_to(-np.eye(3), (len(F), 3, 3))
    free = np.einsum("mij,mk->mijk", G, seen - seen.mean(axis=0)).reshape(len(F), 3, 9)
    A = np.concatenate([free, G, eye], axis=2).reshape(-1, 15)
    found = np.linalg.lstsq(A, -F[:, :3, 3].ravel(), rcond=1e-9)[0]
    R = nearest_rotation(found[:9].reshape(3, 3))
    t, x = found[9:12] - R @ seen.mean(axis=0), found[12:]
    for _ in range(ROUNDS):
        turns = -G @ skew(seen @ R.T)
        A = np.concatenate([turns, G, eye], axis=2).reshape(-1, 9)
        step = np.linalg.lstsq(A, -_missed(F, seen, R, t, x).ravel(), rcond=1e-9)[0]
        R = nearest_rotation(R + skew(step[:3]) @ R)
        t, x = t + step[3:6], x + step[6:]
    return R, t, x
