"""Mesh files in: checked before and after trimesh reads them, shaded for a viewer where need be."""

import io
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.meshes.solids import corner_normals
from testbed.robots.robot import IN_PLACE, Visual

COLLADA = "{http://www.collada.org/2005/11/COLLADASchema}COLLADA"
"""Root of a DAE file."""


class Mesh(NamedTuple):
    """A mesh as a viewer wants it."""

    vertices: Array
    """(v, 3) places [m]; a place with two normals appears twice."""
    faces: Index
    """(f, 3) vertex numbers, seen counterclockwise from outside."""
    normals: Array
    """(v, 3) unit normals."""


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
        raise refuse("file", code="R7", message="no such mesh file", where=str(path))
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
        message = f"cannot be read as a mesh ({error})"
        allowed = "OBJ, STL, PLY and what else trimesh reads"
        where = str(path)
        raise refuse("file", allowed=allowed, code="R9", message=message, where=where) from error
    if not len(faces) or not np.isfinite(vertices).all():
        problem = "has vertices that are not finite" if len(faces) else "has no faces"
        raise refuse("file", code="R10", message=f"mesh {problem}", where=str(path))
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
        return float("nan")  # refused below


def _check_stl(path: Path, data: bytes) -> None:
    """A binary STL must be as long as the facets it claims: 84 + 50 bytes each."""
    if data[:5] == b"solid" and b"facet" in data[:1024]:
        return  # text
    claimed = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    if len(data) < 84 or len(data) != 84 + 50 * claimed:
        message = f"binary STL claims {claimed} facets"
        allowed = f"its {len(data)} bytes hold {max(len(data) - 84, 0) / 50:g}"
        raise refuse("facets", claimed, allowed, code="R9", message=message, where=str(path))
    floats = np.frombuffer(data, np.uint8, offset=84).reshape(-1, 50)[:, :48].copy().view("<f4")
    bad = np.flatnonzero(~np.isfinite(floats).all(axis=1))
    if len(bad):
        raise refuse("facet", code="R10", message=f"facet {bad[0]} is not finite", where=str(path))
