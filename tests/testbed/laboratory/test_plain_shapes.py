"""Plain shapes in the simulator: what touches what and how near, against projections by hand."""

from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest

from calib.geometry.frames import exp_so3, slide, transform
from testbed.laboratory.cell import Obstacle
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot
from testbed.robots.parts import Form, Primitive
from testbed.robots.placements import link_poses

TURN, SLIDE = (-3.0, 3.0), (-0.6, 0.6)
FORMS = (
    Form("box", (0.2, 0.4, 0.1)),
    Form("cylinder", (0.08, 0.4)),
    Form("capsule", (0.07, 0.3)),
    Form("sphere", (0.12,)),
)
SINGLE = 1e-6
"""MuJoCo keeps the corners of hulls in single precision, and its distances to 1e-6 [m]."""


def nearest(form, T, points):
    """The points of a shape (m poses) that are nearest to some points (m, 3): by hand."""
    local = np.einsum("mji,mj->mi", T[:, :3, :3], points - T[:, :3, 3])
    if form.kind == "box":
        found = np.clip(local, -np.array(form.size) / 2, np.array(form.size) / 2)
    else:
        radius, *length = form.size
        core, half = np.zeros_like(local), sum(length) / 2
        core[:, 2] = np.clip(local[:, 2], -half, half)
        out = local - core
        if form.kind == "cylinder":
            out[:, 2] = 0.0
        size = np.linalg.norm(out, axis=1, keepdims=True)
        found = core + out * np.minimum(1.0, radius / np.maximum(size, 1e-300))
    return np.einsum("mij,mj->mi", T[:, :3, :3], found) + T[:, :3, 3]


def distances(one, T_one, other, T_other, steps=1500):
    """Bounds (2, m) of the distances of two convex shapes, above zero only where they are apart.

    Points projected on each in turn come to the nearest two: Cheney, Goldstein, Proc. AMS 10, 1959,
    448-450. No distance is larger than theirs, none smaller than the gap across their line.
    """
    a = T_one[:, :3, 3]
    for _ in range(steps):
        b = nearest(other, T_other, a)
        a = nearest(one, T_one, b)
    most = np.linalg.norm(b - a, axis=1)
    n = (b - a) / np.maximum(most, 1e-300)[:, None]
    gap = np.einsum("mi,mi->m", n, T_other[:, :3, 3] - T_one[:, :3, 3])
    for form, T in ((one, T_one), (other, T_other)):
        gap -= [form.support(R.T @ d) for R, d in zip(T[:, :3, :3], n, strict=True)]
    return np.maximum(gap, 0.0), most


def gantry(tmp_path):
    """A URDF of three slides and three turns, without any shape."""
    joints = [("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")]
    kinds = [*((n, "prismatic", axis, SLIDE) for n, axis in joints),
             *((f"r{n}", "revolute", axis, TURN) for n, axis in joints)]  # fmt: skip
    text, parent = ['<robot name="gantry"><link name="base"/>'], "base"
    for name, kind, axis, (low, high) in kinds:
        text.append(
            f'<link name="{name}l"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{name}l"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'
        )
        parent = f"{name}l"
    path = tmp_path / "gantry.urdf"
    path.write_text("".join(text) + "</robot>")
    return load_robot(path)


def part(form, link, T):
    place = tuple(map(tuple, T))
    return Primitive((0.5, 0.5, 0.5), True, link, f"{form.kind}{link}", place, form=form)


PLACE = transform(exp_so3(np.array([0.3, -0.7, 0.4])), np.array([0.02, -0.05, 0.04]))


MISSED = (-0.041, -0.161, -0.281, -1.182, -2.516, -1.565)
"""Here the corner of a box is 15 mm from a wall, and MuJoCo's own test finds it 30 mm away."""


def placed(robot, rng, many):
    """Postures (m, 6), many square, many near the middle, and where body 6 is at them."""
    q = np.hstack([rng.normal(size=(many, 3)) * 0.15, rng.uniform(-3, 3, (many, 3))])
    q[::2, 3:] = np.round(q[::2, 3:] / (np.pi / 2)) * np.pi / 2
    q[::3, :3] *= 0.2
    q[-1] = MISSED
    return q, link_poses(robot.model.chain, q)[:, 6]


@pytest.mark.parametrize(
    ("one", "other"), [*combinations_with_replacement(FORMS, 2)], ids=lambda form: form.kind
)
def test_two_plain_shapes_touch_where_their_nearest_points_meet(one, other, tmp_path):
    """Deep inside each other, too, where MuJoCo's own test of a capsule in a box finds nothing."""
    robot = gantry(tmp_path)
    robot = replace(
        robot, primitives=(part(one, 0, PLACE), part(other, 6, np.eye(4))), base_offset=-9.0
    )
    q, T = placed(robot, np.random.default_rng(1), 400)
    frames = link_poses(robot.model.chain, q)[:, 0]
    least, most = distances(one, frames @ PLACE, other, T)
    apart, meet = least > SINGLE, most < 1e-9
    sure = apart | meet  # what barely touches converges too slowly to tell
    hit = Simulator(robot, robot.model.chain).contacts(q).itself
    assert 40 < meet.sum() < 360
    assert sure.sum() > 380
    np.testing.assert_array_equal(hit[sure], meet[sure])


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.kind)
def test_a_plain_shape_keeps_its_clearance_from_box_and_floor(form, tmp_path):
    robot = replace(gantry(tmp_path), primitives=(part(form, 6, PLACE),), base_offset=-0.5)
    wall, clearance = Form("box", (0.6, 0.6, 0.04)), 0.03
    chain = robot.model.chain
    obstacle = Obstacle("obstacle 1", PLACE @ slide(0.1, 0.0, 0.0), np.array(wall.size))
    q, T = placed(robot, np.random.default_rng(2), 400)
    T = T @ PLACE
    there = np.broadcast_to(obstacle.T_world_obstacle, T.shape)
    least, most = distances(form, T, wall, there)
    # the floor lies across the z axis of the base, wherever that points
    ground = chain.T_world_base @ slide(0.0, 0.0, robot.base_offset)
    up = ground[:3, 2]
    below = np.array([form.support(R.T @ up) for R in T[:, :3, :3]])
    above = (T[:, :3, 3] - ground[:3, 3]) @ up - below
    least, most = np.minimum(least, above), np.minimum(most, above)
    simulator = Simulator(robot, chain, (obstacle,), clearance=clearance)
    sure = (least > clearance + SINGLE) | (most < clearance - SINGLE)
    assert ((most < clearance) & (least > SINGLE)).sum() > 20
    assert sure.sum() > 390
    np.testing.assert_array_equal(simulator.collides(q)[sure], most[sure] < clearance)
    free, found = least > SINGLE, simulator.clearances(q, most=5.0)
    assert free.sum() > 60
    assert (found[free] > least[free] - SINGLE).all()
    assert (found[free] < most[free] + SINGLE).all()
    assert np.median(most[free] - least[free]) < 1e-9  # the bounds are narrow
    assert (found[most < 1e-9] < SINGLE).all()
