"""Regions that hold the truth with a stated probability: factors, ellipsoids, inside or outside."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, stdtrit

from calib.arrays import (
    Array,
    Bool,
    require_finite,
    require_numbers,
    require_probability,
    wrong_shape,
)
from calib.errors import InputError, refuse
from calib.kinds import checked_kinds

FLAT = 1e-12
"""A direction whose variance is below this part of the largest has none: rounding of J C J'."""
ROUNDED = 1e-9
"""Part of its largest entry by which a covariance may be uneven or negative: rounding, too."""


@checked_kinds
def coverage_factor(dimension: int = 1, probability: float = 0.95) -> float:
    """Factor k of the ellipsoid that holds a normal m-vector: sqrt of the chi-square quantile.

    For 95 %: 1.9600, 2.4477, 2.7955, 3.5485 and 6.0345 in 1, 2, 3, 6 and 24 dimensions.

    References
    ----------
    JCGM 102:2011.
    """
    if dimension < 1:
        raise refuse("dimension", dimension, "1 or more", code="A3")
    return float(np.sqrt(chdtri(dimension, 1 - require_probability(probability))))


def student_factor(degrees_of_freedom: ArrayLike, probability: float = 0.95) -> Array:
    """Factor t of a single number whose standard uncertainty came from few repeats.

    Infinite degrees of freedom give the normal factor; nine give 2.26 for 95 %.

    References
    ----------
    JCGM 100:2008, G.3.
    """
    return np.asarray(stdtrit(degrees_of_freedom, (1 + require_probability(probability)) / 2))


@checked_kinds
def expanded(standard: ArrayLike, *, dimension: int = 1, probability: float = 0.95) -> Array:
    """Expanded uncertainty U = k u of the same shape and unit as `standard`.

    `dimension` is that of the statement: 1 for an interval of one number, 3 for a semi-axis of the
    ellipsoid of a point.
    """
    standard, k = require_numbers("standard", standard), coverage_factor(dimension, probability)
    require_finite("standard", standard)
    if (standard < 0).any():
        raise refuse("standard", float(standard.min()), "zero or more", code="A3")
    return np.asarray(k * standard)


@checked_kinds
def ellipsoid(covariance: ArrayLike, *, probability: float = 0.95) -> tuple[Array, Array]:
    """Semi-axes (..., d) and orientation (..., d, d) of the coverage ellipsoid, longest axis first.

    Parameters
    ----------
    covariance : (..., d, d) array_like
        Of a point, e.g. the first three rows and columns of a tool covariance [m^2].
    probability : float
        Content of the region.

    Returns
    -------
    semi_axes : (..., d) array
        Half lengths k sqrt(eigenvalue) [m].
    orientation : (..., d, d) array
        Right-handed rotation; its columns are the axes, in the frame of the covariance.
    """
    covariance, values, vectors = _axes(covariance)
    values, vectors = values[..., ::-1], vectors[..., ::-1]
    # an axis has no sign: point its largest component up, then make the last one right-handed
    largest = np.argmax(np.abs(vectors), axis=-2)[..., None, :]
    vectors = vectors * np.where(np.take_along_axis(vectors, largest, axis=-2) < 0, -1.0, 1.0)
    hand = np.where(np.linalg.det(vectors) < 0, -1.0, 1.0)
    vectors = np.concatenate([vectors[..., :-1], vectors[..., -1:] * hand[..., None, None]], -1)
    k = coverage_factor(covariance.shape[-1], probability)
    return k * np.sqrt(np.maximum(values, 0.0)), vectors


def mahalanobis_squared(error: Array, covariance: Array) -> Array:
    """Squared distance e' C^-1 e (...,) from the center in units of the covariance.

    Parameters
    ----------
    error : (..., d) array
        True minus stated value.
    covariance : (..., d, d) array
        Of the stated value, positive definite.

    References
    ----------
    Chi-square with d degrees of freedom if the statement is honest (NEES).
    """
    # scaled to unit diagonal first, so that metres and radians solve equally well
    u = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    if not (u > 0).all():
        raise _not_definite("has a direction without variance", "fixed")
    try:
        root = np.linalg.cholesky(covariance / (u[..., :, None] * u[..., None, :]))
    except np.linalg.LinAlgError:
        raise _not_definite("is not positive definite", "dependent") from None
    white = np.linalg.solve(root, (error / u)[..., None])[..., 0]
    return np.asarray((white**2).sum(axis=-1))


@checked_kinds
def inside(error: ArrayLike, covariance: ArrayLike, *, probability: float = 0.95) -> Bool:
    """Whether the coverage region holds the truth (...,).

    A direction without variance (few numbers estimated, or a posture that some of them do not move)
    has no width: there the truth must lie in the region's plane, and the ellipsoid has fewer
    dimensions.

    Parameters
    ----------
    error : (..., d) array_like
        True minus stated value.
    covariance : (..., d, d) array_like
        Of the stated value, positive semidefinite.
    probability : float
        Content of the region.
    """
    (covariance, values, vectors), error = _axes(covariance), require_numbers("error", error)
    require_finite("error", error)
    if error.ndim == 0 or error.shape[-1] != covariance.shape[-1]:
        raise wrong_shape("error", error.shape, f"expected (..., {covariance.shape[-1]})")
    try:
        np.broadcast_shapes(error.shape[:-1], covariance.shape[:-2])
    except ValueError:
        allowed = f"covariance has shape {covariance.shape}: one for each error"
        raise wrong_shape("error", error.shape, allowed) from None
    along = (np.swapaxes(vectors, -1, -2) @ error[..., None])[..., 0]
    flat = values <= FLAT * values[..., -1:]
    square = np.where(flat, 0.0, along**2 / np.where(flat, 1.0, values)).sum(axis=-1)
    off_plane = (flat & (along**2 > FLAT * values[..., -1:])).any(axis=-1)
    factors = np.array(
        [0.0, *(coverage_factor(k, probability) for k in range(1, flat.shape[-1] + 1))]
    )
    return np.asarray((square <= factors[(~flat).sum(axis=-1)] ** 2) & ~off_plane)


def _axes(covariance: ArrayLike) -> tuple[Array, Array, Array]:
    """A covariance (..., d, d), its variances (..., d), smallest first, and their directions."""
    covariance = require_numbers("covariance", covariance)
    if covariance.ndim < 2 or not 0 < covariance.shape[-1] == covariance.shape[-2]:
        raise wrong_shape("covariance", covariance.shape, "expected (..., d, d)")
    require_finite("covariance", covariance)
    require_covariance(covariance)
    values, vectors = np.linalg.eigh(covariance)
    if (values[..., 0] < -ROUNDED * np.abs(values).max(axis=-1)).any():
        least, allowed = float(values.min()), "no negative variance in any direction"
        message = f"covariance has the eigenvalue {least:.3g}"
        raise refuse("covariance", least, allowed, code="A3", message=message)
    return covariance, values, vectors


def require_covariance(covariance: Array) -> None:
    """Refuse matrices (..., d, d) that are not symmetric, or have a negative variance."""
    size = np.abs(covariance).max(axis=(-2, -1), keepdims=True)
    uneven = np.abs(covariance - np.swapaxes(covariance, -1, -2)) > ROUNDED * size
    if uneven.any():
        *_, i, j = (int(k) for k in np.argwhere(uneven)[0])
        message = f"covariance[{i}, {j}] and [{j}, {i}] differ"
        raise refuse("covariance", allowed="a symmetric matrix", code="A3", message=message)
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    if (variance < -ROUNDED * size[..., 0]).any():
        least = float(variance.min())
        message = f"covariance has the variance {least:.3g}"
        raise refuse("covariance", least, "zero or more", code="A3", message=message)


def _not_definite(what: str, numbers: str) -> InputError:
    """The error for a covariance that no distance can be measured in."""
    return refuse(
        "covariance", allowed="positive definite matrices", code="A3",
        message=f"covariance {what}", fix=f"leave {numbers} numbers out of the statement",
    )  # fmt: skip
