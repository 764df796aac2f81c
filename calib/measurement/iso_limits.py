"""Confidence limits of ISO 9283 figures: Student's t for accuracies, chi-square for scatters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, stdtrit

from calib.arrays import Array, frozen
from calib.measurement.cycles import cycles_of, length_moments
from calib.measurement.iso9283 import IsoFigure
from calib.measurement.iso_memory import CycleMemory, wider


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Two-sided confidence limits of figures, in the unit of the figures."""

    lower: Array
    """(...,) never below zero."""
    upper: Array
    """(...,)"""
    dof: Array
    """(...,) effective degrees of freedom."""


def mean_limits(figure: IsoFigure, dof: float, *, probability: float = 0.95) -> Limits:
    """Limits of AP, AD, vAP: the value and t times its standard uncertainty on both sides.

    Parameters
    ----------
    figure : IsoFigure
        Of n cycles.
    dof : float
        n - 1, of vAP 2 (n - 1); fewer where cycles follow their neighbors.
    probability : float
        That the limits hold the truth, where the figure is well above its floor; near the floor it
        is larger than the truth on average.
    """
    half = stdtrit(dof, (1 + probability) / 2) * figure.uncertainty
    lower = np.maximum(figure.value - half, 0.0)
    return Limits(frozen(lower), frozen(figure.value + half), _all(dof, half))


def spread_limits(
    value: ArrayLike, n: int, *, probability: float = 0.95, memory: CycleMemory | None = None
) -> Limits:
    """Limits of RD and of the RP of angles: three standard deviations of n normal numbers."""
    dof = n - 1.0 if memory is None else memory.freedom(n - 1)
    value = wider(np.asarray(value, dtype=np.float64), memory)
    return _chi_square(value, np.asarray(dof), probability)


def repeatability_limits(
    position: ArrayLike, *, probability: float = 0.95, memory: CycleMemory | None = None
) -> Limits:
    """Limits of the RP, and of the RT of one path point, that endlessly many cycles would show.

    Parameters
    ----------
    position : (..., n, 3) array_like
        Attained positions [m].
    probability : float
        That the limits hold it.
    memory : CycleMemory, optional
        Of the cycles, where they follow each other: then they count as fewer.

    Notes
    -----
    RP = m + 3 s of the distances to the barycenter scatters like a standard deviation of f degrees
    of freedom, f = RP^2 / (2 u^2). For normal readings u follows from the moments of a distance, by
    the delta method: n u^2 = v (1 + 9 (k - 1)/4 + 3 g), v, g, k its variance, skewness and
    kurtosis; f is about 2 n for equal scatter in all directions, n - 1 where all of it is along one
    line. The barycenter is nearer to n readings than the true mean by sqrt(1 - 1/n).

    References
    ----------
    Satterthwaite 1946, for the degrees of freedom.
    """
    x = cycles_of(position)
    n = x.shape[-2]
    d = x - x.mean(axis=-2, keepdims=True)
    away = np.linalg.norm(d, axis=-1)
    value = away.mean(axis=-1) + 3 * away.std(axis=-1, ddof=1)
    mean, sd, skew, kurtosis = length_moments(np.swapaxes(d, -1, -2) @ d / (n - 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = sd**2 * (1 + 9 * (kurtosis - 1) / 4 + 3 * skew) / (mean + 3 * sd) ** 2
        dof = np.where(sd > 0, (n - 1) / (2 * relative), n - 1.0)
    if memory is not None:
        dof = np.maximum(dof * memory.freedom(n - 1) / (n - 1), 1.0)
    return _chi_square(wider(value * np.sqrt(n / (n - 1)), memory), dof, probability)


def _chi_square(value: Array, dof: Array, probability: float) -> Limits:
    """Limits of a standard deviation, or of what scatters like one."""
    lower, upper = (
        value * np.sqrt(dof / chdtri(dof, (1 + side * probability) / 2)) for side in (-1, 1)
    )
    return Limits(frozen(lower), frozen(upper), _all(dof, value))


def _all(dof: ArrayLike, like: Array) -> Array:
    """Degrees of freedom for each figure."""
    return frozen(np.broadcast_to(np.asarray(dof, dtype=np.float64), like.shape).copy())
