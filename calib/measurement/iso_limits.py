"""Confidence limits of ISO 9283 figures: Student's t for accuracies, chi-square for scatters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, fdtri, stdtrit

from calib.arrays import (
    Array,
    frozen,
    require_count,
    require_finite,
    require_numbers,
    require_probability,
)
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.measurement.cycles import cycles_of, repeatability_dof
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


@checked_kinds
def mean_limits(figure: IsoFigure, dof: float, *, probability: float = 0.95) -> Limits:
    """Limits of AP, vAP and of each point of a path: t times the standard uncertainty, and room.

    Parameters
    ----------
    figure : IsoFigure
        Of n cycles.
    dof : float
        n - 1, of vAP 2 (n - 1); fewer where cycles follow their neighbors.
    probability : float
        That the limits hold the truth.

    Notes
    -----
    Scatter across a length makes it longer, and near its floor it is little else. So the lower
    limit is lower than value - t u =: w, by as much as makes it zero at r, which so much scatter
    about zero exceeds with probability (1 - p)/2: sqrt(w^2 - (r - t u)^2), where r^2 is the smaller
    of F(f, dof) tr C, f the directions of the covariance C (Satterthwaite), and 3 F(3, dof) u^2,
    which no more than that exceed whatever C is. At zero it is exact
    for equal scatter, far away it is Student's; between, at 95 %, it is 0.07 u higher at most than
    the limit that holds exactly so often. The upper limit is safe near the floor without room; it
    is the length of the likeliest vector whose part along the measured one is value + t u, which
    lies beside that one where scatter is not equal in all directions.
    """
    single = (1 + require_probability(probability)) / 2
    require_freedom(dof)
    half = stdtrit(dof, single) * figure.uncertainty
    lower = np.maximum(figure.value - half, 0.0)
    if figure.around is not None and figure.directions is not None:
        reach = figure.around * np.sqrt(fdtri(figure.directions, dof, single))
        # along a direction of little scatter (x'x)^2 / x'Cx, which x' inv(C) x bounds: Hotelling
        reach = np.minimum(reach, figure.uncertainty * np.sqrt(3 * fdtri(3, dof, single)))
        room = np.maximum(reach - half, 0.0)
        lower = np.sqrt(np.maximum(lower**2 - room**2, 0.0))
    upper = figure.value + half
    if figure.sideways is not None:
        upper = np.hypot(upper, stdtrit(dof, single) * figure.sideways)
    return Limits(frozen(lower), frozen(upper), _all(dof, half))


@checked_kinds
def largest_limits(figure: IsoFigure, dof: float, *, probability: float = 0.95) -> Limits:
    """Limits of the largest of figures (..., k), which chance has chosen.

    Each of k lower limits holds with 1 - (1 - p)/k, so that the largest of them is one of the
    largest figure; the largest upper limit holds it as any one does: it is no smaller than that
    of its place.
    """
    single = 1 - (1 - require_probability(probability)) / figure.value.shape[-1]
    low = mean_limits(figure, dof, probability=single)
    high = mean_limits(figure, dof, probability=probability)
    return Limits(*(frozen(x.max(axis=-1)) for x in (low.lower, high.upper, high.dof)))


@checked_kinds
def spread_limits(
    value: ArrayLike, n: int, *, probability: float = 0.95, memory: CycleMemory | None = None
) -> Limits:
    """Limits of RD and of the RP of angles: three standard deviations of n normal numbers."""
    n, value = require_count("n", n, 2), require_numbers("value", value)
    require_finite("value", value)
    if (value < 0).any():
        raise refuse("value", float(value.min()), "zero or more: it is a scatter", code="A3")
    dof = n - 1.0 if memory is None else memory.freedom(n - 1)
    value = wider(value, memory)
    return _chi_square(value, np.asarray(dof), probability)


@checked_kinds
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
    RP = m + 3 s of the distances to the barycenter scatters like a standard deviation of
    `repeatability_dof` degrees of freedom: about 2 n for equal scatter in all directions, n - 1
    where all of it is along one line. The barycenter is nearer to n readings than the true mean by
    sqrt(1 - 1/n).

    References
    ----------
    Satterthwaite 1946, for the degrees of freedom.
    """
    x = cycles_of(position)
    n = x.shape[-2]
    d = x - x.mean(axis=-2, keepdims=True)
    away = np.linalg.norm(d, axis=-1)
    value = away.mean(axis=-1) + 3 * away.std(axis=-1, ddof=1)
    dof = repeatability_dof(np.swapaxes(d, -1, -2) @ d / (n - 1), n)
    if memory is not None:
        dof = np.maximum(dof * memory.freedom(n - 1) / (n - 1), 1.0)
    return _chi_square(wider(value * np.sqrt(n / (n - 1)), memory), dof, probability)


def _chi_square(value: Array, dof: Array, probability: float) -> Limits:
    """Limits of a standard deviation, or of what scatters like one."""
    require_probability(probability)
    lower, upper = (
        value * np.sqrt(dof / chdtri(dof, (1 + side * probability) / 2)) for side in (-1, 1)
    )
    return Limits(frozen(lower), frozen(upper), _all(dof, value))


def require_freedom(dof: float) -> None:
    """Refuse degrees of freedom that are none."""
    if not dof > 0:
        raise refuse("dof", dof, "above zero: of n cycles n - 1", code="A3")


def _all(dof: ArrayLike, like: Array) -> Array:
    """Degrees of freedom for each figure."""
    return frozen(np.broadcast_to(np.asarray(dof, dtype=np.float64), like.shape).copy())
