"""Cycles of ISO 9283: checks, the jackknife, and what figures read from noise alone."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, gammaln, ndtri

from calib.arrays import Array, require_finite, require_numbers, wrong_shape
from calib.errors import refuse
from calib.geometry.frames import ROUNDED

FEWEST = 3
"""Fewest cycles for which a scatter is stated."""
MOST_GROUPS = 500
"""Most groups that a jackknife leaves out in turn; up to so many cycles, each is a group."""
QUANTILES = 512
"""Quantiles of a distribution over which a mean is taken."""


def cycles_of(position: ArrayLike) -> Array:
    """Checked positions (..., n, 3) of n cycles [m]; an `InputError` if there are under three."""
    x = require_numbers("position", position)
    if x.ndim < 2 or x.shape[-1] != 3 or x.shape[-2] < FEWEST:
        allowed = f"(..., n, 3) with at least {FEWEST} cycles"
        raise wrong_shape("position", x.shape, allowed)
    require_finite("position", x)
    return x


def rotations_of(R: ArrayLike) -> Array:
    """Checked rotations (..., n, 3, 3) of n cycles; an `InputError` if there are under three."""
    array = require_numbers("R", R)
    if array.ndim < 3 or array.shape[-2:] != (3, 3) or array.shape[-3] < FEWEST:
        raise wrong_shape("R", array.shape, f"(..., n, 3, 3) with at least {FEWEST} cycles")
    require_finite("R", array)
    return require_rotations("R", array)


def require_rotations(name: str, R: Array) -> Array:
    """The same matrices (..., 3, 3); an `InputError` (A3) if one is no rotation."""
    skewed = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-2, -1))
    wrong = (skewed > ROUNDED) | (np.linalg.det(R) < 0)
    if wrong.any():
        place = "".join(f"[{int(k)}]" for k in np.argwhere(wrong)[0])
        allowed = "an orthonormal right-handed matrix"
        raise refuse(name, allowed=allowed, code="A3", message=f"{name}{place} is not a rotation")
    return R


def per_pose(values: ArrayLike, lead: tuple[int, ...], name: str, tail: tuple[int, ...]) -> Array:
    """Values (*lead, *tail), one for every pose; a single one is repeated."""
    array = require_numbers(name, values)
    try:
        array = np.broadcast_to(array, (*lead, *tail))
    except ValueError:
        raise wrong_shape(name, array.shape, f"expected {(*lead, *tail)}") from None
    require_finite(name, array)
    return array


def covariances_of(values: ArrayLike, name: str, lead: tuple[int, ...]) -> Array:
    """Covariances (*lead, 3, 3); an `InputError` (M34) if one has a negative eigenvalue."""
    C = require_numbers(name, values)
    if C.shape[-2:] != (3, 3):
        raise wrong_shape(name, C.shape, "expected (..., 3, 3)")
    C = per_pose(C, lead, name, (3, 3))
    least = float(np.linalg.eigvalsh(C)[..., 0].min(initial=0.0))
    if least < -1e-9 * max(float(np.abs(C).max()), 1e-300):
        message = f"{name} has the eigenvalue {least:.3g}"
        allowed = "a covariance has no negative eigenvalue"
        raise refuse(name, least, allowed, code="M34", message=message)
    return C


def jackknife(figure: Callable[[Array], Array], x: Array) -> Array:
    """Jackknife standard uncertainty (...,) of a figure of cycles x (..., n, k).

    u^2 = (n - 1)/n sum (f_j - mean f)^2 over the n figures without one cycle, or without one group.

    References
    ----------
    Efron & Stein 1981; for groups Shao & Wu 1989.
    """
    n = min(x.shape[-2], MOST_GROUPS)
    groups = np.array_split(np.arange(x.shape[-2]), n)
    without = np.stack([figure(np.delete(x, group, axis=-2)) for group in groups])
    return np.asarray(np.sqrt((n - 1) / n * ((without - without.mean(axis=0)) ** 2).sum(axis=0)))


def widest(center: Array) -> Array:
    """Largest distance (...,) between any two of the points (..., g, 3)."""
    one, other = np.triu_indices(center.shape[-2], 1)
    gaps = np.linalg.norm(center[..., one, :] - center[..., other, :], axis=-1)
    return np.asarray(gaps.max(axis=-1))


def mean_norm(covariance: Array) -> Array:
    """Mean length (...,) of zero-mean normal vectors with covariance (..., 3, 3) [m].

    E|x| = sqrt(8/pi) times the mean of sqrt(u' C u) over all directions u.
    """
    u, weight = _sphere()
    size = np.sqrt(np.maximum(np.einsum("ki,...ij,kj->...k", u, covariance, u), 0.0))
    return np.asarray(np.sqrt(8 / np.pi) * (size @ weight))


def mean_widest(covariance: Array, groups: int) -> Array:
    """Mean largest distance (...,) between `groups` normal points with covariance (..., 3, 3)."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    points = _points(groups)
    flat = root.reshape(-1, 3, 3)
    mean = [widest(points @ one.T).mean() for one in flat]
    return np.asarray(mean).reshape(covariance.shape[:-2])


def repeatability_floor(noise: Array, n: int) -> Array:
    """Mean RP (...,) of n readings that scatter with covariance (..., 3, 3) [m].

    Notes
    -----
    3.534 sigma for n = 30 and equal scatter in all directions. Distances to the barycenter have
    mean m = E|x| and variance tr C - m^2, both with C (1 - 1/n); their standard deviation is taken
    as if they were normal: within 0.2 % of simulations.
    """
    return _radius(noise * (1 - 1 / n), 3 * sd_bias(n))


def repeatability_level(noise: Array) -> Array:
    """RP (...,) in the limit of infinitely many readings with covariance (..., 3, 3) [m]."""
    return _radius(noise, 3.0)


def _radius(covariance: Array, times: float) -> Array:
    """Mean plus `times` standard deviations (...,) of the lengths of normal vectors [m]."""
    mean = mean_norm(covariance)
    variance = np.trace(covariance, axis1=-2, axis2=-1) - mean**2
    return np.asarray(mean + times * np.sqrt(np.maximum(variance, 0.0)))


def repeatability_dof(covariance: Array, n: int) -> Array:
    """Effective degrees of freedom (...,) of the RP of n readings, f = RP^2 / (2 u^2).

    u is the standard uncertainty of RP for normal readings, from the variance v, skewness g and
    kurtosis k of a distance by the delta method: n u^2 = v (1 + 9 (k - 1)/4 + 3 g). Without any
    scatter, n - 1.
    """
    mean, sd, skew, kurtosis = length_moments(covariance)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = sd**2 * (1 + 9 * (kurtosis - 1) / 4 + 3 * skew) / (mean + 3 * sd) ** 2
        return np.where(sd > 0, (n - 1) / (2 * relative), n - 1.0)


def mean_largest(dof: float, count: int) -> float:
    """Mean of the largest of `count` sample standard deviations, over the mean of a single one."""
    share = (np.arange(QUANTILES) + 0.5) / QUANTILES
    largest, one = (np.sqrt(chdtri(dof, 1 - share ** (1 / k))).mean() for k in (count, 1))
    return float(largest / one)


def length_moments(covariance: Array) -> tuple[Array, Array, Array, Array]:
    """Mean, standard deviation, skewness and kurtosis (...,) of lengths of normal vectors.

    The vectors have covariance (..., 3, 3) and are a low-discrepancy sample, which gives the first
    two within 0.5 % and the others within 3 %.
    """
    values = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    length = np.sqrt(values @ np.square(_points(1)[:, 0]).T)
    mean = length.mean(axis=-1)
    off = length - mean[..., None]
    sd = np.sqrt(np.square(off).mean(axis=-1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return mean, sd, (off**3).mean(axis=-1) / sd**3, (off**4).mean(axis=-1) / sd**4


def sd_bias(n: int) -> float:
    """c4(n): mean sample standard deviation of n normal numbers, over sigma; 0.9914 for n = 30."""
    return float(np.sqrt(2 / (n - 1)) * np.exp(gammaln(n / 2) - gammaln((n - 1) / 2)))


@lru_cache(maxsize=1)
def _sphere() -> tuple[Array, Array]:
    """Directions (k, 3) and weights (k,) that average smooth functions over the sphere."""
    z, weight = np.polynomial.legendre.leggauss(24)
    turn = 2 * np.pi * (np.arange(48) + 0.5) / 48
    ring = np.sqrt(1 - z**2)
    u = np.stack(
        [np.outer(ring, np.cos(turn)), np.outer(ring, np.sin(turn)), np.outer(z, np.ones(48))], -1
    )
    return u.reshape(-1, 3), np.repeat(weight / (2 * 48), 48)


@lru_cache(maxsize=4)
def _points(groups: int) -> Array:
    """Low-discrepancy sample (k, groups, 3) of standard normal points, the same every time."""
    n, ratio, count = 3 * groups, 2.0, 2048
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (n + 1))
    share = (0.5 + np.outer(np.arange(1, count + 1), ratio ** -np.arange(1, n + 1))) % 1.0
    return np.asarray(ndtri(share).reshape(count, groups, 3))
