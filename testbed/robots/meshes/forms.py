"""Meshes of plain shapes, as a viewer wants them: closed, their corners on the shape itself."""

import numpy as np

from calib.arrays import Array, Index
from testbed.robots.parts import Form

AROUND, RINGS = 48, 8
"""Corners of a circle, and rings of a half ball."""


def form_mesh(form: Form) -> tuple[Array, Index, Array]:
    """Vertices (v, 3) [m], faces (f, 3) and unit normals (v, 3) of a shape about its center."""
    if form.kind == "box":
        return _box(np.array(form.size))
    radius, *length = form.size
    half = sum(length) / 2
    if form.kind == "cylinder":
        # the rims stand twice, for a normal of the lid and one of the side
        place = [(0, -half), (radius, -half), (radius, -half), (radius, half), (radius, half),
                 (0, half)]  # fmt: skip
        normal = [(0, -1), (0, -1), (1, 0), (1, 0), (0, 1), (0, 1)]
        return _turned(np.array(place, dtype=np.float64), np.array(normal, dtype=np.float64))
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * RINGS + 1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals[[0, -1], 0] = 0.0
    if form.kind == "capsule":
        normals = np.insert(normals, RINGS, normals[RINGS], axis=0)  # both ends of the side
    ends = np.where(np.arange(len(normals)) <= RINGS, -half, half)
    return _turned(radius * normals + np.stack([np.zeros_like(ends), ends], axis=1), normals)


def _box(size: Array) -> tuple[Array, Index, Array]:
    """A box with four corners of its own on each side."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    vertices, normals, faces = list[Array](), list[Array](), list[list[int]]()
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            corners, out = np.empty((4, 3)), np.zeros(3)
            corners[:, axis], out[axis] = sign / 2, sign
            corners[:, u], corners[:, v] = square[:, 0], square[:, 1]
            first = 4 * len(vertices)
            order = ((0, 1, 2), (0, 2, 3)) if sign > 0 else ((2, 1, 0), (3, 2, 0))
            faces += [[first + k for k in face] for face in order]
            vertices.append(corners * size)
            normals.append(np.tile(out, (4, 1)))
    return np.concatenate(vertices), np.array(faces), np.concatenate(normals)


def _turned(profile: Array, normals: Array) -> tuple[Array, Index, Array]:
    """The surface that a profile (k, 2) of radius and z sweeps about z; from below to above."""
    angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def swept(rows: Array) -> Array:
        out = np.empty((len(rows), AROUND, 3))
        out[..., :2], out[..., 2] = rows[:, :1, None] * circle, rows[:, 1:]
        return out.reshape(-1, 3)

    one = np.arange(AROUND)
    other, faces = np.roll(one, -1), []
    for k in range(len(profile) - 1):
        if np.array_equal(profile[k], profile[k + 1]):
            continue  # a rim that stands twice
        a, b, c, d = (AROUND * row + side for row in (k, k + 1) for side in (one, other))
        if profile[k, 0] > 0:
            faces.append(np.stack([a, b, d], axis=1))
        if profile[k + 1, 0] > 0:
            faces.append(np.stack([a, d, c], axis=1))
    return swept(profile), np.concatenate(faces), swept(normals)
