"""Identified against true: held-out errors, parameters, and whether the stated regions hold them.

This module, `replication` and `population` judge; with the simulator they alone look at the truth.
"""

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import transform
from calib.geometry.model import RobotModel
from calib.geometry.sweep import reflector_rows
from calib.identification.identify import Identification, identify
from calib.measurement.accuracy import accuracy, rotation_errors
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import coverage_factor, inside, mahalanobis_squared
from testbed.records import Comparison, Setting

INTERVAL = coverage_factor(1)
"""Half width of a 95 % interval in standard uncertainties."""
REFIT_POSES = 200
"""Poses of the pool at which the truth is written down in the estimated numbers."""


def target_points(T: Array, target: Array) -> Array:
    """Positions (m, 3) of the judged tool point at poses T (m, 4, 4) [m]."""
    return np.asarray(T[:, :3, 3] + T[:, :3, :3] @ target)


def target_prediction(
    model: RobotModel, q: Array, target: Array, covariance: Array
) -> tuple[Array, Array, Array]:
    """Point (m, 3), rotation (m, 3, 3) and stated covariance (m, 6, 6) at joints q [m, rad].

    `covariance` (P, P) is that of all numbers of the model, zero where they are not estimated.
    """
    T, J = model.poses_and_jacobian(q)
    point, rows = reflector_rows(T, J, np.broadcast_to(target, (len(q), 3)))
    J = np.concatenate([rows, J[:, 3:]], axis=1)
    return point, T[:, :3, :3], J @ covariance @ np.swapaxes(J, 1, 2)


def noise_free(model: RobotModel, like: Measurements, q: Array, covariance: Array) -> Measurements:
    """Measurements of `model` without noise at q (m, n), of the kind and offset of `like`."""
    T, m = model.poses(q), len(q)
    offset = np.broadcast_to(like.offset[0], (m, 3))
    pose = bool(like.is_pose[0])
    return Measurements(
        q=q,
        position=T[:, :3, 3] + (T[:, :3, :3] @ offset[0]),
        rotation=T[:, :3, :3] if pose else np.broadcast_to(np.eye(3), (m, 3, 3)),
        covariance=covariance,
        kind=np.full(m, like.kind[0]),
        offset=offset,
        pose_id=np.arange(m),
        repeat=np.zeros(m, dtype=np.int64),
    )


def true_step(setting: Setting, identification: Identification, like: Measurements) -> Array:
    """True values minus nominal (f,) of the estimated parameters, in the gauge they were kept in.

    The kept set is refitted to noise-free poses of the true geometry (without joint errors), so
    redundant truth lands where the estimate can hold it, exactly and not only to first order. Where
    the estimated set cannot represent the truth this is its best fit over poses of the pool.
    """
    geometry = RobotModel(setting.true.chain)
    q = setting.pool_q[:REFIT_POSES]
    covariance = np.broadcast_to(like.covariance[0], (len(q), 6, 6))
    table = noise_free(geometry, like, q, covariance)
    exact = identify(setting.nominal, table, identification.parameters)
    if exact.parameters.free_names != identification.parameters.free_names:
        return np.asarray(setting.nominal.step_to(geometry)[identification.parameters.free])
    return exact.step


def compare(
    setting: Setting, identification: Identification, measurements: Measurements, truth: Array
) -> Comparison:
    """Judge one identification.

    Parameters
    ----------
    setting : Setting
        Holds the truth and the held-out poses.
    identification : Identification
        What was identified.
    measurements : Measurements
        What it was identified from.
    truth : (f,) array
        From `true_step` [m, rad].
    """
    q, target = setting.test_q, setting.target
    p_true, T0 = target_points(setting.test_true, target), setting.nominal.poses(q)
    point, R, covariance = target_prediction(
        identification.model, q, target, identification.full_covariance
    )
    before = distances(p_true, target_points(T0, target))
    error = p_true - point
    after = distances(p_true, point)
    wrong = identification.step - truth
    at_measured = [
        accuracy(distances(measurements.position, observed_points(model, measurements)))
        for model in (setting.nominal, identification.model)
    ]
    return Comparison(
        before=before,
        after=after,
        rotation_before=rotation_errors(setting.test_true, T0),
        rotation_after=rotation_errors(setting.test_true, transform(R, point)),
        error=error,
        covariance=covariance,
        inside=inside(error, covariance[:, :3, :3]),
        identification_before=at_measured[0],
        identification_after=at_measured[1],
        accuracy_before=accuracy(before),
        accuracy_after=accuracy(after),
        true_step=truth,
        parameter_inside=np.abs(wrong) <= INTERVAL * identification.standard_uncertainty,
        nees=float(mahalanobis_squared(wrong, identification.covariance)),
    )


def distances(a: Array, b: Array) -> Array:
    """Distances (m,) [m] between points (m, 3)."""
    return np.asarray(np.linalg.norm(a - b, axis=1))


def observed_points(model: RobotModel, measurements: Measurements) -> Array:
    """Where `model` predicts the measured points (m, 3) [m]."""
    T = model.poses(measurements.q)
    return np.asarray(T[:, :3, 3] + (T[:, :3, :3] @ measurements.offset[:, :, None])[:, :, 0])
