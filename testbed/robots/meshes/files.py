"""Mesh files in: checked before and after trimesh reads them, shaded for a viewer where need be."""

import io
import math
import struct
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from calib.geometry.frames import transform_points
from testbed.bounds import SCALE
from testbed.gates.paths import real
from testbed.robots.describe.xml_gate import parse_xml
from testbed.robots.foreign import foreign
from testbed.robots.meshes.forms import form_mesh
from testbed.robots.meshes.plain_obj import plain_obj
from testbed.robots.meshes.solids import corner_normals
from testbed.robots.parts import IN_PLACE, Primitive, Visual

COLLADA = "{http://www.collada.org/2005/11/COLLADASchema}COLLADA"
"""Root of a DAE file."""


FORMATS = ("stl", "obj", "ply", "dae")
"""What is read, by the ending; archives and what else trimesh would open are not."""
LARGEST, ALL = 20_000_000, 100_000_000
"""Bytes of a mesh file, and of all of a model: such a text takes 2 s."""
SMALL, KEPT = 5_000_000, 32
"""Bytes of a file whose mesh is kept in memory, and most such meshes: at worst 300 MB."""
FARTHEST = 1e9
"""Largest coordinate in a mesh file, whatever its unit: a kilometer in micrometers."""


class Mesh(NamedTuple):
    """A mesh as a viewer wants it."""

    vertices: Array
    """(v, 3) places [m]; a place with two normals appears twice."""
    faces: Index
    """(f, 3) vertex numbers, seen counterclockwise from outside."""
    normals: Array
    """(v, 3) unit normals."""


def load_mesh(path: str | Path) -> Mesh:
    """Read a mesh file for a viewer (STL, OBJ, PLY, DAE); normals are the file's, if it has any.

    Raises
    ------
    InputError
        R7, R9, R10: the file is missing, too large or of another format, cannot be read, is empty,
        or holds values that are not finite.
    """
    vertices, faces, normals = read_mesh(Path(path))
    if normals is None:
        vertices, faces, normals = _shaded(vertices, faces)
    return Mesh(frozen(vertices), frozen(faces, np.int64), frozen(normals))


def part_mesh(part: Visual | Primitive) -> Mesh:
    """Mesh of a part in the frame of its link [m]."""
    found = load_mesh(part.file) if isinstance(part, Visual) else Mesh(*form_mesh(part.form))
    if part.affine == IN_PLACE:
        return found
    affine = np.array(part.affine)
    mirrors = np.linalg.det(affine[:3, :3]) < 0
    normals = np.linalg.solve(affine[:3, :3].T, found.normals.T).T  # they stay normal to a scale
    return Mesh(
        frozen(transform_points(affine, found.vertices)),
        frozen(found.faces[:, ::-1] if mirrors else found.faces, np.int64),
        frozen(normals / np.linalg.norm(normals, axis=1, keepdims=True)),
    )


def check_files(*paths: Path, before: int = 0) -> int:
    """Look at the mesh files of a model before one is opened; bytes of all, and `before` them.

    Raises
    ------
    InputError
        R7 no such file; R9 another format, or too large, this one or all together.
    """
    total = before
    for path in paths:
        where = str(path)
        if not real(path, field="mesh").is_file():
            raise refuse("file", code="R7", message="no such mesh file", where=where)
        if (kind := path.suffix.lower()[1:]) not in FORMATS:
            message, allowed = (
                f"is not a mesh that can be read ({kind})",
                f"formats read: {', '.join(FORMATS)}",
            )
            fix = "save it in one of these formats"
            raise refuse("file", kind, allowed, code="R9", message=message, fix=fix, where=where)
        size = path.stat().st_size
        total += size
        for what, many, most in (("is", size, LARGEST), ("makes the meshes", total, ALL)):
            if many > most:
                message, allowed = f"{what} {many / 1e6:.1f} MB", f"at most {most / 1e6:g} MB"
                fix = "save it with fewer facets"
                raise refuse(
                    "file", many, allowed, code="R9", message=message, fix=fix, where=where
                )
    return total


def mesh_bytes(path: Path) -> bytes:
    """The bytes of a mesh file that has been looked at; R9, R10: a binary STL is what it claims."""
    check_files(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        message = f"cannot be read ({error.strerror})"
        raise refuse("file", code="R7", message=message, where=str(path)) from error
    if path.suffix.lower() == ".stl":
        _check_stl(path, data)
    return data


def read_mesh(path: Path) -> tuple[Array, Index, Array | None]:
    """Vertices (v, 3) and faces (f, 3) of a mesh file as they are, and its normals (v, 3), if any.

    Small ones are kept as long as the file does not change, since a robot's are asked for again
    when it is proven, drawn and written.

    Raises
    ------
    InputError
        As `load_mesh`.
    """
    check_files(path)
    known = path.stat()
    if known.st_size <= SMALL:
        return _kept(path.resolve(), known.st_mtime_ns, known.st_size)
    return _read(path)


@lru_cache(maxsize=KEPT)
def _kept(path: Path, _changed: int, _size: int) -> tuple[Array, Index, Array | None]:
    """What a file of this age and size holds."""
    vertices, faces, normals = _read(path)
    return (
        frozen(vertices), frozen(faces, np.int64), None if normals is None else frozen(normals)
    )  # fmt: skip


def _read(path: Path) -> tuple[Array, Index, Array | None]:
    """What `read_mesh` finds in a file."""
    data, kind, where = mesh_bytes(path), path.suffix.lower()[1:], str(path)
    plain = plain_obj(data) if kind == "obj" else None
    vertices, faces, normals = plain or _by_trimesh(data, kind, where)
    _check_mesh(vertices, faces, where)
    if normals is not None and not _are_directions(normals, vertices):
        normals = None
    return vertices, faces, normals


def _by_trimesh(data: bytes, kind: str, where: str) -> tuple[Array, Index, Array | None]:
    """The same of any file that trimesh reads."""
    import trimesh

    unit = 1.0
    if kind == "dae":
        data, unit = _collada(data, where)
    with foreign("trimesh", where=where, code="R9"):
        loaded = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
        vertices = np.asarray(loaded.vertices, dtype=np.float64).reshape(-1, 3) * unit
        faces = np.asarray(loaded.faces, dtype=np.int64).reshape(-1, 3)
        own = b"\nvn " in data and kind == "obj"
        normals = np.asarray(loaded.vertex_normals, dtype=np.float64) if own else None
    return vertices, faces, normals


def _are_directions(normals: Array, vertices: Array) -> bool:
    """Whether every vertex has a normal that points somewhere."""
    sizes = np.abs(normals).max(axis=1)
    return normals.shape == vertices.shape and bool(((sizes > 1e-6) & (sizes < 1e6)).all())


def check_meshes(*paths: Path) -> None:
    """Read mesh files once, as long as they do not change, so that others may open them too.

    Raises
    ------
    InputError
        As `check_files` and `load_mesh`.
    """
    check_files(*paths)
    for path in paths:
        known = path.stat()
        _read_once(path, known.st_mtime_ns, known.st_size)


@lru_cache(maxsize=1000)
def _read_once(path: Path, _changed: int, _size: int) -> None:
    """A mesh file of this age and size can be read."""
    read_mesh(path)


def _check_mesh(vertices: Array, faces: Index, where: str) -> None:
    """R10: some faces, between vertices that are there, each somewhere."""
    problem, allowed = "", ""
    if not len(faces):
        problem = "has no faces"
    elif not np.isfinite(vertices).all():
        problem = "has vertices that are not finite"
    elif not (faces.min() >= 0 and faces.max() < len(vertices)):
        problem, allowed = "has faces between vertices that are not there", f"{len(vertices)} are"
    elif np.abs(vertices).max() > FARTHEST:
        problem, allowed = f"has a coordinate {np.abs(vertices).max():g}", f"at most {FARTHEST:g}"
    if problem:
        raise refuse("file", None, allowed, code="R10", message=f"mesh {problem}", where=where)


def _shaded(vertices: Array, faces: Index) -> tuple[Array, Index, Array]:
    """Vertices split where their corners disagree about the normal."""
    places, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    corners = np.concatenate(
        [places[faces.ravel()], corner_normals(places, faces).reshape(-1, 3).round(6)], axis=1
    )
    unique, split = np.unique(corners, axis=0, return_inverse=True)
    return unique[:, :3], split.reshape(-1, 3).astype(np.int64), unique[:, 3:]


def _collada(data: bytes, where: str) -> tuple[bytes, float]:
    """A DAE file as plain data, and its metres per unit, which trimesh leaves to others."""
    from lxml import etree

    root = parse_xml(data, COLLADA, where=where)
    unit = root.find("{*}asset/{*}unit")
    text = unit.get("meter", "1") if unit is not None else "1"
    try:
        size = float(text)
    except ValueError:
        size = math.nan
    if not SCALE.least <= size <= SCALE.most:
        message, allowed = f"<unit> has meter={text}", SCALE.allowed("")
        place = f"{where}:{unit.sourceline}"
        raise refuse("meter", text, allowed, code="R11", message=message, where=place)
    return etree.tostring(root), size


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
