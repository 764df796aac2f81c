"""The robot in MuJoCo against own kinematics, linear programs, lowest points and hand-made rays."""

import logging

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import forward
from testbed.laboratory.simulator import Simulator, log_warning
from testbed.robots.catalog import Robot
from testbed.robots.meshes.files import load_mesh
from testbed.robots.placements import link_poses
from tests.fresh import python
from tests.reference import TX60_LIMITS, tx60

STATION = np.array([2.6, -2.0, 0.3])


def anywhere(m: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(*TX60_LIMITS.T, (m, 6))


def test_poses_are_those_of_the_chain_nominal_and_with_all_42_numbers_off(robot):
    rng, q = np.random.default_rng(1), anywhere(50)
    for k in range(21):
        chain = tx60().chain.moved(rng.normal(0, 0.1, 42) * (k > 0))
        for simulator in (Simulator(None, chain), Simulator(robot, chain)):
            # a few float64 roundings per joint; measured 2e-15
            np.testing.assert_allclose(simulator.poses(q), forward(chain, q), atol=1e-12)


def test_a_pose_does_not_depend_on_the_one_before(simulator):
    q = anywhere(20)
    again = simulator.poses(q[::-1])[::-1]
    np.testing.assert_array_equal(simulator.poses(q), again)
    np.testing.assert_array_equal(simulator.collides(q), simulator.collides(q[::-1])[::-1])


def hulls(robot: Robot) -> list[tuple[int, Array]]:
    """Link and hull vertices of each colliding part, in its link frame."""
    parts = []
    for visual in robot.visuals:
        if visual.collides:
            vertices = load_mesh(visual.file).vertices
            parts.append((visual.link, vertices[ConvexHull(vertices).vertices]))
    return parts


def share_a_point(a: Array, b: Array) -> bool:
    """Whether two convex hulls meet: weights u, v >= 0 with sum 1 and a'u = b'v exist."""
    if (a.min(0) > b.max(0)).any() or (b.min(0) > a.max(0)).any():
        return False
    equal = np.zeros((5, len(a) + len(b)))
    equal[:3, : len(a)], equal[:3, len(a) :] = a.T, -b.T
    equal[3, : len(a)] = equal[4, len(a) :] = 1
    answer = linprog(np.zeros(equal.shape[1]), A_eq=equal, b_eq=[0, 0, 0, 1, 1])
    return bool(answer.status == 0)


def test_self_collision_is_what_a_linear_program_over_the_hulls_says(robot, simulator):
    many = anywhere(600, seed=3)
    low = many[simulator.contacts(many).floor][:60]  # with and without a second contact
    parts, q = hulls(robot), np.concatenate([many[:60], low])
    found = simulator.contacts(q).itself
    for poses, itself in zip(link_poses(robot.model.chain, q), found, strict=True):
        placed = [
            (link, vertices @ poses[link, :3, :3].T + poses[link, :3, 3])
            for link, vertices in parts
        ]
        expected = any(
            share_a_point(a, b)
            for i, (first, a) in enumerate(placed)
            for second, b in placed[i + 1 :]
            if abs(first - second) > 1  # neighbors always touch and are excluded
        )
        assert itself == expected
    for part in (found[:60], found[60:]):
        assert 3 < part.sum() < 57  # both answers occur


def test_the_floor_is_hit_when_the_lowest_point_of_a_part_lies_below_it(robot, simulator):
    q = anywhere(400, seed=4)
    poses = link_poses(robot.model.chain, q)
    lowest = np.min(
        [
            (vertices @ poses[:, link, 2, :3].T + poses[:, link, 2, 3]).min(0)
            for link, vertices in hulls(robot)
            if link > 0  # the base stands on the floor
        ],
        axis=0,
    )
    clear = np.abs(lowest - robot.base_offset) > 1e-6  # MuJoCo keeps vertices in float32
    found = simulator.contacts(q).floor
    np.testing.assert_array_equal(found[clear], (lowest < robot.base_offset)[clear])
    assert 10 < found.sum() < 390


def blocked(triangles: Array, start: Array, end: Array) -> bool:
    """Whether the segment from start to end meets one of the triangles (t, 3, 3).

    Signed volumes: the line passes through a triangle if it turns the same way about its edges.
    """
    a, b, c = (triangles[:, k] - start for k in range(3))
    beam = end - start
    sides = [np.cross(x, y) @ beam for x, y in ((a, b), (b, c), (c, a))]
    through = (np.array(sides) >= 0).all(0) | (np.array(sides) <= 0).all(0)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (normal * a).sum(1) / (normal @ beam)
    return bool((through & (share > 0) & (share < 1 - 1e-3)).any())


def test_sight_is_what_hand_made_rays_through_every_triangle_say(robot, simulator):
    q, target = anywhere(150, seed=5), np.array([0.0, 0.0, 0.06])
    meshes = [
        (visual.link, load_mesh(visual.file))
        for visual in robot.visuals
        if visual.link < 6  # the body that carries the target is transparent
    ]
    found = simulator.sees(q, STATION, target)
    T = robot.model.poses(q)
    for poses, tool, seen in zip(link_poses(robot.model.chain, q), T, found, strict=True):
        triangles = np.concatenate(
            [
                (mesh.vertices @ poses[link, :3, :3].T + poses[link, :3, 3])[mesh.faces]
                for link, mesh in meshes
            ]
        )
        end = tool[:3, 3] + tool[:3, :3] @ target
        below = end[2] < robot.base_offset  # the floor hides it
        assert seen == (not below and not blocked(triangles, STATION, end))
    assert 10 < found.sum() < 140


def test_the_candle_hits_nothing_and_is_seen_from_above_but_not_from_behind_the_arm(simulator):
    q = np.zeros((1, 6))
    assert not simulator.collides(q).any()
    assert simulator.sees(q, [0.0, 0.02, 3.0], [0, 0, 0.06]).all()
    assert not simulator.sees(q, [0.0, 0.02, -0.3], [0, 0, 0.06]).any()


def test_the_view_of_a_target_moves_with_base_and_tool(robot):
    # the same room, seen from another world frame
    rng = np.random.default_rng(6)
    step = np.zeros(42)
    step[:6] = rng.normal(0, 0.5, 6)
    moved = tx60().chain.moved(step)
    q, T = anywhere(200, seed=7), moved.T_world_base
    here = Simulator(robot, tx60().chain)
    there = Simulator(robot, moved)
    station = T[:3, :3] @ STATION + T[:3, 3]
    np.testing.assert_array_equal(
        here.sees(q, STATION, np.zeros(3)), there.sees(q, station, np.zeros(3))
    )
    for a, b in zip(here.contacts(q), there.contacts(q), strict=True):
        np.testing.assert_array_equal(a, b)


def test_bare_kinematics_hits_nothing_and_hides_nothing():
    simulator, q = Simulator(None, tx60().chain), anywhere(100)
    assert not simulator.collides(q).any()
    assert simulator.sees(q, STATION, np.zeros(3)).all()


@pytest.mark.parametrize(
    ("q", "message"),
    [(np.zeros((3, 5)), "axis 1 should be 6"), ([[np.nan] * 6], r"q\[0, 0\] is nan")],
)
def test_wrong_joint_vectors_are_refused(simulator, q, message):
    for call in (
        simulator.poses,
        simulator.collides,
        lambda q: simulator.sees(q, STATION, np.zeros(3)),
    ):
        with pytest.raises(InputError, match=message):
            call(q)


def test_a_mujoco_warning_goes_to_the_log_and_leaves_no_file(tmp_path):
    code = (
        "import mujoco, numpy as np\n"
        "from calib.geometry.chain import Chain\n"
        "from testbed.laboratory.simulator import Simulator\n"
        "s = Simulator(None, Chain([[0, .3, .1, 0, 0]]))\n"
        "s._data.qpos[:] = np.nan\n"
        "mujoco.mj_step(s._model, s._data)\n"
    )
    done = python("-c", code, cwd=tmp_path)
    assert "MuJoCo: Nan, Inf or huge value in QPOS" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_warning_names_its_source(caplog):
    with caplog.at_level(logging.WARNING):
        log_warning("something")
    assert caplog.messages == ["MuJoCo: something"]
