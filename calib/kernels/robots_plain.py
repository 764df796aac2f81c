"""Whitened residuals and columns of many robots, each with its own geometry, in numpy.

Arrays have components first, then robots, then poses, so that every operation covers all robots of
a block and all their poses in contiguous memory.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from calib.arrays import Array, Bool, Index

Link: TypeAlias = tuple[Array, ...]
"""Cosine and sine of the turn, slide and length a [m], cosine and sine of alpha and of beta, each
(R or 1, m or 1); the first three include theta and d of the link."""
Made: TypeAlias = tuple[int, Sequence[tuple[int, Array]]]
"""A row of J that is a weighted sum of others: its place, then theirs with weights (R or 1, m)."""
SMALL = 1e-4
"""Sine of an angle below which two terms of the arc sine's series are exact."""

ALL = np.ones((3, 3), dtype=bool)


def system(
    links: Sequence[Link], base: Array, tool: Array, place: Index, made: Sequence[Made],
    target: Array, seen: Array, whitening: Array, used: Bool, logarithm: bool,
    J: Array, r: Array, point: Array,
) -> None:  # fmt: skip
    """Fill columns, residuals and predicted points of R robots at m poses each.

    Parameters
    ----------
    links : sequence of Link
        The n links from the base on.
    base, tool : (R, 3, 4) array
        Rotation and origin of base in world and tool in flange [m].
    place : (12 + 5 n,) array of int
        Row of J for each number of base, links and tool; -1 for none.
    made : sequence of Made
        All other rows of J.
    target : (3,) array
        The point that is predicted, in the tool frame; its origin if poses are measured [m].
    seen : (12, R, m) array
        Position measured [m], then the rotation row by row.
    whitening : (6, 6, R or 1, m) array
        Lower triangles N by which residual and columns are multiplied.
    used : (6, 6) array of bool
        Which entries of N are nonzero anywhere.
    logarithm : bool
        If true the rotation residual is Log(R_seen R'); else it is half the sum of axis x measured
        axis, with the rotation itself as its derivative, which is equivalent to the paper's twelve
        rows.
    J : (R, f, 6 or 3, m) array
        Receives N times the derivative of the prediction. With 3 it receives position rows alone,
        not whitened, and no residual is computed.
    r : (6, R, m) array
        Receives N times measured minus predicted.
    point : (3, R, m) array
        Receives predicted points [m].

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144).
    """
    whole = J.shape[2] == 6
    screws, (x, y, z, p) = _screws(links, base)
    held = [
        tool[:, 0, k, None] * x + tool[:, 1, k, None] * y + tool[:, 2, k, None] * z
        for k in range(4)
    ]
    origin = p + held[3]
    point[:] = origin + sum(target[k] * held[k] for k in range(3)) if target.any() else origin
    # the tool slides along its own axes, and turns about its own origin
    screws += [(axis, foot) for foot in (None, origin) for axis in held[:3]]
    kept = [(to, *screw) for to, screw in zip(place, screws, strict=True) if to >= 0]
    sliding = [(to, axis) for to, axis, foot in kept if foot is None]
    turning = [(to, axis, foot) for to, axis, foot in kept if foot is not None]
    slid, axes, arms = (np.empty((len(some), *point.shape)) for some in (sliding, turning, turning))
    for k, (_, axis) in enumerate(sliding):
        slid[k] = axis
    for k, (_, axis, foot) in enumerate(turning):
        axes[k] = axis
        np.subtract(point, foot, out=arms[k])
    swung = _cross(axes, arms)
    if whole:
        N, turned, r[:] = residual(np.stack(held[:3]), point, seen, whitening, used, logarithm)
        axes, below = _times(turned, ALL, axes), None
        if used[3:, :3].any():
            below = _times(N[3:, :3], used[3:, :3], slid)
            axes += _times(N[3:, :3], used[3:, :3], swung)
        slid, swung = (_times(N[:3, :3], used[:3, :3], part) for part in (slid, swung))
    for k, (to, _) in enumerate(sliding):
        J[:, to, :3] = slid[k].swapaxes(0, 1)
        if whole:
            J[:, to, 3:] = 0.0 if below is None else below[k].swapaxes(0, 1)
    for k, (to, _, _) in enumerate(turning):
        J[:, to, :3] = swung[k].swapaxes(0, 1)
        if whole:
            J[:, to, 3:] = axes[k].swapaxes(0, 1)
    for to, ((own, values), *more) in made:
        np.multiply(J[:, own], values[:, None], out=J[:, to])
        for own, values in more:
            J[:, to] += J[:, own] * values[:, None]


def residual(
    axes: Array, origin: Array, seen: Array, whitening: Array, used: Bool, logarithm: bool
) -> tuple[Array, Array, Array]:
    """Whitened residual, and the matrices that whiten its columns.

    Parameters
    ----------
    axes : (3, 3, R, m) array
        Predicted x, y and z of the tool in turn.
    origin : (3, R, m) array
        Predicted tool origins [m].
    seen, whitening, used, logarithm
        As in `system`.

    Returns
    -------
    N : (6, 6, R, m) array
        The whitening of all robots.
    turned : (3, 3, R, m) array
        Its rotation block times the derivative of the rotation residual by a rotation of the tool.
    r : (6, R, m) array
        N times measured minus predicted.
    """
    there = seen[3:].reshape(3, 3, *seen.shape[1:])  # row, column
    e = np.asarray(0.5 * _cross(axes, there.swapaxes(0, 1)).sum(axis=0))
    N = np.broadcast_to(whitening, (6, 6, *origin.shape[1:]))
    turned = N[3:, 3:]
    if logarithm:
        square = (e * e).sum(axis=0)
        sine = np.sqrt(square)
        small = sine < SMALL
        angle = np.arcsin(np.minimum(sine, 1.0))
        e *= np.where(small, 1 + square / 6, angle / np.where(small, 1.0, sine))
        turned = _times_jacobian(turned, e)
    return N, turned, _times(N, used, np.concatenate([seen[:3] - origin, e])[None])[0]


Screw = tuple[Array, Array | None]
"""An axis (3, R, m or 1), and a point on it (3, R, m or 1) if it turns; None if it slides."""


def _screws(
    links: Sequence[Link], base: Array
) -> tuple[list[Screw], tuple[Array, Array, Array, Array]]:
    """Screws of base and links, and axes and origin (3, R, m) of the flange, all in the world."""
    x, y, z, p = (base[:, :, k].T[:, :, None] for k in range(4))
    screws: list[Screw] = [(axis, None) for axis in (x, y, z)] + [(axis, p) for axis in (x, y, z)]
    for c, s, d, a, ca, sa, cb, sb in links:
        screws += [(z, p), (z, None)]
        x, y = c * x + s * y, c * y - s * x
        p = p + d * z + a * x
        y, z = ca * y + sa * z, ca * z - sa * y
        screws += [(x, None), (x, p), (y, p)]
        x, z = cb * x - sb * z, sb * x + cb * z
    return screws, (x, y, z, p)


def _times(M: Array, used: Bool, vectors: Array) -> Array:
    """Matrices M (a, b, R, m) times vectors (k, b, R, m), for entries that are `used` (a, b)."""
    out = np.empty((len(vectors), len(M), *vectors.shape[2:]))
    spare = np.empty((len(vectors), *vectors.shape[2:]))
    for a, row in enumerate(used):
        if not row.any():
            out[:, a] = 0.0
        for k, b in enumerate(np.flatnonzero(row)):
            to = out[:, a] if k == 0 else spare
            np.multiply(vectors[:, b], M[a, b], out=to)
            if k:
                out[:, a] += spare
    return out


def _times_jacobian(N: Array, e: Array) -> Array:
    """N (3, 3, R, m) times the inverse right Jacobian at rotation vectors e (3, R, m)."""
    square = (e * e).sum(axis=0)
    far = 1 / 12 + square * (1 / 720 + square / 30240)
    # a row times I + [e]x / 2 + far [e]x [e]x
    once = _cross(N, e[None])
    return np.asarray(N + 0.5 * once + far * _cross(once, e[None]))


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (k, 3, R, m)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[:, i], b[:, j], out=out[:, k])
        out[:, k] -= a[:, j] * b[:, i]
    return out
