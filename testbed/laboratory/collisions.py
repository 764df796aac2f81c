"""What a robot can hit in MuJoCo: the floor and the obstacles of its cell, and who meets whom."""

from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.laboratory.cell import Obstacle
from testbed.robots.meshes.files import Mesh
from testbed.robots.meshes.forms import form_mesh
from testbed.robots.parts import Form
from testbed.robots.placements import quaternion_wxyz
from testbed.robots.write.mjcf_parts import is_thick_box

ROBOT_BIT, FLOOR_BIT, OBSTACLE_BIT = 1, 2, 4
"""Collision bits: parts of the robot meet each other, the floor and the obstacles of the cell."""
FLOOR, ROOM_FLOOR = "floor", "floor of the room"
"""What the base stands on, and what is level below a base that hangs above it."""


def add_floor(spec: Any, name: str, T_world_floor: Array, margin: float) -> None:
    """Add a floor to a MuJoCo spec: parts of the robot nearer to it than `margin` [m] touch it.

    `T_world_floor` (4, 4) is its pose; z of the floor points up.
    """
    import mujoco

    for geom in spec.geoms:
        if geom.contype == ROBOT_BIT:
            geom.contype, geom.conaffinity = ROBOT_BIT, ROBOT_BIT | FLOOR_BIT
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        # half lengths within which rays meet it [m], and a grid; bodies meet it anywhere
        size=[10.0, 10.0, 0.1],
        pos=T_world_floor[:3, 3],
        quat=quaternion_wxyz(T_world_floor[:3, :3]),
        contype=FLOOR_BIT,
        conaffinity=0,
        margin=margin,
    )


def add_obstacle(spec: Any, obstacle: Obstacle, margin: float, *, hulls: bool) -> None:
    """Add an obstacle to a MuJoCo spec: parts of the robot nearer than `margin` [m] touch it.

    Where parts are plain shapes, boxes become `hulls` of their corners, as those of the robot do.
    """
    import mujoco

    for geom in spec.geoms:
        if geom.contype & ROBOT_BIT:
            geom.conaffinity |= OBSTACLE_BIT
    place = {
        "name": obstacle.name,
        "pos": obstacle.T_world_obstacle[:3, 3],
        "quat": quaternion_wxyz(obstacle.T_world_obstacle[:3, :3]),
        "contype": OBSTACLE_BIT,
        "conaffinity": 0,
        "mass": 0.0,
        "margin": margin,
    }
    form, mesh = Form("box", tuple(obstacle.size.tolist())), obstacle.mesh
    if mesh is None and hulls and is_thick_box(form):
        mesh = Mesh(*form_mesh(form))
    if mesh is None:
        size = obstacle.size / 2
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, **place)
        return
    spec.add_mesh(
        name=obstacle.name,
        uservert=mesh.vertices.ravel(),
        userface=mesh.faces.ravel().astype(np.int32),
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=obstacle.name, **place)
