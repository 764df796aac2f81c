"""Held-out errors, counted: no larger a misfit than lets the region hold the share it is for.

The likelihood takes few readings that are far off for a larger misfit of all. But a region is
promised for a share of poses, and where enough are held out, counting them bounds it, whatever the
law of the errors.
"""

from dataclasses import replace

import numpy as np
from scipy.special import bdtr

from calib.arrays import Array, require_probability
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.believe import adding

CONFIDENCE = 0.95
"""With which a share of errors that was counted is one of all poses."""
HALVINGS = 40
"""Of the variance that is searched for: to a part in 10^12."""


def counted(
    belief: Belief, held_out: Measurements | None, *, shared: Array | float = 0.0
) -> Belief:
    """The belief with no larger a misfit than lets its regions hold enough held-out errors.

    Of several rows of a pose the worst counts, and noise counts as error. What all readings share,
    or neighbors in time (`shared`, a part of the belief's covariance), is no room for these errors,
    which do not show it. Held-out poses that guard nothing bound nothing.
    """
    if held_out is None or not belief.n_guards or not np.isfinite(belief.misfit.upper):
        return belief
    points = held_out.rows(~held_out.is_distance)
    rank = counted_rank(points.n_poses, belief.probability)
    if not rank:
        return belief
    own = replace(belief, covariance=belief.covariance - shared)
    known, whole = (
        replace(own, misfit=replace(belief.misfit, upper=size)).seen_regions(points).covariance
        for size in (0.0, 1.0)
    )
    errors = predict(belief.model, points).residual[:, :3]
    sizes = enclosing_sizes(errors, known, whole - known, probability=belief.probability)
    enough = float(np.sort(points.largest_of_poses(sizes))[rank - 1])
    if enough >= belief.misfit.upper:
        return belief
    less = replace(belief, misfit=replace(belief.misfit, upper=enough, counted=True))
    return adding(less, np.zeros_like(belief.covariance), points)


def enclosing_sizes(e: Array, known: Array, hidden: Array, probability: float = 0.95) -> Array:
    """Misfits (..., n) per axis whose regions hold errors, as ellipsoid and by radius [m].

    Parameters
    ----------
    e : (..., n, 3) array
        Errors [m].
    known, hidden : (..., n, 3, 3) arrays
        Covariance of what else is in each region [m^2], and that of a misfit of 1 m, positive
        definite; the region is that of their sum, the second times the variance of the misfit.
    probability : float
        Content of the regions.
    """
    square = coverage_factor(3, probability) ** 2
    # the radius of a round region is the least of its variance
    ball = 3 * (e**2).sum(axis=-1) / square - np.trace(known, axis1=-2, axis2=-1)
    ball /= np.trace(hidden, axis1=-2, axis2=-1)
    root = np.linalg.cholesky(hidden)
    half = np.linalg.solve(root, known)
    values, axes = np.linalg.eigh(np.linalg.solve(root, np.swapaxes(half, -1, -2)))
    white = np.linalg.solve(root, e[..., None])
    part = (np.swapaxes(axes, -1, -2) @ white)[..., 0] ** 2 / square
    values = np.maximum(values, np.finfo(float).tiny)
    low, high = np.zeros(e.shape[:-1]), part.sum(axis=-1)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        held = (part / (values + middle[..., None])).sum(axis=-1) <= 1
        low, high = np.where(held, low, middle), np.where(held, middle, high)
    return np.asarray(np.sqrt(np.maximum(high, ball)))


def counted_rank(n: int, probability: float = 0.95) -> int:
    """Smallest r for which the r-th smallest of n errors bounds a share `probability` of all.

    With a confidence of `CONFIDENCE`, whatever their distribution; 0 where n are too few (fewer
    than 59 for 95 %).

    References
    ----------
    Wilks 1941: the share below the r-th smallest is at least p with the chance that fewer than r of
    n are below the quantile p.
    """
    require_probability(probability, "C41")
    sure = bdtr(np.arange(n), n, probability) >= CONFIDENCE
    return int(np.argmax(sure)) + 1 if sure.any() else 0
