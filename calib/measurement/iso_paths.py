"""Path accuracy AT and repeatability RT after ISO 9283: measured paths cut by normal planes.

A commanded path is points in order. Through each of them a plane stands across the path; where the
n measured paths pass through it they are compared, so that being early or late is no error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import refuse
from calib.measurement.cycles import cycles_of, per_pose
from calib.measurement.iso9283 import IsoFigure, accuracy, repeatability

FLIPS = 400
"""Draws of signs that tell what a path without error would read."""


@dataclass(frozen=True, slots=True, eq=False)
class PathFigures:
    """AT and RT at each of m points of a path; the standard's figures are the largest."""

    accuracy: IsoFigure
    """(m,) distance from each commanded point to the barycenter of the n paths [m]."""
    repeatability: IsoFigure
    """(m,) mean distance to the barycenter and three standard deviations [m]."""
    floor: float
    """Mean of the largest accuracy if all of it were scatter between the n paths [m]."""

    @property
    def worst(self) -> tuple[int, int]:
        """Points of the largest accuracy and the largest repeatability."""
        return int(self.accuracy.value.argmax()), int(self.repeatability.value.argmax())


def tangents(command: ArrayLike) -> Array:
    """Directions (m, 3) of a commanded path at its points (m, 3); at a corner between both sides.

    Raises
    ------
    InputError
        A3: fewer than two points, or two neighbors in one place.
    """
    (c,) = check("m 3", command=command)
    steps = np.diff(c, axis=0)
    length = np.linalg.norm(steps, axis=1)
    if not len(steps) or not length.all():
        at = int(np.argmin(length)) + 1 if len(steps) else 0
        allowed = "a path has two points or more, none at the place of the one before"
        raise refuse("command", at, allowed, code="A3", message=f"command[{at}] is no step on")
    unit = steps / length[:, None]
    both = np.concatenate([unit[:1], unit[:-1] + unit[1:], unit[-1:]])
    # where a path turns back on itself the way in counts
    size = np.linalg.norm(both, axis=1, keepdims=True)
    way_in = np.concatenate([unit[:1], unit])
    return np.where(size > 1e-6, both / np.maximum(size, 1e-12), way_in)


def through_planes(measured: ArrayLike, command: ArrayLike) -> Array:
    """Where one measured path (k, 3) passes the planes across a commanded one (m, 3): (m, 3).

    Of several passes of a plane the nearest to the commanded point counts. A path may begin late or
    end early by one step of the command: it goes on in the direction of that, as far off as it was.
    Not a number where a plane is not passed at all.
    """
    x, c = check("k 3, m 3", measured=measured, command=command)
    if len(x) < 2:
        return np.full(c.shape, np.nan)
    normal = tangents(c)
    longer = np.concatenate([[x[0] - (c[1] - c[0])], x, [x[-1] + (c[-1] - c[-2])]])
    start, step = longer[:-1], np.diff(longer, axis=0)
    found = np.full(c.shape, np.nan)
    for i, (point, across) in enumerate(zip(c, normal, strict=True)):
        before, after = (start - point) @ across, (start + step - point) @ across
        passed = np.flatnonzero((before <= 0) != (after <= 0))
        if not len(passed):
            passed = np.flatnonzero(before == 0)
            if not len(passed):
                continue
        share = before[passed] / np.where(before == after, 1.0, before - after)[passed]
        at = start[passed] + share[:, None] * step[passed]
        found[i] = at[np.linalg.norm(at - point, axis=1).argmin()]
    return found


def path_figures(
    position: ArrayLike, command: ArrayLike, *, noise: ArrayLike | None = None
) -> PathFigures:
    """AT and RT of n paths in the planes of m commanded points.

    Parameters
    ----------
    position : (m, n, 3) array_like
        Attained positions, one of each path in each plane [m].
    command : (m, 3) array_like
        Commanded points [m].
    noise : (m, 3, 3) array_like, optional
        Covariance of one reading, without the robot's own scatter [m^2]; a floor of RT needs it.

    Notes
    -----
    AT is a largest value, so scatter alone makes it grow with the number of points. Its floor keeps
    how a path's errors hang together along it: each path's way off the barycenter, with random
    signs for whole paths, is as likely where the mean is on the command.
    """
    x = cycles_of(position)
    c = per_pose(command, x.shape[:-2], "command", (3,))
    n = x.shape[-2]
    off = (x - x.mean(axis=-2, keepdims=True)) * np.sqrt(n / (n - 1))
    signs = np.random.default_rng(9283).choice([-1.0, 1.0], (FLIPS, n)) / n
    largest = [float(np.linalg.norm(one @ off, axis=-1).max()) for one in signs]
    return PathFigures(accuracy(x, c), repeatability(x, noise=noise), float(np.mean(largest)))


def resampled(paths: Sequence[ArrayLike], command: ArrayLike) -> Array:
    """Positions (m, n, 3) of n measured paths in the planes of m commanded points."""
    return frozen(np.stack([through_planes(path, command) for path in paths], axis=1))
