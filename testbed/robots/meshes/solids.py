"""Solids: the drawing vocabulary (puck, ball, hull, union, cut), shading, and OBJ out.

Lengths in m. A solid is closed; its file keeps one index for
places and one for normals, so the file is closed as well and still has crisp edges.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.geometry.frames import rot_x, rot_y

Solid: TypeAlias = Any  # trimesh.Trimesh: its types are not checked here
Axis = Literal["x", "y", "z"]
Point = tuple[float, float, float]
CREASE = np.radians(32.0)
"""Faces that meet at less than this are shaded as one surface [rad]."""
GRID = 1e-5
"""Written coordinates are multiples of this [m]; closed solids stay closed on the grid."""


def puck(
    radius: float,
    low: float,
    high: float,
    fillet: float = 0.004,
    axis: Axis = "y",
    at: Point = (0.0, 0.0, 0.0),
    sections: int = 36,
) -> Solid:
    """Disc with rounded rims, between `low` and `high` along `axis` through the point `at`."""
    from trimesh import creation

    low, high = min(low, high), max(low, high)
    angle, height = np.linspace(0, np.pi / 2, 2 + (fillet > 0.0016) + (fillet > 0.005)), high - low
    sine, cosine = fillet * np.sin(angle), fillet * np.cos(angle)
    rim = [
        *zip(radius - fillet + sine, fillet - cosine, strict=True),
        *zip(radius - fillet + cosine, height - fillet + sine, strict=True),
    ]
    solid = creation.revolve(np.array([(0, 0), *rim, (0, height)]), sections=sections)
    turn = {"x": rot_y(np.pi / 2), "y": rot_x(-np.pi / 2), "z": np.eye(4)}[axis]
    place = turn.copy()
    place[:3, 3] = np.asarray(at) + turn[:3, 2] * low
    solid.apply_transform(place)
    return solid


def ball(radius: float, at: Point, fineness: int = 3) -> Solid:
    """Sphere of 20 * 4^fineness faces."""
    from trimesh import creation

    solid = creation.icosphere(subdivisions=fineness, radius=radius)
    solid.apply_translation(at)
    return solid


def corners(x: float, y: float) -> list[tuple[float, float]]:
    """Four places around an upright axis."""
    return [(sx * x, sy * y) for sx in (-1, 1) for sy in (-1, 1)]


def on_circle(radius: float, count: int, start: float = 0.0) -> list[tuple[float, float]]:
    """Places evenly spread on a circle."""
    angle = start + np.arange(count) * 2 * np.pi / count
    return [(float(radius * np.cos(t)), float(radius * np.sin(t))) for t in angle]


def posts(
    radius: float,
    low: float,
    high: float,
    fillet: float,
    places: list[tuple[float, float]],
    sections: int,
) -> list[Solid]:
    """Upright pucks, one at each place."""
    return [puck(radius, low, high, fillet, "z", (x, y, 0), sections) for x, y in places]


def hull(*solids: Solid) -> Solid:
    """Smallest convex solid that contains all."""
    from trimesh.util import concatenate

    return concatenate(list(solids)).convex_hull


def union(*solids: Solid) -> Solid:
    """One closed solid of all."""
    return _boolean().union(list(solids), engine="manifold")


def cut(body: Solid, *tools: Solid) -> Solid:
    """What the tools leave of the body."""
    return _boolean().difference([body, *tools], engine="manifold")


def _boolean() -> Any:
    """What joins and cuts solids; only drawings of shipped robots need it."""
    from trimesh import boolean

    if "manifold" not in boolean.engines_available:
        message = "drawing meshes needs the package manifold3d, which is not installed"
        raise refuse("", code="R9", message=message, fix="pip install 'truebed[dev]'")
    return boolean


def groove(
    radius: float,
    at_height: float,
    width: float = 0.0025,
    depth: float = 0.003,
    axis: Axis = "z",
    at: Point = (0.0, 0.0, 0.0),
) -> Solid:
    """Ring-shaped tool that cuts a groove `depth` deep into a cylinder of `radius`."""
    half = width / 2
    outer = puck(radius + 0.02, at_height - half, at_height + half, 1e-4, axis, at)
    return cut(outer, puck(radius - depth, at_height - width, at_height + width, 1e-4, axis, at))


def moved(solid: Solid, T: Array) -> Solid:
    """Copy of a solid in another frame, T (4, 4) [m]."""
    out = solid.copy()
    out.apply_transform(T)
    return out


def on_grid(solid: Solid) -> tuple[Array, Index]:
    """Vertices (v, 3) on the written grid [m] and faces (f, 3), slivers gone; still closed.

    Raises
    ------
    ValueError
        If an edge is left that does not belong to exactly two faces: a drawing to correct.
    """
    places = np.round(np.asarray(solid.vertices) / GRID).astype(np.int64)
    unique, index = np.unique(places, axis=0, return_inverse=True)
    faces = index.reshape(-1)[np.asarray(solid.faces)]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, compact = np.unique(faces, return_inverse=True)
    faces = compact.reshape(-1, 3).astype(np.int64)
    if not is_closed(faces):
        raise ValueError("solid is not closed on the grid")
    return unique[used] * GRID, faces


def is_closed(faces: Index) -> bool:
    """Whether each directed edge of the faces (f, 3) is met as often in one direction as back."""
    edges = np.concatenate([faces[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    size = int(faces.max()) + 1
    there, back = edges @ [size, 1], edges @ [1, size]
    return bool(np.array_equal(np.sort(there), np.sort(back)))


def corner_normals(vertices: Array, faces: Index) -> Array:
    """Normals (f, 3, 3) at each corner: mean over faces that meet within `CREASE`, by their angle.

    Weights are corner angles, so that a surface looks the same however it is cut into triangles;
    slivers thinner than the grid do not count.
    """
    corners = vertices[faces]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    area = np.cross(ahead[:, 0], behind[:, 0])  # twice the area, along the normal
    size = np.linalg.norm(area, axis=1)
    unit = area / np.maximum(size, 1e-300)[:, None]
    longest = np.linalg.norm(ahead, axis=2).max(axis=1)
    angle = np.arctan2(size[:, None], np.einsum("fcx,fcx->fc", ahead, behind))
    angle *= np.where(size > 3 * GRID * longest, 1.0, 1e-6)[:, None]
    order = np.argsort(faces.ravel(), kind="stable")
    out = np.zeros((faces.size, 3))
    starts = np.concatenate([[0], np.flatnonzero(np.diff(faces.ravel()[order])) + 1, [len(order)]])
    for start, stop in pairwise(starts):  # one vertex at a time: few faces each
        own = order[start:stop]
        around = unit[own // 3]
        alike = around @ around.T > np.cos(CREASE)
        np.fill_diagonal(alike, True)
        out[own] = (alike * angle.ravel()[own]) @ around
    length = np.linalg.norm(out, axis=1, keepdims=True)
    out = np.where(length > 0, out / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    return out.reshape(-1, 3, 3)


def obj_text(solid: Solid, name: str) -> str:
    """A solid as OBJ text: places in m to 0.01 mm, corner normals to 0.001."""
    vertices, faces = on_grid(solid)
    corner = np.round(corner_normals(vertices, faces).reshape(-1, 3), 3) + 0.0
    normals, index = np.unique(corner, axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    lines = [f"# {name}: drawn for truebed, see the model's README; units m", f"o {name}"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices + 0.0]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals]
    lines += [
        "f " + " ".join(f"{v + 1}//{n + 1}" for v, n in zip(face, turn, strict=True))
        for face, turn in zip(faces, index, strict=True)
    ]
    return "\n".join(lines) + "\n"


def write_obj(solid: Solid, path: Path) -> None:
    """Write a closed solid as an OBJ file named after its part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(obj_text(solid, path.stem), encoding="utf-8", newline="\n")
