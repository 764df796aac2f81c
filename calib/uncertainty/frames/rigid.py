"""Errors at poses as one rigid motion: of the station, of the target, or of both."""

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.frames import log_so3, transform_points
from calib.geometry.model import RobotModel
from calib.identification.start.closed_forms import fitted_frame
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predicted_positions, tool_poses

STEPS = 20
"""Gauss-Newton steps of station and target together; from a station half a meter off six do."""


def whole_motion(
    model: RobotModel, table: Measurements, about: Array
) -> tuple[Array, float, float]:
    """Shift and turn (6,) of the motion from predicted to seen positions; its size, what it leaves.

    By Procrustes, whatever the turn [m, rad].
    """
    p = predicted_positions(model, table)
    T = fitted_frame(table.position, p, np.eye(3))
    moved = transform_points(T, p) - p
    shift = T[:3, :3] @ about + T[:3, 3] - about
    turn = log_so3(T[None, :3, :3])[0]
    return np.concatenate([shift, turn]), rms_length(moved), rms_length(table.position - p - moved)


def plain_offset(e: Array, tool: Array) -> tuple[Array, float, float]:
    """Offset (3,) of the target that errors (m, 3) show alone; its size, what it leaves [m]."""
    offset = np.linalg.lstsq(tool.reshape(-1, 3), e.ravel(), rcond=None)[0]
    return np.asarray(offset, np.float64), rms_length(tool @ offset), rms_length(e - tool @ offset)


def rest_of(
    position: Array, p: Array, tool: Array, *, station: bool, target: bool, used: Bool | None = None
) -> Array:
    """Errors (m, 3) that the best motion of station or target, or of both, leaves [m].

    Parameters
    ----------
    position, p : (m, 3) array
        Seen and predicted positions.
    tool : (m, 3, 3) array
        Axes of the tool there.
    station, target : bool
        Which of them may have moved.
    used : (m,) array of bool, optional
        Rows that tell the motion; all by default.

    References
    ----------
    Procrustes for the station, whatever its turn; the offset of the target by Gauss-Newton, with
    the columns of a further motion of the station beside it.
    """
    offset, mine = np.zeros(3), np.ones(len(p), np.bool_) if used is None else used
    for _ in range(STEPS):
        aim = p + tool @ offset
        seen = position
        if station:
            T = fitted_frame(position[mine], aim[mine], np.eye(3))
            seen = (position - T[:3, 3]) @ T[:3, :3]
        left = seen - aim
        if not target:
            break
        base = turning(aim - aim.mean(axis=0))
        columns = np.concatenate([base, tool] if station else [tool], axis=2)[mine]
        own = left[mine].ravel()
        offset += np.linalg.lstsq(columns.reshape(own.size, -1), own, rcond=None)[0][-3:]
    return np.asarray(left)


def turning(arms: Array) -> Array:
    """Columns (m, 3, 6) of points (m, 3) that shift, or turn about the origin."""
    columns = np.zeros((len(arms), 3, 6))
    columns[:, :, :3] = np.eye(3)
    columns[:, :, 3:] = -np.cross(arms[:, :, None], np.eye(3)[None], axis=1)
    return columns


def rms_length(vectors: Array) -> float:
    """Root mean square length of vectors (m, 3)."""
    return float(np.sqrt((vectors**2).sum() / len(vectors)))


def motions_of(model: RobotModel, table: Measurements, about: Array) -> Array:
    """Rows (m, 6, 9) of a station that shifts, or turns about a point, and of a target that shifts.

    In the axes of the station; the target in those of the tool.
    """
    station = model.fixtures.station_frames[table.station][:, :3, :3]
    motions = np.zeros((len(table), 6, 9))
    motions[:, :3, :6] = turning(predicted_positions(model, table) - about)
    motions[:, 3:, 3:6] = table.is_pose[:, None, None] * np.eye(3)
    motions[:, :3, 6:] = np.swapaxes(station, 1, 2) @ tool_poses(model, table)[:, :3, :3]
    return motions
