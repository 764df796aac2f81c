"""How an estimate follows what was measured, and what noise that rows share does to it."""

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE, triangle
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

LENGTH, ANGLE = 0.6e-3, float(np.radians(0.1))
"""What link numbers are taken to be off by, where no reading tells [m, rad]."""


def least_squares_gain(
    model: RobotModel,
    parameters: Parameters,
    table: Measurements,
    *,
    precision: Array | float = 0.0,
    weights: Array | float = 1.0,
) -> Array:
    """F (m, f, 6): how free numbers follow each row of a table [m, rad]; zero where unfilled.

    Parameters
    ----------
    model : RobotModel
        At which the rows are linear.
    parameters : Parameters
        The free numbers.
    table : Measurements
        Its readings play no part: those of a plan will do.
    precision : (f, f) array
        Lambda0 of the scaled numbers before these rows.
    weights : (m,) array
        Of each row, where a robust loss gave it one.

    References
    ----------
    F = inv(A'WA + Lambda0) A'W.
    """
    seen, scale = predict(model, table), parameters.free_scale
    filled = seen.filled[:, :, None]
    A = np.where(filled, seen.rows[:, :, parameters.free_index] * scale, 0.0)
    both = filled & np.swapaxes(filled, 1, 2)
    WA = np.linalg.solve(np.where(both, table.covariance, np.eye(6)), A)
    WA = WA * np.reshape(weights, (-1, 1, 1))
    m, _, f = A.shape
    # one system for the rows of all poses: one for each would take all numbers squared each time
    H = WA.reshape(-1, f).T @ A.reshape(-1, f) + precision
    F = np.linalg.solve(H, WA.reshape(-1, f).T)
    return np.asarray(np.moveaxis(scale[:, None] * F, 0, 1).reshape(m, 6, f).swapaxes(1, 2))


def estimator_gain(identification: Identification, table: Measurements) -> Array:
    """F (m, f, 6) of an estimate with its prior and its weights, from its own table."""
    return least_squares_gain(
        identification.model,
        identification.parameters,
        table,
        precision=prior_precision(identification),
        weights=identification.weights if len(identification.weights) else 1.0,
    )


def of_all_numbers(identification: Identification, covariance: Array) -> Array:
    """Covariance (P, P) of all numbers from that of the free ones (f, f); zero elsewhere."""
    return beside_held(identification.parameters, covariance)


def beside_held(parameters: Parameters, covariance: Array) -> Array:
    """The same, of numbers not identified yet: those held have none."""
    full = np.zeros((len(parameters.names),) * 2)
    index = parameters.free_index
    full[np.ix_(index, index)] = (covariance + covariance.T) / 2
    return frozen(full)


def prior_precision(identification: Identification) -> Array:
    """Lambda0 (f, f) of the free numbers in scaled columns; zero without a prior."""
    parameters, prior = identification.parameters, identification.prior
    precision = np.zeros((parameters.n_free,) * 2)
    if prior is not None:
        place = {name: k for k, name in enumerate(parameters.free_names)}
        at = [place[name] for name in prior.names]
        scale = parameters.free_scale[at]
        precision[np.ix_(at, at)] = prior.precision * scale[:, None] * scale
    return precision


def untold(identification: Identification, table: Measurements, there: Array) -> Array:
    """Root (P, k) of what no row tells of link numbers, and no point whose rows are `there` shows.

    A joint that never moved hides how its link stands: there the estimate keeps what was nominal,
    with no variance at all. `there` (n, 3, P) are derivatives of the points that are stated.

    References
    ----------
    Null space of both in units of `LENGTH` and `ANGLE`, about what arms are off by.
    """
    model, lengths = identification.model, identification.parameters.is_length
    usual = np.where(lengths, LENGTH, ANGLE)
    usual[np.isin(model.names, model.joint_errors.names)] = 0.0  # nothing tells how large they are
    seen = predict(model, table)
    rows = np.where(seen.filled[:, :, None], seen.rows, 0.0).reshape(-1, model.n_numbers)
    A = np.concatenate([rows, there.reshape(-1, model.n_numbers)]) * usual
    some = np.flatnonzero(usual)
    _, singular, axes = np.linalg.svd(triangle(A[:, some]), full_matrices=True)
    rank = int((singular > RANK_TOLERANCE * singular[0]).sum())
    root = np.zeros((model.n_numbers, len(some) - rank))
    root[some] = usual[some, None] * axes[rank:].T
    return root


def covariance_of_groups(each: Array, group: Index) -> Array:
    """Covariance (f, f) of the sums of columns (m, f, k) whose rows of a group share their draw."""
    root = root_of_groups(each, group)
    return np.asarray(root @ root.T)


def root_of_groups(each: Array, group: Index) -> Array:
    """Root (f, g k) of that covariance."""
    _, number = np.unique(group, axis=0, return_inverse=True)
    moved = np.zeros((int(number.max()) + 1, *each.shape[1:]))
    np.add.at(moved, number.ravel(), each)
    return np.moveaxis(moved, 0, 1).reshape(each.shape[1], -1)
