"""Parts of a robot as geoms of a MuJoCo spec: meshes, plain shapes, and which of them collide."""

from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.robots.meshes.files import part_mesh
from testbed.robots.parts import IN_PLACE, Form, Primitive, Visual
from testbed.robots.placements import quaternion_wxyz

FLAT = 1e-4
"""A box this thin, as a share of its longest edge, has no hull in single precision."""
HULL, COLLIDES, DRAWN = 3, 2, 1
"""Geom groups: parts that are only tested for collision, and not drawn unless a viewer is asked
to; parts that are tested and drawn; parts that are only drawn."""


def placed(T: Array) -> dict[str, Array]:
    """MuJoCo's keywords for a frame (4, 4)."""
    return {"pos": T[:3, 3], "quat": quaternion_wxyz(T[:3, :3])}


def add_part(
    spec: Any, body: Any, part: Visual | Primitive, folder: Path, plain_boxes: bool
) -> None:
    """Add one part, weightless; it collides if the part does, a mesh as its hull."""
    import mujoco

    what: dict[str, Any] = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": part.name}
    if isinstance(part, Visual) or (not plain_boxes and is_thick_box(part.form)):
        _add_mesh(spec, part, folder)
    else:
        # half edges and half lengths; a radius is whole
        kind, (first, *rest) = part.form
        size = [first / 2 if kind == "box" else first, *(length / 2 for length in rest)]
        form = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
        what = {"type": form, "size": [*size, 0.0, 0.0][:3], **placed(np.array(part.affine))}
    body.add_geom(
        name=part.name,
        rgba=[*part.rgb, 1.0],
        contype=int(part.collides),
        conaffinity=int(part.collides),
        group=(COLLIDES if part.drawn else HULL) if part.collides else DRAWN,
        mass=0.0,
        **what,
    )


def is_thick_box(form: Form) -> bool:
    """Whether a shape is a box thick enough to be the hull of its corners in single precision."""
    return form.kind == "box" and min(form.size) > FLAT * max(form.size)


def _add_mesh(spec: Any, part: Visual | Primitive, folder: Path) -> None:
    """Add the mesh of a part under the name of the part."""
    import mujoco

    file = part.file if isinstance(part, Visual) and part.affine == IN_PLACE else None
    if file is not None and file.suffix.lower() == ".obj" and file.is_relative_to(folder):
        spec.add_mesh(name=part.name, file=file.relative_to(folder).as_posix())
    else:  # other formats and places, and meshes beside the folder, go in as numbers
        found = part_mesh(part)
        places, index = np.unique(found.vertices, axis=0, return_inverse=True)
        faces = index.reshape(-1)[found.faces]
        spec.add_mesh(
            name=part.name,
            uservert=places.astype(np.float32).ravel(),
            userface=faces.astype(np.int32).ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
