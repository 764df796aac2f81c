"""Errors of a model against what was measured, row by row, and in figures."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.geometry.model import RobotModel
from calib.identification.identify import Identification
from calib.identification.outlier_search import noise_factor
from calib.identification.prior import prior_rows
from calib.identification.tangent import covariance_factor
from calib.measurement.accuracy import error_statistics
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize
from testbed.identify.records import Figures, FittedModel, ModelName, RowErrors


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
    """Statistics over some rows (m,), one or more."""
    pose = rows & measurements.is_pose
    return Figures(
        position=error_statistics(errors.position[rows]),
        rotation=error_statistics(errors.rotation[pose]) if pose.any() else None,
        median=float(np.median(errors.position[rows])),
    )


def held_out_figures(
    errors: RowErrors, measurements: Measurements, is_test: Bool
) -> Figures | None:
    """Statistics over the held-out rows (m,); None if there are none."""
    return figures_of(errors, measurements, is_test) if is_test.any() else None


def fitted_model(
    name: ModelName,
    identification: Identification,
    start: RobotModel,
    measurements: Measurements,
    used: Bool,
    is_test: Bool,
) -> FittedModel:
    """One identification from `start` with its errors at the rows used and held out."""
    train = measurements.rows(used)
    errors = row_errors(identification.model, measurements)
    return FittedModel(
        model=name,
        identification=identification,
        scatter=scatter_covariance(start, identification, train),
        noise_factor=noise_factor(identification.model, train),
        misses=errors,
        train=figures_of(errors, measurements, used),
        test=held_out_figures(errors, measurements, is_test),
    )


def scatter_covariance(
    nominal: RobotModel, result: Identification, measurements: Measurements
) -> Array:
    """Covariance (f, f) of an estimate from how its residuals scatter from pose to pose.

    It needs no stated noise, but poses drawn at random from where the robot works: what the model
    leaves out then counts as scatter. With fewer poses than numbers it is too small.

    Parameters
    ----------
    nominal : RobotModel
        Where the fit began.
    result : Identification
        Of the default estimator.
    measurements : Measurements
        What it was identified from.

    References
    ----------
    White 1980, clustered by pose: inv(H) (sum_j A_j'r_j r_j'A_j) inv(H) m/(m - 1) n/(n - f).
    """
    stack = linearize(result.model, measurements)
    columns = result.parameters.free_index
    A, rows = stack.A[:, columns], np.zeros((0, len(columns)))
    if result.prior is not None:
        rows = prior_rows(result.prior, nominal, result.parameters).at(result.model)[1][:, columns]
    weight = result.weights[stack.row_of] if result.loss != "squared" else np.ones(len(A))
    root = covariance_factor(np.concatenate([np.sqrt(weight)[:, None] * A, rows]))
    _, pose = np.unique(measurements.pose_id, return_inverse=True)
    pull = np.zeros((int(pose.max()) + 1, len(columns)))
    np.add.at(pull, pose.ravel()[stack.row_of], (weight * stack.r)[:, None] * A)
    moved = pull @ root @ root.T
    m, n, f = len(pull), len(A), len(columns)
    return frozen(moved.T @ moved * (m / max(m - 1, 1)) * (n / max(n - f, 1)))
