"""Measured angles that are further off than stated: how far, and where they pull the estimate."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import estimator_gain, of_all_numbers, root_of_groups
from calib.uncertainty.statement.misfit import DROP
from calib.uncertainty.statement.shape import angles_apart, are_loud, misfit_shape, wrong_shots

TURNS = np.concatenate([[0.0], np.geomspace(0.01, 1000.0, 200)])
"""Errors of angles that are tried, in their stated standard deviations."""
ROUNDS = 10
"""Searches for wrong shots among angles that are all further off than stated; two or three do."""


@dataclass(frozen=True, slots=True, eq=False)
class LoudTurns:
    """Errors of angles beyond what is stated of them, and what they pull the numbers by.

    The estimate follows angles that no evidence of positions looks at.
    """

    size: float
    """Upper limit per axis, anew at each pose [rad]."""
    covariance: Array
    """(P, P) that they leave in all numbers [m, rad]."""


def loud_turns(
    identification: Identification, train: Measurements, held_out: Measurements
) -> LoudTurns | None:
    """How far angles are off beyond their noise and the misfit of positions; None where not at all.

    References
    ----------
    t by its profile likelihood, its limit as that of the misfit; C = t^2 sum over poses of F F', F
    the gain of the angles of a pose.
    """
    tables = [table for table in (train, held_out) if table.is_pose.any()]
    if not tables:
        return None
    model = identification.model
    shape = misfit_shape(model, held_out if len(held_out) else train)
    seen = [(predict(model, table), table.is_pose) for table in tables]
    variance, square = angles_apart(
        np.concatenate([one.residual[some] for one, some in seen]),
        np.concatenate([shape.rows(one.rows[some, 3:]) for one, some in seen]),
        np.concatenate([table.covariance[table.is_pose] for table in tables]),
    )
    if not are_loud(variance, square):
        return None
    tried = float(np.sqrt(variance.mean())) * TURNS
    wrong = wrong_shots(variance, square)
    for _ in range(ROUNDS):  # what is far off for the noise may be none for these errors
        whole = (variance + tried[:, None, None] ** 2)[:, ~wrong]
        value = -(np.log(whole) + square[~wrong] / whole).sum(axis=(1, 2)) / 2
        before, wrong = wrong, wrong_shots(variance + tried[value.argmax()] ** 2, square)
        if np.array_equal(wrong, before):
            break
    last = int(np.flatnonzero(value >= value.max() - DROP)[-1])
    size = float(tried[min(last + 1, len(tried) - 1)])
    pull = estimator_gain(identification, train)[:, :, 3:]
    root = size * root_of_groups(pull, train.pose_id)
    return LoudTurns(size, frozen(of_all_numbers(identification, root @ root.T)))
