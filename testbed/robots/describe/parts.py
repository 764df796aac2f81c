"""The meshes and plain shapes of a described arm, as parts of its links."""

from collections import Counter
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.frames import inverse
from testbed.robots.describe.description import Description, plain_name
from testbed.robots.meshes.files import check_files, read_mesh
from testbed.robots.parts import Form, Primitive, Visual

MOST_SHAPES = 2000
"""Meshes and plain shapes of an arm: far more than any has; all are tested against each other."""
FLAT = 1e-4
"""A mesh this thin, as a share of its size, encloses nothing."""


def parts_of(
    description: Description, frames: Array, notes: list[str], *, allow_missing: bool = False
) -> tuple[tuple[Visual, ...], tuple[Primitive, ...], set[int]]:
    """Meshes and plain shapes in the frames of their bodies, each with a different name.

    Meshes are checked; where some may be missing, those that cannot be used are left out, too.
    Bodies that lack a mesh which collides, a flat one or one left out, are the third.
    """
    visuals, primitives = list[Visual](), list[Primitive]()
    lacking, names, counts = set[int](), set[str](), Counter[str]()
    shapes = [(k, shape) for k, body in enumerate(description.bodies) for shape in body.shapes]
    if len(shapes) > MOST_SHAPES:
        message, where = f"has {len(shapes)} shapes", str(description.path)
        allowed = f"at most {MOST_SHAPES}"
        raise refuse("shapes", allowed=allowed, code="R2", message=message, where=where)
    files = dict.fromkeys(shape.source for _, shape in shapes if isinstance(shape.source, Path))
    if not allow_missing:
        check_files(*files)
    left_out = _left_out(list(files), allow_missing=allow_missing)
    for link, shape in shapes:
        source, body = shape.source, description.bodies[link].name
        if isinstance(source, Path) and source in left_out:
            notes.append(left_out[source])
            lacking |= {link} if shape.collides else set()
            continue
        plain = f"{body}_{source.kind}" if isinstance(source, Form) else source.stem
        name = plain_name(plain, default="part")
        if name in names and isinstance(source, Path):
            name = plain_name(f"{body}_{name}", default="part")
        stem = name
        while name in names:
            counts[stem] += 1
            name = f"{stem}_{counts[stem] + 1}"
        names.add(name)
        affine = np.round(inverse(frames[link]) @ shape.affine, 12) + 0.0  # no rounding errors
        rows = tuple(map(tuple, affine.tolist()))
        rest = (shape.rgb, shape.collides, link, name, rows, shape.drawn)
        if isinstance(source, Form):
            primitives.append(Primitive(*rest, form=source))
        else:
            visuals.append(Visual(*rest, file=source))
    return tuple(visuals), tuple(primitives), lacking


def _left_out(files: list[Path], *, allow_missing: bool) -> dict[Path, str]:
    """Why a mesh is left out: flat ones, and those that cannot be used if these may be missing."""
    why, total = {}, 0
    for file in files:
        try:
            total = check_files(file, before=total)
            if _is_flat(read_mesh(file)[0]):
                why[file] = f"mesh {file.name} is flat and is left out"
        except InputError as error:
            if not allow_missing:
                raise
            why[file] = f"mesh {file.name} counts as missing: {error.message}"
    return why


def _is_flat(vertices: Array) -> bool:
    """Whether a mesh encloses nothing."""
    size = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    return bool(len(vertices) < 4 or size[-1] <= FLAT * size[0])
