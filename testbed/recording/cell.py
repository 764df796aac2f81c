"""The cell in a recording: arms with their parts, the tracker and its beam, boxes."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations, product

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, inverse, rot_y, rot_z, transform_points
from testbed.recording.pen import Pen
from testbed.recording.style import BEAM_COLOR, Color
from testbed.recording.timeline import Phase
from testbed.robots.catalog import load_tracker_visuals
from testbed.robots.meshes.files import Mesh, part_mesh
from testbed.robots.parts import Primitive, Visual
from testbed.robots.placements import joint_motion, placements
from testbed.robots.robot import Robot

GHOST_SKIN = 0.002
"""A ghost is drawn thinner by this [m]: where it does not deviate it stays inside the robot."""
SMALL = 5e-5
"""Volume of a part that a ghost goes without [m^3]: a matchbox."""
BOX_COLOR = (120, 132, 146, 150)


@cache
def mesh(part: Visual | Primitive) -> Mesh:
    """A part's mesh, read once: robot and ghost share it."""
    return part_mesh(part)


def volume(part: Mesh) -> float:
    """Of a closed mesh [m^3]: that of the tetrahedra from the origin to its faces."""
    a, b, c = part.vertices[part.faces].astype(np.float64).transpose(1, 0, 2)
    return float(abs(np.einsum("fi,fi->", a, np.cross(b, c)))) / 6


def draw_arm(
    pen: Pen,
    root: str,
    robot: Robot,
    q: Array,
    chains: Sequence[Chain],
    which: Index | None = None,
    color: Color | None = None,
    across: Array | None = None,
) -> None:
    """Parts of an arm on nested link entities; at step k the arm is chains[which[k]] at q[k].

    The last body carries the drawn tool in its nominal place, so it takes over what the chain
    differs behind the last joint: the drawn tool is where the chain says. A color makes a ghost;
    `across` (s, n, 2) bends every joint about x, then y of its body as well [rad].
    """
    nominal, placed = placements(robot.model.chain), [placements(chain) for chain in chains]
    frames = np.array([one.frames for one in placed])
    last = np.array([one.tool @ inverse(nominal.tool) for one in placed])
    bases = np.array([chain.T_world_base for chain in chains])
    which = np.zeros(len(q), dtype=np.int64) if which is None else which
    pen.transforms(f"{root}/base", bases[0] if len(chains) == 1 else bases[which])
    paths, path, n = [f"{root}/base"], root, q.shape[1]
    for joint in range(n):
        path += f"/link{joint + 1}"
        paths.append(path)
        T = frames[which, joint] @ joint_motion(chains[0], joint, q[:, joint])
        if across is not None:
            T[:, :3, :3] @= exp_so3(across[:, joint, :1] * [1, 0, 0])
            T[:, :3, :3] @= exp_so3(across[:, joint, 1:] * [0, 1, 0])
        pen.transforms(path, T @ last[which] if joint == n - 1 else T)
    _draw_parts(pen, paths, robot.parts, color)


def _draw_parts(
    pen: Pen, paths: Sequence[str], parts: Sequence[Visual | Primitive], color: Color | None = None
) -> None:
    """What is seen, below the entities of the links, in its own color or, as a ghost, in one.

    A ghost has no small parts, which are told from its large ones by their colors only.
    """
    import rerun as rr

    skin = GHOST_SKIN if color else 0.0
    for part in parts:
        found = mesh(part)
        if not part.drawn or (color and volume(found) < SMALL):
            continue
        pen.static(
            f"{paths[part.link]}/{part.name}",
            rr.Mesh3D(
                vertex_positions=found.vertices - skin * found.normals,
                triangle_indices=found.faces,
                vertex_normals=found.normals,
                albedo_factor=color or (*(round(255 * value) for value in part.rgb), 255),
            ),
        )


def draw_station(
    pen: Pen, station: Array, target: Array, floor: float, path: str = "world/tracker"
) -> None:
    """A tracker at its station (4, 4), its head on a target (s, 3) at every step [m]."""
    import rerun as rr

    x, y, z = (target @ station[:3, :3] - station[:3, 3] @ station[:3, :3]).T
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    pen.transforms(path, station)
    pen.transforms(f"{path}/yoke", np.array([rot_z(angle) for angle in azimuth]))
    pen.transforms(f"{path}/yoke/head", np.array([rot_y(-angle) for angle in elevation]))
    visuals = load_tracker_visuals()
    names = (f"{path}/stand", f"{path}/yoke", f"{path}/yoke/head")
    _draw_parts(pen, names, visuals)
    foot = min(float(mesh(visual).vertices[:, 2].min()) for visual in visuals)
    height = station[2, 3] + foot - floor
    if height > 1e-3:  # a station above the stand's own height needs something to stand on
        pen.static(
            f"{path}/plinth",
            rr.Boxes3D(
                centers=[0, 0, foot - height / 2],
                sizes=[0.6, 0.6, height],
                colors=[176, 182, 188],
                fill_mode="solid",
            ),
        )


def draw_beam(
    pen: Pen, phase: Phase, start: Array, target: Array, path: str = "world/beam"
) -> None:
    """The beam to the target (s, 3) of every step, during a phase; its start (3,) or (s, 3) [m]."""
    import rerun as rr

    starts = np.broadcast_to(start, target.shape)
    part = slice(phase.start, phase.stop)
    strips = [[[a, b]] for a, b in zip(starts[part], target[part], strict=True)]
    pen.every_step(path, rr.LineStrips3D.columns(strips=strips), phase.steps)
    pen.static(path, rr.LineStrips3D.from_fields(radii=0.0022, colors=BEAM_COLOR))
    pen.clear(phase.stop, path)


def draw_box(
    pen: Pen, path: str, chain: Chain, center: Array, size: Array, color: Color = BOX_COLOR
) -> None:
    """The edges of a box given in the base frame of `chain` [m]."""
    import rerun as rr

    base = chain.T_world_base
    edges = transform_points(base, box_edges(center, size))
    pen.static(path, rr.LineStrips3D(edges, radii=0.0015, colors=color))


def box_edges(center: Array, size: Array) -> Array:
    """The twelve edges (12, 2, 3) of a box."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    pairs = [
        (corners[i], corners[j])
        for i, j in combinations(range(8), 2)
        if np.abs(corners[i] - corners[j]).sum() == 1
    ]
    return np.asarray(center + size * np.array(pairs))
