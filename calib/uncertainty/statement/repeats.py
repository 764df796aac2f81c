"""What repeats say: how large the noise really is, and how far one move ends from their mean."""

import numpy as np
from scipy.special import chdtrc, chdtri

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.misfit import UNGUARDED_DROP

FEWEST_FREEDOM = 30
"""Degrees of freedom below which repeats tell the scale of the noise no better than 13 %."""
WRONG, FEW = 1e-4, 0.1
"""Chance, all poses together, of visits so far apart below which one of them was a wrong shot, and
the part of the poses that may have one: the millimeter of one shot would pass for noise of all."""


def noise_repeats(
    model: RobotModel, visits: Measurements, *, in_evidence: bool = False
) -> NoiseRepeats | None:
    """Scatter of repeated positions about the means of their poses; None without enough repeats.

    Parameters
    ----------
    model : RobotModel
        Identified: joints that were read back differ a little between visits.
    visits : Measurements
        Every pose approached anew for each of its rows: a burst of readings at a standing arm
        shows less than the noise, which contains how well joints come back.
    in_evidence : bool
        Whether these rows are evidence of the misfit themselves.

    References
    ----------
    sum_k (y_k - m)'inv(N_k)(y_k - m), m the weighted mean of a pose, with 3 (r - 1) degrees of
    freedom for r rows. Poses with a wrong shot are left out; see `sound`.
    """
    points = visits.rows(~visits.is_distance)
    if not len(points):
        return None
    residual = predict(model, points).residual[:, :3]
    freedom, square = 0, 0.0
    for rows in sound(residual, points.covariance[:, :3, :3], repeated(points)):
        square += float(_about_mean(residual[rows], points.covariance[rows, :3, :3])[0].sum())
        freedom += 3 * (rows.size - len(rows))
    if freedom < FEWEST_FREEDOM or square <= 0:
        return None
    return NoiseRepeats(freedom, square, in_evidence)


def scatter_chance(model: RobotModel, points: Measurements, noise: float) -> float:
    """Chance that visits lie so far from the means of their poses, by `noise` times what is stated.

    One without repeats. Poses with a wrong shot are left out; see `sound`.
    """
    residual, N = predict(model, points).residual[:, :3], points.covariance[:, :3, :3]
    groups = sound(residual, N, repeated(points))
    freedom = sum(3 * (rows.size - len(rows)) for rows in groups)
    square = sum(float(_about_mean(residual[rows], N[rows])[0].sum()) for rows in groups)
    return float(chdtrc(freedom, square / noise**2)) if freedom else 1.0


def repeated(points: Measurements) -> list[Index]:
    """Rows (g, r) of what was visited r > 1 times: the same pose, station and target."""
    keys = np.column_stack([points.pose_id, points.target_key])
    _, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(group.ravel(), kind="stable")
    parts = np.split(order, np.cumsum(count)[:-1])
    times = sorted({len(part) for part in parts} - {1})
    return [np.array([part for part in parts if len(part) == r]) for r in times]


def sound(residual: Array, covariance: Array, groups: list[Index]) -> list[Index]:
    """Groups (g, r) of rows without those whose visits no common noise puts so far apart.

    Parameters
    ----------
    residual : (m, 3) array
        Positions that depend on no visit, or what they miss [m].
    covariance : (m, 3, 3) array
        Of the noise as stated [m^2].
    groups : list of (g, r) arrays
        From `repeated`.

    References
    ----------
    Squares about the means of poses against chi-square of 3 (r - 1), times the median of their
    ratios to its median: the noise of most poses, whatever was stated.
    """
    if not groups:
        return []
    freedom = np.concatenate([np.full(len(rows), 3.0 * (rows.shape[1] - 1)) for rows in groups])
    square = np.concatenate([_about_mean(residual[rows], covariance[rows])[0] for rows in groups])
    usual = float(np.median(square / chdtri(freedom, 0.5)))
    if usual <= 0.0:
        return groups
    chance = chdtrc(freedom, square / usual)
    most = int(FEW * len(chance))
    wrong: Bool = np.zeros(len(chance), dtype=np.bool_)
    wrong[np.argsort(chance, kind="stable")[:most]] = True
    kept = ~(wrong & (chance < WRONG / len(chance)))
    parts = np.split(kept, np.cumsum([len(rows) for rows in groups])[:-1])
    return [rows[part] for rows, part in zip(groups, parts, strict=True)]


def joint_scatter(
    model: RobotModel, visits: Measurements, own: Array, shape: Array, drift: Array | None = None
) -> tuple[float, float] | None:
    """Factor on the stated repeatability of the joints, and its upper 95 % limit, from repeats.

    Parameters
    ----------
    model : RobotModel
        Identified.
    visits : Measurements
        As in `noise_repeats`.
    own : (m, 3, 3) array
        Covariance of the instrument alone in each row [m^2].
    shape : (m, 3, 3) array
        Covariance of each row that the stated repeatability makes [m^2].
    drift : (m, 3) array, optional
        What the positions have of a drift, which joints do not make [m].

    References
    ----------
    Likelihood of the differences from pose means, covariance own + factor^2 shape; one-sided limit
    where it falls by `UNGUARDED_DROP`.
    """
    points = visits.rows(~visits.is_distance)
    groups = repeated(points) if len(points) else []
    if not groups:
        return None
    keep = ~visits.is_distance
    own, shape = own[keep], shape[keep]
    residual = predict(model, points).residual[:, :3]
    if drift is not None:
        residual = residual - drift[keep]
    groups = sound(residual, own + shape, groups)
    factors = np.concatenate([[0.0], np.geomspace(0.02, 50.0, 320)])
    value = np.array([_of_differences(residual, own + f**2 * shape, groups) for f in factors])
    best = int(np.argmax(value))
    last = int(np.flatnonzero(value >= value[best] - UNGUARDED_DROP)[-1])
    return float(factors[best]), float(factors[min(last + 1, len(factors) - 1)])


def _of_differences(residual: Array, V: Array, groups: list[Index]) -> float:
    """Log-likelihood of what rows of one pose differ by, their mean taken out."""
    total = 0.0
    for rows in groups:
        square, precision = _about_mean(residual[rows], V[rows])
        logarithms = np.linalg.slogdet(V[rows])[1].sum() + np.linalg.slogdet(precision)[1].sum()
        total -= float(logarithms + square.sum()) / 2
    return total


def _about_mean(y: Array, V: Array) -> tuple[Array, Array]:
    """Whitened squares (g,) of rows y (g, r, 3) about weighted means, and precisions (g, 3, 3)."""
    pull = np.linalg.solve(V, y[..., None]).sum(axis=1)
    precision = np.linalg.solve(V, np.broadcast_to(np.eye(3), V.shape)).sum(axis=1)
    apart = y - np.swapaxes(np.linalg.solve(precision, pull), 1, 2)
    return (apart * np.linalg.solve(V, apart[..., None])[..., 0]).sum(axis=(1, 2)), precision
