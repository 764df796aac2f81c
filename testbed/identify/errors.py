"""Errors of a model in every row, and in figures over poses."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.geometry.model import RobotModel
from calib.measurement.accuracy import error_statistics
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from testbed.identify.records import Figures, RowErrors


def row_errors(model: RobotModel, measurements: Measurements) -> RowErrors:
    """Errors of `model` in every row."""
    seen = predict(model, measurements)
    vector = seen.residual[:, :3].copy()
    vector[measurements.is_distance] = 0.0
    turn = model.fixtures.station_frames[measurements.station][:, :3, :3]
    return RowErrors(
        frozen((turn @ vector[:, :, None])[:, :, 0]), frozen(seen.misses), frozen(seen.turns)
    )


def figures_of(errors: RowErrors, measurements: Measurements, rows: Bool) -> Figures:
    """Statistics over the poses of some rows (m,), one or more: each pose counts once."""
    pose = rows & measurements.is_pose
    position = of_poses(errors.position, measurements, rows)
    return Figures(
        position=error_statistics(position),
        rotation=error_statistics(of_poses(errors.rotation, measurements, pose))
        if pose.any()
        else None,
        median=float(np.median(position)),
    )


def of_poses(values: Array, measurements: Measurements, rows: Bool) -> Array:
    """Root mean square (p,) of the values (m,) over the rows of each pose among some."""
    pose = np.unique(measurements.pose_id[rows], return_inverse=True)[1].ravel()
    return np.asarray(np.sqrt(np.bincount(pose, values[rows] ** 2) / np.bincount(pose)))
