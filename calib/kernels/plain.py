"""The loops of this folder in plain numpy, for small work or without numba.

Arguments are the same, and results are equal to rounding. A replicate costs three times as much,
but nothing has to be compiled.
"""

from typing import cast

import numpy as np

from calib.arrays import Array, Bool, Index

BLOCKS = 4
"""Blocks of 32 replicates in one pass, whose arrays stay in the second-level cache."""


def noisy_poses(
    normal: Array, position: Array, rotation: Array, factor: Array, observed: Array
) -> None:
    """Poses observed with noise, as in `calib.kernels.noisy_poses`."""
    noise = np.moveaxis(factor @ normal, 2, 0)  # (6, B, m, 32)
    observed[:, :, :3] = position[:, :, None] + np.moveaxis(noise[:3], 0, 2)
    x, y, w = noise[3:]
    q = x * x + y * y + w * w
    # sine and versed sine of a small turn over the turn and its square
    s = 1 - q / 6 * (1 - q / 20 * (1 - q / 42))
    v = 0.5 - q / 24 * (1 - q / 30 * (1 - q / 56))
    turns = (
        (1 - v * (y * y + w * w), v * x * y - s * w, v * x * w + s * y),
        (v * x * y + s * w, 1 - v * (x * x + w * w), v * y * w - s * x),
        (v * x * w - s * y, v * y * w + s * x, 1 - v * (x * x + y * y)),
    )
    for r, row in enumerate(turns):
        for c in range(3):
            observed[:, :, 3 + 3 * r + c] = sum(
                part * rotation[:, k, c, None] for k, part in enumerate(row)
            )


def gradient(
    links: Array, base: Array, tool: Array, terms: Array, observed: Array, weight: Array,
    offset: Array, cosine: Array, sine: Array, slide: Array, basis: Array, joint: Index,
    turns: Bool, slope: Array, square: Array,
) -> None:  # fmt: skip
    """J'W r and r'W r of many models, as in `calib.kernels.replicates.gradient`."""
    for b in range(0, len(links), BLOCKS):
        some = slice(b, b + BLOCKS)
        own = (_side_by_side(part[some]) for part in (links, base, tool, terms, observed))
        found = _gradient(
            *cast(tuple[Array, Array, Array, Array, Array], tuple(own)),
            weight, offset, cosine, sine, slide, basis, joint, turns,
        )  # fmt: skip
        for out, values in zip((slope, square), found, strict=True):
            out[some] = np.moveaxis(values.reshape(*values.shape[:-1], -1, 32), -2, 0)


def _side_by_side(blocks: Array) -> Array:
    """Replicates (B, ..., 32) of several blocks in one row (..., 32 B)."""
    inside = np.moveaxis(blocks, 0, -2)
    return inside.reshape(*inside.shape[:-2], 32 * len(blocks))


def _gradient(
    links: Array, base: Array, tool: Array, terms: Array, observed: Array, weight: Array,
    offset: Array, cosine: Array, sine: Array, slide: Array, basis: Array, joint: Index,
    turns: Bool,
) -> tuple[Array, Array]:  # fmt: skip
    """J'W r (12 + 5 n + k, L) and r'W r (L,) of L replicates, at m poses each.

    Each pose acts on the tool with the wrench W r; an entry of J'W r is its force along a sliding
    axis, or its torque about a turning one. All vectors (3, m, L) are in the world frame.
    """
    m, L, n = len(cosine), links.shape[-1], len(turns)
    axes = [np.broadcast_to(base[k:9:3, None], (3, m, L)) for k in range(3)]
    x, y, z = axes
    p = np.broadcast_to(base[9:, None], (3, m, L))
    met, own = [], np.zeros((n, m, L))
    for i in range(n):
        for t in np.flatnonzero(joint == i):
            own[i] += basis[:, t, None] * terms[t]
        c, s, d, a, ca, sa, cb, sb = links[i]
        c, s = (
            cosine[:, i, None] * c - sine[:, i, None] * s,
            (cosine[:, i, None] * s + sine[:, i, None] * c),
        )
        shift = slide[:, i, None] + d
        if turns[i]:
            co, si = np.cos(own[i]), np.sin(own[i])
            c, s = c * co - s * si, s * co + c * si
        else:
            shift = shift + own[i]
        foot = p
        x, y = c * x + s * y, c * y - s * x
        p = p + shift * z + a * x
        along = z
        y, z = ca * y + sa * z, ca * z - sa * y
        met.append((along, foot, x, y, p))
        x, z = cb * x - sb * z, sb * x + cb * z
    flange = x, y, z
    x, y, z = (
        tool[k] * flange[0] + tool[3 + k] * flange[1] + tool[6 + k] * flange[2] for k in range(3)
    )
    p = p + tool[9] * flange[0] + tool[10] * flange[1] + tool[11] * flange[2]
    held = np.stack([x, y, z])
    p = p + np.einsum("mk,krml->rml", offset, held)
    seen = np.moveaxis(observed, 1, 0)  # (12, m, L)
    turn = np.sum([_cross(held[k], seen[3 + k :: 3]) for k in range(3)], axis=0) / 2
    q = (turn**2).sum(axis=0)
    turn = turn * (1 + q * (1 / 6 + q * (3 / 40 + q * (5 / 112 + q * (35 / 1152)))))
    residual = np.concatenate([seen[:3] - p, turn])
    wrench = np.moveaxis(weight @ np.moveaxis(residual, 1, 0), 0, 1)
    square = (residual * wrench).sum(axis=(0, 1))
    force, torque = wrench[:3], _to_the_right(turn, wrench[3:])
    slope = np.empty((12 + 5 * n + len(joint), L))

    def slid(axis: Array) -> Array:
        return np.asarray(np.einsum("rml,rml->l", axis, force))

    def torque_about(point: Array) -> Array:
        return np.asarray(torque + _cross(p - point, force))

    def turned(axis: Array, about: Array) -> Array:
        return np.asarray(np.einsum("rml,rml->l", axis, about))

    foot = torque_about(base[9:, None])
    slope[:3], slope[3:6] = (
        [each(axis, *more) for axis in axes] for each, more in ((slid, ()), (turned, (foot,)))
    )
    for i, (along, start, ahead, level, end) in enumerate(met):
        k = 6 + 5 * i
        of_turn, at_end = torque_about(start), torque_about(end)
        slope[k : k + 5] = (
            turned(along, of_turn), slid(along), slid(ahead), turned(ahead, at_end),
            turned(level, at_end),
        )  # fmt: skip
        moves = of_turn if turns[i] else force
        for t in np.flatnonzero(joint == i):
            slope[12 + 5 * n + t] = np.einsum("m,rml,rml->l", basis[:, t], along, moves)
    k = 6 + 5 * n
    # the tool turns about its own origin, not about the reflector
    at_tool = torque + _cross(np.einsum("mk,krml->rml", offset, held), force)
    slope[k : k + 3] = [slid(axis) for axis in (x, y, z)]
    slope[k + 3 : k + 6] = [turned(axis, at_tool) for axis in (x, y, z)]
    return slope, square


def _to_the_right(turn: Array, torque: Array) -> Array:
    """Inverse right Jacobian at `turn` (3, m, L), transposed, times a torque.

    References
    ----------
    Sola, Deray, Atchuthan, arXiv 1812.01537, eq. (144).
    """
    q = (turn**2).sum(axis=0)
    once = _cross(turn, torque)
    far = 1 / 12 + q * (1 / 720 + q / 30240)
    return np.asarray(torque - once / 2 + far * _cross(turn, once))


def _cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (3, m, L)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
