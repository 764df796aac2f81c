"""What the figures of ISO 9283 read where there is nothing to see: means of normal scatter."""

from functools import lru_cache

import numpy as np
from scipy.special import gammaln, ndtri

from calib.arrays import Array, Index


def widest(center: Array) -> tuple[Array, Index, Index]:
    """Largest distance (...,) among points (..., g, 3), and between which two."""
    pairs = np.triu_indices(center.shape[-2], 1)
    gaps = np.linalg.norm(center[..., pairs[0], :] - center[..., pairs[1], :], axis=-1)
    best = gaps.argmax(axis=-1)
    return gaps.max(axis=-1), pairs[0][best], pairs[1][best]


def mean_norm(covariance: Array) -> Array:
    """Mean length (...,) of normal vectors with covariance (..., 3, 3) [m].

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
    mean = [widest(points @ one.T)[0].mean() for one in flat]
    return np.asarray(mean).reshape(covariance.shape[:-2])


def repeatability_floor(noise: Array, n: int) -> Array:
    """Mean RP (...,) of n readings that scatter with covariance (..., 3, 3) [m].

    Notes
    -----
    3.534 sigma for n = 30 and equal scatter in all directions. Distances to the barycenter have
    mean m = E|x| and variance tr C - m^2, both with C (1 - 1/n); their standard deviation is taken
    as if they were normal: within 0.2 % of simulations.
    """
    shared = noise * (1 - 1 / n)
    mean = mean_norm(shared)
    variance = np.trace(shared, axis1=-2, axis2=-1) - mean**2
    return np.asarray(mean + 3 * sd_bias(n) * np.sqrt(np.maximum(variance, 0.0)))


def sd_bias(n: int) -> float:
    """c4(n): mean standard deviation of n normal numbers, over the true one; 0.9914 for 30."""
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
    """Normal points (k, groups, 3) that fill their space evenly, the same ones every time."""
    n, ratio, count = 3 * groups, 2.0, 2048
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (n + 1))
    share = (0.5 + np.outer(np.arange(1, count + 1), ratio ** -np.arange(1, n + 1))) % 1.0
    return np.asarray(ndtri(share).reshape(count, groups, 3))
