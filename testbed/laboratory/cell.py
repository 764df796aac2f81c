"""The cell around the robot: boxes and meshes that it must not touch and no beam passes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain
from testbed.robots.meshes.files import Mesh, load_mesh
from testbed.robots.placements import frame_of
from testbed.scenario.laboratory import BoxObstacle, CellSettings, MeshObstacle

UNITS = {"mm": 1e-3, "m": 1.0}
FLAT = 1e-6
"""A mesh thinner than this part of its length has no hull to collide with."""


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """One solid thing that stands in the world."""

    name: str
    """"obstacle 1" ..., in the order of the scenario."""
    T_world_obstacle: Array
    """(4, 4) the center of the box, or the mesh's own origin [m]."""
    size: Array
    """(3,) edges of the box, or extent of the mesh along its own axes [m]."""
    mesh: Mesh | None = None
    """What blocks beams; parts of the robot collide with its convex hull. None: the box."""


def cell_from(settings: CellSettings, chain: Chain) -> tuple[Obstacle, ...]:
    """The obstacles of a scenario; `chain` is nominal, its base is what their places refer to.

    Raises
    ------
    InputError
        If a mesh file cannot be used, or its mesh is flat: names the obstacle.
    """
    return tuple(
        _obstacle(f"obstacle {k + 1}", entry, chain.T_world_base)
        for k, entry in enumerate(settings.obstacle)
    )


def _obstacle(name: str, entry: BoxObstacle | MeshObstacle, T_world_base: Array) -> Obstacle:
    """One obstacle, in the world."""
    T = T_world_base @ frame_of(entry.position_mm, entry.rotation_vector_deg)
    if isinstance(entry, BoxObstacle):
        return Obstacle(name, T, np.array(entry.size_mm) / 1e3)
    mesh = _mesh(Path(entry.file), UNITS[entry.unit])
    return Obstacle(name, T, np.ptp(mesh.vertices, axis=0), mesh)


def _mesh(file: Path, unit: float) -> Mesh:
    """A mesh in metres, from a file in `unit` metres; it must enclose a volume as a hull."""
    mesh = load_mesh(file)
    places, index = np.unique(mesh.vertices * unit, axis=0, return_inverse=True)
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    if len(places) < 4 or spread[-1] < FLAT * spread[0]:
        allowed, where = "an obstacle is a body with a volume", str(file)
        fix = 'write kind = "box" with a small thickness'
        raise refuse("file", None, allowed, code="R10", message="is flat", fix=fix, where=where)
    faces = index.reshape(-1)[mesh.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)  # slivers closed up by the merging
    return Mesh(frozen(places), frozen(faces[whole], np.int64), frozen(np.zeros_like(places)))
