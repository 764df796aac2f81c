"""Path accuracy AT and repeatability RT after ISO 9283: measured paths cut by normal planes.

A commanded path is points in order. Through each of them a plane stands across the path; where the
n measured paths pass through it, in the order of the command, they are compared, so that being
early or late is no error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, check, frozen, require_count
from calib.errors import refuse
from calib.kinds import checked_kinds, in_short
from calib.measurement.cycles import cycles_of, mean_largest, per_pose, repeatability_dof
from calib.measurement.iso9283 import IsoFigure, accuracy, repeatability
from calib.measurement.iso_bends import corners, inside, turns_back, with_corners

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
    spread_floor: float
    """Mean of the largest repeatability if all of it were the stated noise; nan without one [m]."""

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
    way_in = np.concatenate([unit[:1], unit])
    size = np.linalg.norm(both, axis=1, keepdims=True)
    return np.where(turns_back(c)[:, None], way_in, both / np.maximum(size, 1e-12))


def through_planes(measured: ArrayLike, command: ArrayLike, *, sharp: bool = False) -> Array:
    """Where one measured path (k, 3) passes the planes across a commanded one (m, 3): (m, 3).

    Planes are passed in the order of the command, so that a path may come by one place twice; of
    the passes that follow each other so, those count that are nearest to the commanded points. Of
    those of a tool that stands or creeps, which noise moves through a plane again and again without
    half a step away from it, the middle one counts: the nearest would be nearer than the tool is.
    Between two readings a path bends, and turns, as its command does there, so that neither few
    readings nor some that are lost cut its bends and corners. A path may begin late or end early by
    one step of the command: it goes on in the direction of that, as far off as it was. By all but a
    twentieth of one it may turn back early where the command does. Not a number where a plane is
    not passed in its turn. With `sharp` it rounds no corner between two readings, whatever they
    show.
    """
    x, c = check("k 3, m 3", measured=measured, command=command)
    if len(x) < 2:
        return np.full(c.shape, np.nan)
    normal = tangents(c)
    longer = np.concatenate([[x[0] - (c[1] - c[0])], x, [x[-1] + (c[-1] - c[-2])]])
    found, when = _passed(longer, c, normal)
    if corners(c).any():
        longer = with_corners(longer, c, when, sharp=sharp)
        found, when = _passed(longer, c, normal)
    return found - inside(c, normal, longer, np.nan_to_num(when))


def _passed(longer: Array, c: Array, normal: Array) -> tuple[Array, Array]:
    """Where (m, 3) and when (m,) straight lines pass the planes; not a number where they do not."""
    steps, back = np.linalg.norm(np.diff(c, axis=0), axis=1), turns_back(c)
    shorter = np.minimum(np.append(steps[:1], steps), np.append(steps, steps[-1:]))
    beside = np.convolve(back, [1, 0, 1], "same") > 0
    near = np.where(back, 0.0, shorter / np.where(beside, 20, 2))
    passes = [_passes(longer, *one) for one in zip(c, normal, near, strict=True)]
    for i in np.flatnonzero(back):
        step = float(steps[i - 1])
        passes[i] = passes[i].beside(_short_of(longer, c[i], normal[i], step))
    found, when = np.full(c.shape, np.nan), np.full(len(c), np.nan)
    chosen = nearest_in_order([one.when for one in passes], [one.distance for one in passes])
    for i in np.flatnonzero(chosen >= 0):
        found[i], when[i] = passes[i].place[chosen[i]], passes[i].when[chosen[i]]
    return found, when


@dataclass(frozen=True, slots=True, eq=False)
class _Passes:
    """Where a measured path passes the plane across one point."""

    when: Array
    """(p,) reading, and part of the way to the next one."""
    place: Array
    """(p, 3) [m]."""
    distance: Array
    """(p,) from the commanded point [m]."""

    def beside(self, other: "_Passes") -> "_Passes":
        """Both."""
        return _Passes(
            np.concatenate([self.when, other.when]),
            np.concatenate([self.place, other.place]),
            np.concatenate([self.distance, other.distance]),
        )


def _passes(longer: Array, point: Array, across: Array, near: float) -> _Passes:
    """Passes of a path (k, 3) through the plane across one commanded point (3,)."""
    start, step = longer[:-1], np.diff(longer, axis=0)
    ahead = (longer - point) @ across
    before, after = ahead[:-1], ahead[1:]
    passed = np.flatnonzero((before <= 0) != (after <= 0))
    if len(passed) > 1:
        # how far the path goes between each pass and the next one
        farthest = np.maximum.reduceat(np.abs(ahead), passed + 1)[:-1]
        groups = np.split(passed, np.flatnonzero(farthest >= near) + 1)
        passed = np.array([group[len(group) // 2] for group in groups])
    if not len(passed):
        passed = np.flatnonzero(before == 0)
    share = before[passed] / np.where(before == after, 1.0, before - after)[passed]
    at = start[passed] + share[:, None] * step[passed]
    return _Passes(passed + share, at, np.linalg.norm(at - point, axis=1))


def _short_of(longer: Array, point: Array, across: Array, step: float) -> _Passes:
    """Readings less than a step short of a plane before which a path turns back, put into it."""
    ahead = (longer - point) @ across
    own, before, after = ahead[1:-1], ahead[:-2], ahead[2:]
    last = np.flatnonzero((own >= before) & (own >= after) & (own <= 0) & (own > -step)) + 1
    at = longer[last] - ahead[last, None] * across
    return _Passes(last.astype(np.float64), at, np.linalg.norm(longer[last] - point, axis=1))


def nearest_in_order(when: Sequence[Array], distance: Sequence[Array]) -> Index:
    """Which pass of each of m planes: as many planes as can be, none before the one ahead of it.

    Parameters
    ----------
    when, distance : sequences of m arrays (p,)
        When each plane is passed, and how far from its point.

    Returns
    -------
    (m,) array
        Index of the pass, -1 for none. The sum of the distances is the smallest one.
    """
    nearest = np.array([one.argmin() if len(one) else -1 for one in distance], dtype=np.int64)
    own = [one[k] for one, k in zip(when, nearest, strict=True) if k >= 0]
    if (np.diff(own) >= 0).all():
        return nearest
    # more than all distances together: one plane more always counts
    skipped = 1.0 + 2.0 * sum(float(one.max()) for one in distance if len(one))
    # of the choices so far: when the last one passed, what it cost, and its number; a later one is
    # kept only if it costs less, so the last of those that were in time is the cheapest
    last, cost, number = np.array([-np.inf]), np.zeros(1), np.array([-1])
    firsts, before, count = list[int](), list[Index](), 0
    for passed, away in zip(when, distance, strict=True):
        follows = np.searchsorted(last, passed, side="right") - 1
        firsts.append(count)
        before.append(number[follows])
        last = np.concatenate([last, passed])
        cost = np.concatenate([cost + skipped, cost[follows] + away])
        number = np.concatenate([number, count + np.arange(len(passed))])
        count += len(passed)
        order = np.lexsort((cost, last))
        last, cost, number = last[order], cost[order], number[order]
        least = np.minimum.accumulate(cost)
        keep = np.concatenate([[True], cost[1:] < least[:-1]])
        last, cost, number = last[keep], cost[keep], number[keep]
    chosen, at = np.full(len(when), -1), int(number[-1])
    for i in range(len(when))[::-1]:
        if at >= firsts[i]:
            chosen[i] = at - firsts[i]
            at = int(before[i][chosen[i]])
    return chosen


@checked_kinds
def path_figures(
    position: ArrayLike,
    command: ArrayLike,
    *,
    noise: ArrayLike | None = None,
    readings: int | None = None,
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
        Along the path it moves no place in a plane.
    readings : int, optional
        Of one run, where they are fewer than points: no more of these have noise of their own.

    Notes
    -----
    RT is the largest of many, too: its floor is that of so many points with noise of their own.
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
    floor, spread_floor = float(np.mean(largest)), float("nan")
    if noise is not None:
        noise = in_planes(per_pose(noise, x.shape[:-2], "noise", (3, 3)), c)
    found = repeatability(x, noise=noise)
    if noise is not None:
        worst = int(found.floor.argmax())
        count = min(len(x), len(x) if readings is None else require_count("readings", readings))
        one = float(repeatability_dof(noise[worst], n))
        spread_floor = float(found.floor[worst]) * mean_largest(one, count)
    return PathFigures(accuracy(x, c), found, floor, spread_floor)


def in_planes(covariance: Array, command: Array) -> Array:
    """What covariances of readings (m, 3, 3) are in the planes across a commanded path (m, 3)."""
    along = tangents(command)
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    return np.asarray(across @ covariance @ across)


@checked_kinds
@in_short
def resampled(paths: Sequence[ArrayLike], command: ArrayLike, *, sharp: bool = False) -> Array:
    """Positions (m, n, 3) [m] of n measured paths (k, 3) in the planes of m commanded points.

    With `sharp` no corner is rounded between two readings: the least that a path may be off there.
    """
    found = [through_planes(path, command, sharp=sharp) for path in paths]
    return frozen(np.stack(found, axis=1))
