"""Solids and mesh files: the drawing vocabulary (puck, ball, hull, union, cut), OBJ out, meshes in.

The only module that imports trimesh. Lengths in m. A solid is closed; its file keeps one index for
places and one for normals, so the file is closed as well and still has crisp edges.
"""

import io
import struct
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError
from calib.geometry.frames import rot_x, rot_y
from testbed.robots.robot import IN_PLACE, Visual
from testbed.robots.xml_gate import parse_xml

Solid: TypeAlias = Any  # trimesh.Trimesh: its types are not checked here
Axis = Literal["x", "y", "z"]
Point = tuple[float, float, float]
CREASE = np.radians(32.0)
"""Faces that meet at less than this are shaded as one surface [rad]."""
COLLADA = "{http://www.collada.org/2005/11/COLLADASchema}COLLADA"
"""Root of a DAE file."""
GRID = 1e-5
"""Written coordinates are multiples of this [m]; closed solids stay closed on the grid."""


class Mesh(NamedTuple):
    """A mesh as a viewer wants it."""

    vertices: Array
    """(v, 3) places [m]; a place with two normals appears twice."""
    faces: Index
    """(f, 3) vertex numbers, seen counterclockwise from outside."""
    normals: Array
    """(v, 3) unit normals."""


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


def hull(*solids: Solid) -> Solid:
    """Smallest convex solid that contains all."""
    from trimesh.util import concatenate

    return concatenate(list(solids)).convex_hull


def union(*solids: Solid) -> Solid:
    """One closed solid of all."""
    from trimesh import boolean

    return boolean.union(list(solids), engine="manifold")


def cut(body: Solid, *tools: Solid) -> Solid:
    """What the tools leave of the body."""
    from trimesh import boolean

    return boolean.difference([body, *tools], engine="manifold")


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
        If an edge is left that does not belong to exactly two faces: a drawing to mend.
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


def corner_normals(vertices: Array, faces: Index, crease: float = CREASE) -> Array:
    """Normals (f, 3, 3) at each corner: mean over faces that meet within `crease`, by their angle.

    Weights are corner angles, so that a surface looks the same however it is cut into triangles;
    slivers thinner than the grid have no say.
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
        alike = around @ around.T > np.cos(crease)
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


def load_mesh(path: str | Path) -> Mesh:
    """Read a mesh file for a viewer (OBJ, STL, PLY, ...); normals are the file's, if it has any.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, is empty, or holds values that are not finite.
    """
    vertices, faces, normals = read_mesh(Path(path))
    if normals is None:
        vertices, faces, normals = _shaded(vertices, faces)
    return Mesh(frozen(vertices), frozen(faces, np.int64), frozen(normals))


def part_mesh(visual: Visual) -> Mesh:
    """Mesh of a part in the frame of its link [m]."""
    found = load_mesh(visual.file)
    if visual.affine == IN_PLACE:
        return found
    affine = np.array(visual.affine)
    mirrors = np.linalg.det(affine[:3, :3]) < 0
    normals = np.linalg.solve(affine[:3, :3].T, found.normals.T).T  # they stay normal to a scale
    return Mesh(
        frozen(found.vertices @ affine[:3, :3].T + affine[:3, 3]),
        frozen(found.faces[:, ::-1] if mirrors else found.faces, np.int64),
        frozen(normals / np.linalg.norm(normals, axis=1, keepdims=True)),
    )


def read_mesh(path: Path) -> tuple[Array, Index, Array | None]:
    """Vertices (v, 3) and faces (f, 3) of a mesh file as they are, and its normals (v, 3), if any.

    Raises
    ------
    InputError
        As `load_mesh`.
    """
    import trimesh

    if not path.is_file():
        raise InputError("no such mesh file", code="R7", where=str(path), field="file")
    data, kind = path.read_bytes(), path.suffix.lower().lstrip(".")
    if kind == "stl":
        _check_stl(path, data)
    unit = _collada_unit(data, path) if kind == "dae" else 1.0
    try:
        loaded = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
        vertices = np.asarray(loaded.vertices, dtype=np.float64).reshape(-1, 3) * unit
        faces = np.asarray(loaded.faces, dtype=np.int64).reshape(-1, 3)
        own = b"\nvn " in data and kind == "obj"
        normals = np.asarray(loaded.vertex_normals, dtype=np.float64) if own else None
    except Exception as error:  # many readers, many error classes: one of ours leaves
        raise InputError(
            f"cannot be read as a mesh ({error})",
            code="R9",
            where=str(path),
            field="file",
            allowed="OBJ, STL, PLY and what else trimesh reads",
        ) from error
    if not len(faces) or not np.isfinite(vertices).all():
        problem = "has vertices that are not finite" if len(faces) else "has no faces"
        raise InputError(f"mesh {problem}", code="R10", where=str(path), field="file")
    if normals is not None and normals.shape != vertices.shape:
        normals = None
    return vertices, faces, normals


def _shaded(vertices: Array, faces: Index) -> tuple[Array, Index, Array]:
    """Vertices split where their corners disagree about the normal."""
    places, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    corners = np.concatenate(
        [places[faces.ravel()], corner_normals(places, faces).reshape(-1, 3).round(6)], axis=1
    )
    unique, split = np.unique(corners, axis=0, return_inverse=True)
    return unique[:, :3], split.reshape(-1, 3).astype(np.int64), unique[:, 3:]


def _collada_unit(data: bytes, path: Path) -> float:
    """Metres per unit of a DAE file, which trimesh leaves to others."""
    unit = parse_xml(data, COLLADA, where=str(path)).find("{*}asset/{*}unit")
    try:
        return float(unit.get("meter", "1")) if unit is not None else 1.0
    except ValueError:
        return float("nan")  # found not finite below


def _check_stl(path: Path, data: bytes) -> None:
    """A binary STL must be as long as the facets it claims: 84 + 50 bytes each."""
    if data[:5] == b"solid" and b"facet" in data[:1024]:
        return  # text
    claimed = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    if len(data) < 84 or len(data) != 84 + 50 * claimed:
        raise InputError(
            f"binary STL claims {claimed} facets",
            code="R9",
            where=str(path),
            field="facets",
            value=claimed,
            allowed=f"its {len(data)} bytes hold {max(len(data) - 84, 0) / 50:g}",
        )
    floats = np.frombuffer(data, np.uint8, offset=84).reshape(-1, 50)[:, :48].copy().view("<f4")
    bad = np.flatnonzero(~np.isfinite(floats).all(axis=1))
    if len(bad):
        raise InputError(
            f"facet {bad[0]} is not finite", code="R10", where=str(path), field="facet"
        )
