"""Position accuracy and repeatability after ISO 9283, each with uncertainty and noise floor.

A pose is visited in n cycles and read each time. All figures take stacks of visits (..., n, 3) and
give arrays (...,). Beside each figure stand

* its **standard uncertainty**: how far it scatters from campaign to campaign, by the jackknife over
  the cycles, and what all readings share (`common`: the instrument, where it stands);
* its **noise floor**: what it reads, on average, where there is nothing to see. Scatter alone makes
  |mean - command| larger than zero, and readings of a robot that repeats perfectly still have an
  RP. A figure near its floor means only that the truth is smaller.

Formulas follow the textbook use of the standard; its own text has not been compared.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, frozen, wrong_shape
from calib.errors import refuse
from calib.kinds import in_short
from calib.measurement.cycles import (
    covariances_of,
    cycles_of,
    jackknife,
    mean_norm,
    mean_widest,
    per_pose,
    repeatability_floor,
    sd_bias,
)
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class IsoFigure(Shown):
    """One figure at each pose, with its uncertainty and noise floor [m or rad]."""

    value: Array
    """(...,) the figure."""
    uncertainty: Array
    """(...,) its standard uncertainty."""
    floor: Array
    """(...,) what it reads on average where there is nothing to see; nan where that is unknown."""
    around: Array | None = None
    """(...,) of a length: root of the variance in all directions together; None of a scatter."""
    directions: Array | None = None
    """(...,) in how many directions that variance is, 1 to 3; None of a scatter."""
    sideways: Array | None = None
    """(...,) by how much what is u longer lies beside its direction too; None of a scatter."""

    def __repr__(self) -> str:
        return f"IsoFigure({self.value.size} poses, largest {self.value.max(initial=0.0):.4g})"

    @property
    def largest(self) -> "IsoFigure":
        """The largest one along the last axis."""
        at = self.value.argmax(axis=-1)[..., None]

        def taken(x: Array) -> Array:
            """Of one column."""
            return frozen(np.take_along_axis(x, at, axis=-1)[..., 0])

        return IsoFigure(
            taken(self.value), taken(self.uncertainty), taken(self.floor),
            None if self.around is None else taken(self.around),
            None if self.directions is None else taken(self.directions),
            None if self.sideways is None else taken(self.sideways),
        )  # fmt: skip


@in_short
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
    scatter = _covariance(x) / x.shape[-2]
    spread = scatter + (0.0 if common is None else covariances_of(common, "common", x.shape[:-2]))
    return _length(off, spread, mean_norm(scatter))


@in_short
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
        floor = repeatability_floor(covariances_of(noise, "noise", x.shape[:-2]), x.shape[-2])
    return IsoFigure(frozen(_radius(x)), frozen(jackknife(_radius, x)), frozen(floor))


@in_short
def approaches(position: ArrayLike) -> IsoFigure:
    """vAP: largest distance between the barycenters of visits from several directions.

    Parameters
    ----------
    position : (..., g, n, 3) array_like
        Attained positions from each of g directions of approach, usually three [m].
    """
    return gaps(position).largest


@in_short
def gaps(position: ArrayLike) -> IsoFigure:
    """Distances (..., k) [m] between the barycenters of every two directions of approach.

    Their floor is that of the largest of them, vAP, whose limits need them all.
    """
    x = cycles_of(position)
    if x.ndim < 3 or x.shape[-3] < 2:
        allowed = "(..., g, n, 3) with at least two directions of approach"
        raise wrong_shape("position", x.shape, allowed)
    center = x.mean(axis=-2)
    scatter = _covariance(x) / x.shape[-2]
    one, other = np.triu_indices(x.shape[-3], 1)
    floor = mean_widest(scatter.mean(axis=-3), x.shape[-3])[..., None]
    return _length(
        center[..., one, :] - center[..., other, :],
        scatter[..., one, :, :] + scatter[..., other, :, :],
        np.broadcast_to(floor, (*floor.shape[:-1], len(one))),
    )


@in_short
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
    off = D.mean(axis=-1) - per_pose(distance, D.shape[:-1], "distance", ())
    shared = per_pose(common, D.shape[:-1], "common", ())
    if (shared < 0).any():
        raise refuse("common", float(shared.min()), "zero or more", code="A3")
    scatter = D.var(axis=-1, ddof=1) / D.shape[-1]
    total = np.sqrt(scatter + np.square(shared))
    floor = np.sqrt(2 / np.pi * scatter)
    return IsoFigure(frozen(np.abs(off)), frozen(total), frozen(floor))


@in_short
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
        size = np.linalg.norm(gap, axis=-1)
        along = gap / np.where(size > 0, size, 1.0)[..., None]
        C = covariances_of(noise, "noise", size.shape)
        sd = np.sqrt(np.einsum("...i,...ij,...j->...", along, C, along))
        # two poses at one place have no line between them
        floor = np.where(size > 0, 3 * sd_bias(n) * sd, np.nan)
    return IsoFigure(frozen(spread(D)), frozen(jackknife(spread, D)), frozen(floor))


def _radius(x: Array) -> Array:
    """RP (...,) of positions (..., n, 3)."""
    away = np.linalg.norm(x - x.mean(axis=-2, keepdims=True), axis=-1)
    return np.asarray(away.mean(axis=-1) + 3 * away.std(axis=-1, ddof=1))


def _length(off: Array, covariance: Array, floor: Array) -> IsoFigure:
    """Length of vectors (..., 3) that scatter with covariance (..., 3, 3)."""
    value = np.linalg.norm(off, axis=-1)
    along = off / np.maximum(value, 1e-300)[..., None]
    C_along = np.einsum("...ij,...j->...i", covariance, along)
    u = np.sqrt(np.maximum((along * C_along).sum(axis=-1), 0.0))
    # likeliest place of what is u longer: off + C_along / u
    square = np.square(C_along).sum(axis=-1) / np.where(u > 0, u, 1.0) ** 2 - u**2
    sideways = np.sqrt(np.where(u > 0, np.maximum(square, 0.0), 0.0))
    trace = np.trace(covariance, axis1=-2, axis2=-1)
    square = np.square(covariance).sum(axis=(-2, -1))
    # Satterthwaite: of k equal directions k
    directions = np.where(square > 0, trace**2 / np.where(square > 0, square, 1.0), 1.0)
    return IsoFigure(
        frozen(value), frozen(u), frozen(floor), frozen(np.sqrt(trace)), frozen(directions),
        frozen(sideways),
    )  # fmt: skip


def _distances(first: ArrayLike, second: ArrayLike) -> Array:
    """Distances (..., n) cycle by cycle."""
    one, other = cycles_of(first), cycles_of(second)
    if one.shape != other.shape:
        allowed = f"expected {one.shape}: the same cycles at both poses"
        raise wrong_shape("second", other.shape, allowed)
    return np.asarray(np.linalg.norm(other - one, axis=-1))


def _covariance(x: Array) -> Array:
    """Sample covariances (..., 3, 3) of cycles (..., n, 3), n - 1."""
    d = x - x.mean(axis=-2, keepdims=True)
    return np.asarray(np.swapaxes(d, -1, -2) @ d / (x.shape[-2] - 1))
