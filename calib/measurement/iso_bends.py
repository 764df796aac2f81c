"""How a measured path goes on between two of its readings: it bends and turns as its command does.

Straight lines between readings lie inside the bends and corners of a path, by much more than a
robot is off where readings are millimeters apart.
"""

import numpy as np

from calib.arrays import Array, Bool

BACK = 0.02
"""Angle from a full turn within which a path turns back [rad]; commands are rounded."""
CORNER = 0.7
"""Turn between two parts of a command beyond which it is a corner [rad]."""
LOST = 10.0
"""Times the usual distance of readings beyond which some are lost."""
ROUND = 0.025
"""Part of a corner's turn that a path has made, or still has to make, beyond the two readings
around it, from which on it is seen to be rounded: 2 degrees of 90, 25 um in a millimeter."""


def turns_back(command: Array) -> Bool:
    """At which of its points a commanded path (m, 3) turns back on itself."""
    unit = units(command)
    back = np.linalg.norm(unit[:-1] + unit[1:], axis=1) < BACK
    return np.concatenate([[False], back, [False]])


def units(path: Array) -> Array:
    """Directions (m - 1, 3) of the steps of a path (m, 3); zero of no step."""
    steps = np.diff(path, axis=0)
    return np.asarray(steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300))


def corners(command: Array) -> Bool:
    """At which of its points a commanded path (m, 3) has a corner."""
    turn = np.linalg.norm(np.diff(units(command), axis=0), axis=1)
    return np.concatenate([[False], turn >= CORNER, [False]])


def with_corners(path: Array, command: Array, when: Array, *, sharp: bool = False) -> Array:
    """A measured path (k, 3) and the corners (k + c, 3) that lie between two of its readings.

    Parameters
    ----------
    path : (k, 3) array
        With what it is thought to go on by before its first and after its last reading.
    command : (m, 3) array
    when : (m,) array
        Reading, and part of the way to the next one, at which the plane across each commanded point
        is passed; not a number where it is not.
    sharp : bool
        Round no corner, whatever the path shows: then it cuts none that a reading does not cut.

    Notes
    -----
    Either side of the corner goes on as its command does, as far beside it as the reading there is.
    Where the path is seen to have turned before, or to turn after that, it is rounded: then it
    bends evenly, as far as its own directions before and after tell. What it does within the
    distance of two readings nothing tells: rounded more sharply than that, it is read as sharp.
    """
    added: dict[int, Array] = {}
    unit = units(command)
    for i in np.flatnonzero(corners(command) & ~turns_back(command) & np.isfinite(when)):
        before = int(when[i])
        # where the path is off along its command the corner may lie beyond the plane's line
        near = [k for k in (before - 1, before, before + 1) if 1 <= k < len(path) - 2]
        found = [
            (*_between(path, k, command[i], unit[i - 1], unit[i], sharp=sharp), k) for k in near
        ]
        size, point, k = max(found, key=lambda one: one[0], default=(0.0, command[i], 0))
        if size:
            added.setdefault(k, point)
    lines = sorted(added)
    if not lines:
        return path
    return np.insert(path, np.array(lines) + 1, np.array([added[k] for k in lines]), axis=0)


def _between(
    path: Array, k: int, corner: Array, come: Array, go: Array, *, sharp: bool
) -> tuple[float, Array]:
    """How far outside a path bends between reading k and the next one, and where; zero: not.

    The commanded path comes to its corner and goes from there in the directions (3,).
    """
    one, two = path[k], path[k + 1]
    across = [np.eye(3) - np.outer(way, way) for way in (come, go)]
    # of all corners beside the commanded one that whose sides are nearest to both readings
    beside = across[0] @ (one - corner) + across[1] @ (two - corner)
    point = corner + np.linalg.solve(across[0] + across[1], beside)
    if (point - one) @ come <= 0 or (two - point) @ go <= 0:
        return 0.0, point
    line = two - one
    size = float(np.linalg.norm(line))
    before, after = _way(path[k::-1], size, -come), _way(path[k + 1 :], size, go)
    inward = (go - come) / np.linalg.norm(go - come)
    turned = (-before - come) @ inward, (go - after) @ inward
    if not sharp and max(turned) > ROUND * np.linalg.norm(go - come):
        # an arc of this turn, L/16 of which its middle lies outside of the line
        point = (one + two) / 2 + size / 16 * (-before - after)
    off = point - one
    return float(np.linalg.norm(off - (off @ line) / size**2 * line)), point


def _way(path: Array, size: float, otherwise: Array) -> Array:
    """Direction (3,) in which a path (k, 3) leaves its first point, over so much of its length."""
    away = np.linalg.norm(path - path[0], axis=1)
    far = int(np.argmax(away >= size))
    # the last one is no reading
    if not away[far] >= size or far == len(path) - 1:
        return otherwise
    share = (size - away[far - 1]) / (away[far] - away[far - 1])
    way = path[far - 1] + share * (path[far] - path[far - 1]) - path[0]
    return np.asarray(way / np.linalg.norm(way))


def inside(command: Array, normal: Array, longer: Array, when: Array) -> Array:
    """How far inside a bend (m, 3) a straight line between two readings lies.

    Before the first and after the last of them it lies as far outside. A measured path bends as its
    command does: k (1 - k) L^2 / 2 times that, k the part of a line of length L. The bend is that
    of points as far apart as the readings, on one side of a corner. Not a number where so many
    readings are lost that the command turns like a corner meanwhile.
    """
    before = np.minimum(when.astype(np.int64), len(longer) - 2)
    share, line = when - before, np.linalg.norm(np.diff(longer, axis=0), axis=1)[before]
    outside = (before == 0) | (before == len(longer) - 2)
    size = np.where(outside, -0.5, 0.5) * share * (1 - share) * line**2
    bend, corner = _bend(command, normal, line)
    lost = corner & ~outside & (line > LOST * np.median(line))
    return np.where(lost[:, None], np.nan, size[:, None] * bend)


def _bend(command: Array, normal: Array, size: Array) -> tuple[Array, Bool]:
    """Curvature (m, 3) of a command in the planes across it, over so much of its length [1/m].

    Zero at corners, which (m,) is returned, too.
    """
    if len(command) < 3:
        return np.zeros(command.shape), np.zeros(len(command), dtype=bool)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(command, axis=0), axis=1))])
    middle = np.clip(np.arange(len(command)), 1, len(command) - 2)
    room = 1e-9 * along[-1]
    first = np.searchsorted(along, along[middle] - size + room, side="right") - 1
    last = np.searchsorted(along, along[middle] + size - room)
    # not beyond the corners before and after
    ends = np.concatenate([[0], np.flatnonzero(corners(command)), [len(command) - 1]])
    first = np.maximum(first, ends[np.searchsorted(ends, middle, side="left") - 1])
    last = np.minimum(last, ends[np.searchsorted(ends, middle, side="right")])
    first, last = np.clip(first, 0, middle - 1), np.clip(last, middle + 1, len(command) - 1)
    ways = command[middle] - command[first], command[last] - command[middle]
    length = [np.linalg.norm(way, axis=1)[:, None] for way in ways]
    unit = [way / np.maximum(one, 1e-300) for way, one in zip(ways, length, strict=True)]
    turn = unit[1] - unit[0]
    corner = np.linalg.norm(turn, axis=1) >= CORNER
    bend = np.where(corner[:, None], 0.0, 2 * turn / np.maximum(length[0] + length[1], 1e-300))
    return np.asarray(bend - (bend * normal).sum(axis=1)[:, None] * normal), corner
