"""The cell in a recording: robot, exaggerated true ghost, tracker and beam, candidate poses."""

from collections.abc import Mapping
from functools import cache
from itertools import combinations, product

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse, rot_y, rot_z, slide
from calib.geometry.jacobian import pose_and_jacobian
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.measurement.accuracy import target_points
from testbed.recording.pen import Color, Pen, Timeline, Writer
from testbed.recording.story import Story, nice_factor
from testbed.robots.catalog import Robot, Visual, load_tracker_visuals
from testbed.robots.meshes.files import Mesh, part_mesh
from testbed.robots.placements import joint_motion, placements

GHOST_SIZE = 0.036
"""Mean drawn deviation of the ghost before calibration [m]: seen, and still a robot."""
GHOST_COLOR = (222, 60, 50, 110)
GHOST_SKIN = 0.002
"""The ghost is drawn thinner by this [m]: where it does not deviate it stays inside the robot."""
POOL_COLOR, REJECTED_COLOR, CHOSEN_COLOR = (120, 132, 146), (206, 150, 146), (28, 92, 190)
BEAM_COLOR = (225, 30, 30, 230)


@cache
def mesh(visual: Visual) -> Mesh:
    """A part's mesh, read once: robot and ghost share it."""
    return part_mesh(visual)


def draw_robot(writer: Writer, robot: Robot) -> None:
    """The robot as its maker describes it, moving through the whole story."""
    chain, story = writer.story.setting.nominal.chain, writer.story
    draw_arm(writer, "world/robot", robot, story.q, (chain,), np.zeros(story.n_steps, np.int64))


def draw_ghost(writer: Writer, robot: Robot) -> int:
    """The true robot with its deviation from the model in use drawn `factor` times; the factor.

    Until identification the model in use is the nominal one; while the solver works the ghost
    closes in on what the identified model still leaves.
    """
    story = writer.story
    factor = nice_factor(GHOST_SIZE, float(story.estimate.comparison.before.mean()))
    known, index = np.unique(story.known, return_inverse=True)
    chains = ghost_chains(story, factor, known)
    true, identified = story.setting.true, story.estimate.identification.model
    q = story.q + factor * (
        true.joint_errors.offsets(story.q)
        - story.known[:, None] * identified.joint_errors.offsets(story.q)
    )
    path = f"world/true_x{factor}"
    draw_arm(writer, path, robot, q, chains, index.reshape(-1), GHOST_COLOR)
    return factor


def ghost_chains(story: Story, factor: int, known: Array) -> tuple[Chain, ...]:
    """Nominal chain moved by `factor` times what is left of the truth at each value of `known`."""
    nominal = story.setting.nominal.chain
    before = nominal.step_to(story.setting.true.chain)
    identified = story.estimate.identification.model.chain
    q = np.vstack([story.trial.measurements.q, story.setting.test_q])
    after = smallest_equal(nominal, before - nominal.step_to(identified), q)
    return tuple(nominal.moved(factor * ((1 - w) * before + w * after)) for w in known)


def smallest_equal(chain: Chain, step: Array, q: Array) -> Array:
    """Smallest step (42,) that moves the tool at q as `step` does, to first order [m, rad].

    Two models may describe the same robot with different numbers; what differs only in that would
    otherwise be drawn as links out of place.
    """
    _, J = pose_and_jacobian(chain, q)
    length = CHARACTERISTIC_LENGTH
    rows = np.array([1, 1, 1, length, length, length])
    frame, link = (
        (1, 1, 1, 1 / length, 1 / length, 1 / length),
        (1 / length, 1, 1) + (1 / length,) * 2,
    )
    columns = np.array([*frame, *(link * chain.n_joints), *frame])
    A = (J * rows[:, None] * columns).reshape(-1, len(columns))
    return np.asarray(columns * np.linalg.lstsq(A, A @ (step / columns), rcond=1e-9)[0])


def draw_arm(
    writer: Pen[Timeline],
    root: str,
    robot: Robot,
    q: Array,
    chains: tuple[Chain, ...],
    which: np.ndarray[tuple[int], np.dtype[np.int64]],
    color: Color | None = None,
) -> None:
    """Parts of an arm on nested link entities; at step k the arm is chains[which[k]] at q[k].

    The last body carries the drawn tool in its nominal place, so it takes over what the chain
    differs behind the last joint: the drawn tool is where the chain says.
    """
    nominal, placed = placements(robot.model.chain), [placements(chain) for chain in chains]
    frames = np.array([one.frames for one in placed])
    last = np.array([one.tool @ inverse(nominal.tool) for one in placed])
    bases = np.array([chain.T_world_base for chain in chains])
    constant = len(chains) == 1
    writer.transforms(f"{root}/base", bases[0] if constant else bases[which])
    paths, path, n = [f"{root}/base"], root, q.shape[1]
    for joint in range(n):
        path += f"/link{joint + 1}"
        paths.append(path)
        T = frames[which, joint] @ joint_motion(chains[0], joint, q[:, joint])
        writer.transforms(path, T @ last[which] if joint == n - 1 else T)
    _draw_parts(writer, dict(enumerate(paths)), robot.visuals, color)


def _draw_parts(
    writer: Pen[Timeline],
    paths: Mapping[int, str],
    visuals: tuple[Visual, ...],
    color: Color | None = None,
) -> None:
    """Meshes below the entities of their links, in their own color or, as a ghost, in one."""
    import rerun as rr

    skin = GHOST_SKIN if color else 0.0
    for visual in visuals:
        part = mesh(visual)
        writer.static(
            f"{paths[visual.link]}/{visual.name}",
            rr.Mesh3D(
                vertex_positions=part.vertices - skin * part.normals,
                triangle_indices=part.faces,
                vertex_normals=part.normals,
                albedo_factor=color or (*(round(255 * value) for value in visual.rgb), 255),
            ),
        )


def draw_tracker(writer: Writer, robot: Robot) -> None:
    """The tracker at its station, looking at the target; the beam while it measures."""
    setting, measure = writer.story.setting, writer.story.phase("measure")
    target = target_points(setting.nominal.poses(writer.story.q), setting.target)
    floor = floor_height(setting.nominal.chain, robot)
    draw_station(writer, setting.T_world_tracker, target, floor)
    draw_beam(writer, setting.T_world_tracker, target, measure.start, measure.stop)


def draw_station(writer: Pen[Timeline], station: Array, target: Array, floor: float) -> None:
    """A tracker at its station (4, 4), its head on a target (s, 3) at every step [m]."""
    import rerun as rr

    x, y, z = (target @ station[:3, :3] - station[:3, 3] @ station[:3, :3]).T
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    writer.transforms("world/tracker", station)
    writer.transforms("world/tracker/yoke", np.array([rot_z(angle) for angle in azimuth]))
    writer.transforms("world/tracker/yoke/head", np.array([rot_y(-angle) for angle in elevation]))
    visuals = load_tracker_visuals()
    names = ("world/tracker/stand", "world/tracker/yoke", "world/tracker/yoke/head")
    _draw_parts(writer, dict(enumerate(names)), visuals)
    foot = min(float(mesh(visual).vertices[:, 2].min()) for visual in visuals)
    height = station[2, 3] + foot - floor
    if height > 1e-3:  # a station above the stand's own height needs something to stand on
        writer.static(
            "world/tracker/plinth",
            rr.Boxes3D(
                centers=[0, 0, foot - height / 2],
                sizes=[0.6, 0.6, height],
                colors=[176, 182, 188],
                fill_mode="solid",
            ),
        )


def draw_beam(writer: Pen[Timeline], station: Array, target: Array, start: int, stop: int) -> None:
    """The beam from the station (4, 4) to the target (s, 3) from one step to another [m]."""
    import rerun as rr

    beam = [[[station[:3, 3], point]] for point in target[start:stop]]
    writer.every_step("world/beam", rr.LineStrips3D.columns(strips=beam), np.arange(start, stop))
    writer.static("world/beam", rr.LineStrips3D.from_fields(radii=0.0022, colors=BEAM_COLOR))
    writer.clear(stop, ["world/beam"])


def floor_height(chain: Chain, robot: Robot) -> float:
    """Height of the floor in the world [m]."""
    return float((chain.T_world_base @ slide(0, 0, robot.base_offset))[2, 3])


def draw_pool(writer: Writer, box_center: Array, box_size: Array) -> None:
    """Candidate tool positions, those refused inside the box, the box, and the chosen set.

    Parameters
    ----------
    writer : Writer
        Where to.
    box_center, box_size : (3,) array
        The workspace box in the base frame [m].
    """
    import rerun as rr

    story = writer.story
    setting, select, identify = story.setting, story.phase("select"), story.phase("identify")
    pool = setting.pool_nominal[:, :3, 3]
    writer.static("world/pool", rr.Points3D(pool, radii=0.0028, colors=POOL_COLOR))
    draw_box(writer, "world/box", setting.nominal.chain, box_center, box_size)
    outside = setting.rejection_names[0] if setting.rejection_names else ""
    inside = [k for k, reason in enumerate(setting.rejected_reason) if reason != outside]
    if inside:
        refused = setting.nominal.poses(setting.rejected_q[inside])[:, :3, 3]
        writer.at(
            select.start, "world/rejected", rr.Points3D(refused, radii=0.004, colors=REJECTED_COLOR)
        )
        writer.clear(select.stop, ["world/rejected"])
    chosen = pool[story.trial.selection.indices]
    path = "world/chosen"
    writer.at(int(select.at[-1]), path, rr.Points3D(chosen))
    writer.static(path, rr.Points3D.from_fields(radii=0.009, colors=CHOSEN_COLOR))
    writer.clear(identify.stop, [path])


def draw_box(
    writer: Pen[Timeline],
    path: str,
    chain: Chain,
    center: Array,
    size: Array,
    color: Color = (*POOL_COLOR, 150),
) -> None:
    """The edges of a box given in the base frame of `chain` [m]."""
    import rerun as rr

    base = chain.T_world_base
    edges = box_edges(center, size) @ base[:3, :3].T + base[:3, 3]
    writer.static(path, rr.LineStrips3D(edges, radii=0.0015, colors=color))


def box_edges(center: Array, size: Array) -> Array:
    """The twelve edges (12, 2, 3) of a box."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    pairs = [
        (corners[i], corners[j])
        for i, j in combinations(range(8), 2)
        if np.abs(corners[i] - corners[j]).sum() == 1
    ]
    return np.asarray(center + size * np.array(pairs))
