"""Obstacles: the robot must not touch them, no beam passes them, boxes and meshes alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import inverse, rot_z, slide, step_transform
from testbed.laboratory.cell import Obstacle, cell_from
from testbed.laboratory.pool import OBSTACLE, REASONS, Candidates, PosePool
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.scenario.laboratory import BoxObstacle, CellSettings, MeshObstacle
from testbed.scenario.tables import PoolSettings
from tests.reference import TX60_LIMITS

STATION, AIM = np.array([2.6, -2.0, 0.3]), np.array([0.0, 0.0, 0.06])
PLACE = {"position_mm": (450.0, -200.0, 100.0), "rotation_vector_deg": (10.0, -20.0, 30.0)}
SIZE = np.array([300.0, 200.0, 400.0])
BOX = BoxObstacle(size_mm=tuple(SIZE), **PLACE)


def simulator(robot: Robot, *obstacles: BoxObstacle | MeshObstacle) -> Simulator:
    chain = robot.model.chain
    return Simulator(robot, chain, cell_from(CellSettings(obstacle=obstacles), chain))


def anywhere(m: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(*TX60_LIMITS.T, (m, 6))


def box_file(path: Path, size: Array) -> Path:
    """A box as an OBJ of twelve triangles, centered at its origin."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    lines = [f"v {x * size[0] / 2} {y * size[1] / 2} {z * size[2] / 2}" for x, y, z in corners]
    for face in faces:
        a, b, c, d = face.split()
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_nothing_is_seen_from_below_the_floor(robot):
    q = anywhere(50)
    chain, floor = robot.model.chain, robot.base_offset
    cell = simulator(robot)
    below = chain.T_world_base @ [1.5, 0.0, floor - 0.01, 1.0]
    assert cell.above_floor(below[:3]) == pytest.approx(-0.01)
    assert not cell.sees(q, below[:3], AIM).any()
    assert cell.sees(q, below[:3] + np.array([0.0, 0.0, 0.02]), AIM).any()


def test_a_clearance_keeps_the_robot_as_far_from_floor_and_box_as_it_says(robot):
    """The distance is that of another search than the contact's, and the base may stand on both."""
    q, chain = anywhere(2000), robot.model.chain
    cell = cell_from(CellSettings(obstacle=(BOX,)), chain)
    distance = Simulator(robot, chain, cell).clearances(q, most=0.3)
    for clearance in (0.0, 0.01, 0.1):
        hit = Simulator(robot, chain, cell, clearance=clearance).contacts(q)
        np.testing.assert_array_equal(hit.floor | hit.obstacle, distance < clearance)
    assert ((distance > 0) & (distance < 0.01)).sum() > 5
    # the hulls of the robot itself are not inflated
    own = [Simulator(robot, chain, cell, clearance=c).contacts(q).itself for c in (0.0, 0.1)]
    np.testing.assert_array_equal(*own)
    # the foot stands on the floor
    home = Simulator(robot, chain, clearance=0.1).contacts(np.zeros((1, 6)))
    assert not np.concatenate(home).any()


def crosses(start: Array, end: Array, obstacle: Obstacle) -> np.ndarray:
    """Whether segments (m, 3) from one start meet a box: slabs, a second way to the same answer."""
    T = inverse(obstacle.T_world_obstacle)
    a, b = T[:3, :3] @ start + T[:3, 3], end @ T[:3, :3].T + T[:3, 3]
    with np.errstate(divide="ignore"):
        low, high = (-obstacle.size / 2 - a) / (b - a), (obstacle.size / 2 - a) / (b - a)
    enter, leave = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    return (enter < leave) & (leave > 0) & (enter < 1)


def test_an_obstacle_stands_where_the_base_frame_puts_it(robot):
    moved = replace(robot.model.chain, T_world_base=slide(1.0, -2.0, 0.5) @ rot_z(1.0))
    (one,) = cell_from(CellSettings(obstacle=(BOX,)), moved)
    turn = np.radians(PLACE["rotation_vector_deg"])
    expected = step_transform(np.concatenate([[0.45, -0.2, 0.1], turn]))
    np.testing.assert_allclose(one.T_world_obstacle, moved.T_world_base @ expected, atol=1e-15)
    np.testing.assert_array_equal(one.size, SIZE / 1e3)
    assert one.name == "obstacle 1"


def test_a_box_hides_exactly_the_targets_behind_it(robot):
    wall = BoxObstacle(
        size_mm=(100.0, 300.0, 350.0),
        position_mm=(1500.0, -1100.0, 250.0),
        rotation_vector_deg=(5.0, 10.0, -30.0),
    )
    q = anywhere(1000)
    (obstacle,) = cell_from(CellSettings(obstacle=(wall,)), robot.model.chain)
    free, walled = simulator(robot), simulator(robot, wall)
    T = robot.model.poses(q)
    behind = crosses(STATION, T[:, :3, 3] + T[:, :3, :3] @ AIM, obstacle)
    np.testing.assert_array_equal(
        walled.sees(q, STATION, AIM), free.sees(q, STATION, AIM) & ~behind
    )
    assert 0.1 < behind.mean() < 0.9


def test_the_probe_inside_a_box_is_a_collision_and_far_from_it_none(robot):
    q = anywhere(2000)
    walled, free = simulator(robot, BOX), simulator(robot)
    (obstacle,) = walled.obstacles
    T = inverse(obstacle.T_world_obstacle)
    local = robot.model.poses(q)[:, :3, 3] @ T[:3, :3].T + T[:3, 3]
    inside = (np.abs(local) < obstacle.size / 2).all(axis=1)
    assert inside.sum() > 20
    found, before = walled.contacts(q), free.contacts(q)
    assert found.obstacle[inside].all()
    # what was found before is found still, and an obstacle is nothing else
    np.testing.assert_array_equal(found.itself, before.itself)
    np.testing.assert_array_equal(found.floor, before.floor)
    np.testing.assert_array_equal(walled.collides(q), found.itself | found.floor | found.obstacle)
    assert not before.obstacle.any()
    far = BOX.model_copy(update={"position_mm": (5000.0, 0.0, 500.0)})
    assert not simulator(robot, far).contacts(q).obstacle.any()


def test_a_mesh_of_a_box_is_the_box(robot, tmp_path):
    q = anywhere(1000, 3)
    as_box = simulator(robot, BOX)
    for unit, scale in (("mm", 1.0), ("m", 1e-3)):
        file = box_file(tmp_path / f"{unit}.obj", SIZE * scale)
        as_mesh = simulator(robot, MeshObstacle(file=str(file), unit=unit, **PLACE))
        mesh, box = as_mesh.contacts(q).obstacle, as_box.contacts(q).obstacle
        # two collision algorithms may differ where parts only graze: a few in a thousand
        assert (mesh != box).mean() <= 0.003
        assert 0.05 < box.mean() < 0.9
        np.testing.assert_array_equal(as_mesh.sees(q, STATION, AIM), as_box.sees(q, STATION, AIM))


def test_a_hollow_mesh_lets_the_beam_through_but_collides_as_its_hull(robot, tmp_path):
    # two plates 1 m apart as one mesh: the beam passes between them, the hull fills the gap
    plate = box_file(tmp_path / "plate.obj", np.array([20.0, 2000.0, 2000.0])).read_text()
    lines, lifted = plate.splitlines(), []
    for line in lines:
        head, *rest = line.split()
        if head == "v":
            lifted.append(f"v {float(rest[0]) + 3000.0} {rest[1]} {rest[2]}")
        else:
            lifted.append(" ".join([head, *(str(int(k) + 8) for k in rest)]))
    file = tmp_path / "pair.obj"
    file.write_text("\n".join([*lines, *lifted]) + "\n")
    pair = simulator(robot, MeshObstacle(file=str(file), position_mm=(-1500.0, 0.0, 500.0)))
    q = np.zeros((1, 6))
    assert pair.contacts(q).obstacle.all()
    above = np.array([0.1, 0.0, 3.0])
    assert pair.sees(q, above, AIM).all() == simulator(robot).sees(q, above, AIM).all()
    assert simulator(robot).sees(q, above, AIM).all()


def test_a_table_the_robot_stands_on_is_no_collision_of_its_base(robot):
    table = BoxObstacle(
        size_mm=(600.0, 600.0, 50.0), position_mm=(0.0, 0.0, robot.base_offset * 1e3 + 25.0)
    )
    assert not simulator(robot, table).collides(np.zeros((1, 6))).any()


def drawn(robot: Robot, sim: Simulator, **settings) -> PosePool:
    candidates = Candidates(robot, sim, PoolSettings(**settings), STATION, aim=AIM)
    return candidates.draw(np.random.default_rng(5))


def test_the_pool_stays_out_of_obstacles_and_says_how_many_it_lost(robot):
    walled = simulator(robot, BOX)
    pool, free = drawn(robot, walled, size=200), drawn(robot, simulator(robot), size=200)
    assert not walled.collides(pool.q).any()
    assert REASONS[OBSTACLE] not in free.rejection_names
    k = pool.rejection_names.index("obstacle")
    assert pool.rejection_counts[k] > 20
    assert len(pool.q) + pool.rejection_counts.sum() == pool.n_drawn
    lost = pool.rejected_q[[name == "obstacle" for name in pool.rejected_reason]]
    assert walled.contacts(lost).obstacle.all()
    # obstacles only take away: what is kept comes in the same order as without them
    kept = [row.tobytes() for row in pool.q]
    without = [row.tobytes() for row in free.q if row.tobytes() in set(kept)]
    assert without == kept[: len(without)]


def test_obstacles_count_even_where_the_robot_may_pass_through_itself(robot):
    walled = simulator(robot, BOX)
    pool = drawn(robot, walled, size=100, self_collision=False)
    assert not walled.contacts(pool.q).obstacle.any()
    assert walled.contacts(pool.q).itself.any()


def test_a_cell_full_of_obstacle_says_so(robot):
    block = BoxObstacle(size_mm=(3000.0, 3000.0, 3000.0), position_mm=(1510.0, 0.0, 0.0))
    box = {"box_center_mm": (450.0, 0.0, 200.0), "box_size_mm": (200.0,) * 3}
    with pytest.raises(InputError, match=r'"obstacle" rejects .*\[\[cell\.obstacle\]\]'):
        drawn(robot, simulator(robot, block), size=50, **box)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such mesh file"),
        ("v 0 0 0\n", "has no faces|cannot be read"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n", "is flat"),
    ],
)
def test_a_mesh_that_is_no_body_is_refused_by_its_file(robot, tmp_path, content, message):
    file = tmp_path / "thing.obj"
    if content:
        file.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        simulator(robot, MeshObstacle(file=str(file)))
    assert str(file) in str(caught.value)
