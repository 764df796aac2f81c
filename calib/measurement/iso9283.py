"""Pose accuracy and repeatability of a robot after ISO 9283, each with uncertainty and noise floor.

A pose is visited in n cycles and read each time. All figures take stacks of visits (..., n, 3) and
give arrays (...,). Beside each figure stand

* its **standard uncertainty**: how far it scatters from campaign to campaign, by the jackknife over
  the cycles, and what all readings share (`common`: the instrument, where it stands);
* its **noise floor**: what it reads, on average, where there is nothing to see. Scatter alone makes
  |mean - command| larger than zero, and readings of a robot that repeats perfectly still have an
  RP. A figure near its floor means only that the truth is smaller.

Formulas follow the textbook use of the standard; its own text has not been compared.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaln

from calib.arrays import Array, frozen, require_finite, wrong_shape
from calib.errors import refuse
from calib.geometry.frames import log_so3

FEWEST = 3
"""Fewest cycles for which a scatter is stated."""


@dataclass(frozen=True, slots=True, eq=False)
class IsoFigure:
    """One figure at each pose, with its uncertainty and noise floor [m or rad]."""

    value: Array
    """(...,) the figure."""
    uncertainty: Array
    """(...,) its standard uncertainty."""
    floor: Array
    """(...,) what it reads on average where there is nothing to see; nan where that is unknown."""

    def __repr__(self) -> str:
        return f"IsoFigure({self.value.size} poses, largest {self.value.max():.4g})"


def accuracy(
    position: ArrayLike, command: ArrayLike, *, common: ArrayLike | None = None
) -> IsoFigure:
    """AP: distance from the commanded position to the barycenter of the attained ones.

    Parameters
    ----------
    position : (..., n, 3) array_like
        Attained positions, world axes [m].
    command : (..., 3) array_like
        Commanded position, world axes [m].
    common : (..., 3, 3) array_like, optional
        Covariance of the error that all readings of a pose share [m^2].

    Notes
    -----
    The floor is the mean distance of a barycenter that scatters as the cycles show it to,
    sqrt(8 / (pi n)) sigma for equal scatter in all directions.

    Examples
    --------
    >>> points = [[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 0]]
    >>> float(accuracy(points, [1, 0, 0.5]).value)
    0.5
    """
    x = cycles_of(position)
    target = per_pose(command, x.shape[:-2], "command", (3,))
    off = x.mean(axis=-2) - target
    value = np.linalg.norm(off, axis=-1)
    scatter = _covariance(x) / x.shape[-2]
    along = off / np.maximum(value, 1e-300)[..., None]
    spread = scatter + (0.0 if common is None else covariances_of(common, "common"))
    return IsoFigure(
        frozen(value),
        frozen(np.sqrt(np.einsum("...i,...ij,...j->...", along, spread, along))),
        frozen(mean_norm(scatter)),
    )


def repeatability(position: ArrayLike, *, noise: ArrayLike | None = None) -> IsoFigure:
    """RP: mean distance to the barycenter plus three standard deviations of it.

    Parameters
    ----------
    position : (..., n, 3) array_like
        Attained positions [m].
    noise : (..., 3, 3) array_like, optional
        Covariance of one reading, without the robot's own scatter [m^2]; the floor needs it.

    Examples
    --------
    >>> points = [[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 0]]
    >>> round(float(repeatability(points).value), 7)
    2.1416408
    """
    x = cycles_of(position)
    floor = np.full(x.shape[:-2], np.nan)
    if noise is not None:
        floor = np.broadcast_to(
            repeatability_floor(covariances_of(noise, "noise"), x.shape[-2]), floor.shape
        )
    return IsoFigure(frozen(_radius(x)), frozen(_jackknife(_radius, x)), frozen(floor))


def distance_accuracy(
    first: ArrayLike, second: ArrayLike, distance: ArrayLike, *, common: ArrayLike = 0.0
) -> IsoFigure:
    """AD: how far the mean distance between two poses is from the commanded one.

    Parameters
    ----------
    first, second : (..., n, 3) array_like
        Positions attained at the two poses, cycle by cycle [m].
    distance : (...,) array_like
        Commanded distance [m].
    common : (...,) array_like
        Standard uncertainty that all distances share, e.g. of the instrument's scale [m].

    Notes
    -----
    Scatter s across the line lengthens a distance D by s^2 / D on average: nanometres for a robot.
    """
    D = _distances(first, second)
    off = D.mean(axis=-1) - np.asarray(distance, dtype=np.float64)
    scatter = D.var(axis=-1, ddof=1) / D.shape[-1]
    total = np.sqrt(scatter + np.square(np.asarray(common, dtype=np.float64)))
    floor = np.sqrt(2 / np.pi * scatter)
    return IsoFigure(frozen(np.abs(off)), frozen(total), frozen(floor))


def distance_repeatability(
    first: ArrayLike, second: ArrayLike, *, noise: ArrayLike | None = None
) -> IsoFigure:
    """RD: three standard deviations of the distance between two poses.

    Parameters
    ----------
    first, second : (..., n, 3) array_like
        Positions attained at the two poses, cycle by cycle [m].
    noise : (..., 3, 3) array_like, optional
        Sum of the covariances of one reading at either pose [m^2]; the floor needs it.
    """
    D = _distances(first, second)[..., None]
    n = D.shape[-2]

    def spread(x: Array) -> Array:
        """Three standard deviations."""
        return np.asarray(3 * x[..., 0].std(axis=-1, ddof=1))

    floor = np.full(D.shape[:-2], np.nan)
    if noise is not None:
        gap = np.mean(np.asarray(second) - np.asarray(first), axis=-2)
        along = gap / np.linalg.norm(gap, axis=-1, keepdims=True)
        sd = np.sqrt(
            np.einsum("...i,...ij,...j->...", along, covariances_of(noise, "noise"), along)
        )
        floor = 3 * sd_bias(n) * sd
    return IsoFigure(frozen(spread(D)), frozen(_jackknife(spread, D)), frozen(floor))


def rotation_accuracy(
    R: ArrayLike, command: ArrayLike, *, common: ArrayLike | None = None
) -> IsoFigure:
    """AP of orientation: angle from the commanded to the mean attained rotation.

    Parameters
    ----------
    R : (..., n, 3, 3) array_like
        Attained rotations R_world_tool.
    command : (..., 3, 3) array_like
        Commanded rotation.
    common : (..., 3, 3) array_like, optional
        Covariance of the rotation error that all readings of a pose share, world axes [rad^2].

    Notes
    -----
    Rotation vectors about the commanded rotation, in world axes: no Euler angles, so nothing
    depends on how the tool stands.
    """
    about = np.asarray(command, dtype=np.float64)
    turn = log_so3(cycles_of(R, "R", (3, 3)) @ np.swapaxes(about, -1, -2)[..., None, :, :])
    return accuracy(turn, np.zeros(3), common=common)


def _radius(x: Array) -> Array:
    """RP (...,) of positions (..., n, 3)."""
    away = np.linalg.norm(x - x.mean(axis=-2, keepdims=True), axis=-1)
    return np.asarray(away.mean(axis=-1) + 3 * away.std(axis=-1, ddof=1))


def _distances(first: ArrayLike, second: ArrayLike) -> Array:
    """Distances (..., n) cycle by cycle."""
    one, other = cycles_of(first), cycles_of(second)
    if one.shape != other.shape:
        allowed = f"expected {one.shape}: the same cycles at both poses"
        raise wrong_shape("second", other.shape, allowed)
    return np.asarray(np.linalg.norm(other - one, axis=-1))


def _jackknife(figure: Callable[[Array], Array], x: Array) -> Array:
    """Standard uncertainty of a figure of cycles (..., n, k), leaving each one out.

    References
    ----------
    Efron & Stein 1981: u^2 = (n - 1)/n sum (f_j - mean f)^2.
    """
    n = x.shape[-2]
    without = np.stack([figure(np.delete(x, j, axis=-2)) for j in range(n)])
    return np.asarray(np.sqrt((n - 1) / n * ((without - without.mean(axis=0)) ** 2).sum(axis=0)))


def _covariance(x: Array) -> Array:
    """Sample covariances (..., 3, 3) of cycles (..., n, 3), n - 1."""
    d = x - x.mean(axis=-2, keepdims=True)
    return np.asarray(np.swapaxes(d, -1, -2) @ d / (x.shape[-2] - 1))


def cycles_of(values: ArrayLike, name: str = "position", tail: tuple[int, ...] = (3,)) -> Array:
    """Positions (..., n, 3), or other values of every cycle (..., n, *tail), checked."""
    x, k = np.asarray(values, dtype=np.float64), len(tail)
    if x.ndim <= k or x.shape[-k:] != tail or x.shape[-k - 1] < FEWEST:
        shape = f"(..., n, {', '.join(map(str, tail))})"
        raise wrong_shape(name, x.shape, f"{shape} with at least {FEWEST} cycles")
    require_finite(name, x)
    return x


def per_pose(values: ArrayLike, lead: tuple[int, ...], name: str, tail: tuple[int, ...]) -> Array:
    """Values that stand for every pose (..., *tail)."""
    array = np.asarray(values, dtype=np.float64)
    try:
        array = np.broadcast_to(array, (*lead, *tail))
    except ValueError:
        raise wrong_shape(name, array.shape, f"expected {(*lead, *tail)}") from None
    require_finite(name, array)
    return array


def covariances_of(values: ArrayLike, name: str) -> Array:
    """Covariances (..., 3, 3), none with a negative direction."""
    C = np.asarray(values, dtype=np.float64)
    if C.shape[-2:] != (3, 3):
        raise wrong_shape(name, C.shape, "expected (..., 3, 3)")
    require_finite(name, C)
    least = float(np.linalg.eigvalsh(C)[..., 0].min(initial=0.0))
    if least < -1e-9 * max(float(np.abs(C).max()), 1e-300):
        message = f"{name} has the eigenvalue {least:.3g}"
        allowed = "a covariance has no negative eigenvalue"
        raise refuse(name, least, allowed, code="M34", message=message)
    return C


def mean_norm(covariance: Array) -> Array:
    """Mean length (...,) of normal vectors with covariance (..., 3, 3) [m].

    E|x| = sqrt(8/pi) times the mean of sqrt(u' C u) over all directions u.
    """
    u, weight = _sphere()
    size = np.sqrt(np.maximum(np.einsum("ki,...ij,kj->...k", u, covariance, u), 0.0))
    return np.asarray(np.sqrt(8 / np.pi) * (size @ weight))


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
