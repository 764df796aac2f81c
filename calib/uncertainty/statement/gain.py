"""How an estimate follows what was measured, and what noise that rows share does to it."""

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Index, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.fit_statistics import squared_notes
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE, triangle
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize, table_whiteners
from calib.uncertainty.covariance import covariance_factor

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


def stop_covariance(identification: Identification, train: Measurements, root: Array) -> Array:
    """What P (P, P) of independent rows lacks, where rows of one stop share noise of a root.

    References
    ----------
    F V F' less the same by rows, V = S S' of the stops and S (m, 6, j) their root.
    """
    each = estimator_gain(identification, train) @ root
    alone = covariance_of_groups(each, np.arange(len(train))[:, None])
    stop = np.column_stack([train.pose_id, train.repeat])
    return of_all_numbers(identification, covariance_of_groups(each, stop) - alone)


def covariance_of_groups(each: Array, group: Index) -> Array:
    """Covariance (f, f) of the sums of columns (m, f, k) whose rows of a group share their draw."""
    _, number = np.unique(group, axis=0, return_inverse=True)
    moved = np.zeros((int(number.max()) + 1, *each.shape[1:]))
    np.add.at(moved, number.ravel(), each)
    root = np.moveaxis(moved, 0, 1).reshape(each.shape[1], -1)
    return np.asarray(root @ root.T)


def judged_by_stops(
    identification: Identification, train: Measurements, root: Array
) -> Identification:
    """The same fit with the p-value of its residuals for noise that rows of one stop share.

    Several targets of one stop scatter together: their squares sum to other sizes than those of
    rows apart, and the numbers follow more of them. Fits stay as they are where no stop has two
    rows, where the loss is robust, or where a prior was weighed against larger noise.

    Parameters
    ----------
    identification : Identification
        From `train`.
    train : Measurements
        The shared noise is in their covariances.
    root : (m, 6, j) array
        Root of that noise, from `Circumstances.stops`.

    References
    ----------
    Satterthwaite 1946: r'r is E / nu times chi-square of nu = E^2 / tr(V^2), E = tr V, with V the
    covariance of r.
    """
    fit, stops = identification, np.column_stack([train.pose_id, train.repeat])
    if len(np.unique(stops, axis=0)) == len(train) or not root.any():
        return fit
    if fit.mode != "whitened" or fit.loss != "squared" or fit.tightened != 1.0:
        return fit
    E, spread = _traces(fit, train, root)
    nu = E**2 / spread
    p = float(chdtrc(nu, fit.chi_square * nu / E))
    said, lack = (fit.chi_square, fit.dof_effective), fit.lack_of_fit
    old = squared_notes(*said, fit.p_value, lack)
    notes = (*(note for note in fit.notes if note not in old), *squared_notes(*said, p, lack))
    return replace(fit, p_value=p, notes=notes)


def _traces(fit: Identification, train: Measurements, root: Array) -> tuple[float, float]:
    """Tr V and tr V^2 of the covariance V of whitened residuals.

    References
    ----------
    V = M + M S M, M = I - B B', B B' = A C A', and S what whitened rows of a stop share. Nothing
    (n, n) is made: M^k = I - B P_k B', and S has zeros where a row meets itself.
    """
    stack = linearize(fit.model, train)
    B = stack.A[:, fit.parameters.free_index] @ covariance_factor(fit.covariance)
    filled = np.arange(6) < train.equations[:, None]
    own = np.where(filled[:, :, None], table_whiteners(train) @ root, 0.0)
    R = own[filled]  # (n, j) in the order of the equations
    _, stop = np.unique(np.column_stack([train.pose_id, train.repeat]), axis=0, return_inverse=True)
    SB, square = np.zeros_like(B), 0.0
    for group, sign in ((stop.ravel(), 1.0), (np.arange(len(train)), -1.0)):
        of = group[stack.row_of]  # all pairs of a stop, less those of a row with itself
        across = np.zeros((int(of.max()) + 1, R.shape[1], B.shape[1]))
        np.add.at(across, of, R[:, :, None] * B[:, None])
        SB += sign * np.einsum("nj,njf->nf", R, across[of])
        inner = np.zeros((len(across), R.shape[1], R.shape[1]))
        np.add.at(inner, of, R[:, :, None] * R[:, None])
        square += sign * float((inner**2).sum())
    G, T, one = B.T @ B, B.T @ SB, np.eye(B.shape[1])
    second = 2 * one - G  # P_2
    third = second + one - second @ G
    first = len(B) - np.trace(G) - np.trace(second @ T)
    spread = len(B) - np.trace(second @ G) - 2 * np.trace(third @ T) + square
    spread += np.trace(second @ T @ second @ T) - 2 * np.trace(second @ SB.T @ SB)
    return float(first), float(spread)
