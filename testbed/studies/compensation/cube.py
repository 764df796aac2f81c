"""The five poses of ISO 9283 in its cube, and joint values that reach them."""

from typing import Protocol

import numpy as np

from calib.arrays import Array
from calib.errors import InputError, refuse
from calib.geometry.frames import exp_so3, transform
from calib.geometry.inverse import inverse_kinematics, spread
from testbed.faults import Fault
from testbed.laboratory.cell import cell_from
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import Robot
from testbed.scenario.laboratory import CellSettings

FROM_CORNER = 0.1
"""Poses 2 to 5 lie this share of the diagonal away from their corners."""
STARTS = 32


class Cube(Protocol):
    """The cube as [compensation] states it."""

    @property
    def center_mm(self) -> tuple[float, float, float]:
        """Center of the cube, base frame."""

    @property
    def side_mm(self) -> float:
        """Length of its edges."""

    @property
    def turn_deg(self) -> tuple[float, float, float]:
        """Orientation of the tool: rotation vector, base frame."""


def cube_poses(settings: Cube, T_world_base: Array) -> Array:
    """Tool poses (5, 4, 4) in the world [m]: the center, then four on the diagonals of a plane.

    The plane contains y edges of the cube and rises toward the front of the robot: poses 2 and 3
    are high in front, 4 and 5 low behind.

    References
    ----------
    ISO 9283: poses P1 to P5 of the test plane C1-C2-C7-C8, at (10 +- 2) % of the diagonals.
    """
    h = settings.side_mm / 2e3 * (1 - 2 * FROM_CORNER)
    place = np.array([[0, 0, 0], [h, -h, h], [h, h, h], [-h, h, -h], [-h, -h, -h]])
    turn = exp_so3(np.radians(settings.turn_deg))
    T = transform(np.broadcast_to(turn, (5, 3, 3)), place + np.array(settings.center_mm) / 1e3)
    return np.asarray(T_world_base @ T)


def cube_joints(robot: Robot, simulator: Simulator, T: Array) -> Array:
    """Joint targets (5, n) of the nominal robot: all five in one configuration [rad, m].

    Raises
    ------
    InputError
        A pose is out of reach, nearly singular, or makes the robot hit something.
    """
    n, limits = len(robot.limits), robot.limits
    starts = np.broadcast_to(spread(limits, STARTS), (STARTS, n))
    first = inverse_kinematics(robot.model, np.broadcast_to(T[0], (STARTS, 4, 4)), starts, limits)
    ways = first.q[np.array([one == "reached" for one in first.status])]
    ways = ways[robot.controller.allows(ways)]
    ways = ways[~simulator.collides(ways)] if len(ways) else ways
    if not len(ways):
        raise _unfit(T[0], 1)
    # every configuration at the center, continued to the other four poses
    best, score = None, np.inf
    for way in np.unique(ways.round(9), axis=0):
        seeds = np.broadcast_to(way, (len(T), n))
        found = inverse_kinematics(robot.model, T, seeds, limits, whole_turns=False)
        sound = all(one == "reached" for one in found.status)
        sound = sound and bool(robot.controller.allows(found.q).all())
        if sound and found.condition.max() < score and not simulator.collides(found.q).any():
            best, score = found.q, float(found.condition.max())
    if best is not None:
        return best
    seeds = np.broadcast_to(ways[0], (len(T), n))
    found = inverse_kinematics(robot.model, T, seeds, limits, whole_turns=False)
    wrong = [k for k, one in enumerate(found.status) if one != "reached"]
    raise _unfit(T[wrong[0]] if wrong else T[1], wrong[0] + 1 if wrong else 2)


def _unfit(T: Array, number: int) -> InputError:
    """Error for a pose that the robot cannot take."""
    x, y, z = T[:3, 3] * 1e3
    return refuse(
        "compensation.center_mm",
        number,
        code="S37",
        message=f"[compensation] pose {number} of the cube at ({x:.0f}, {y:.0f}, {z:.0f}) mm "
        "cannot be taken in one configuration with the others, without hitting something",
        fix="move center_mm, choose a smaller side_mm, or turn the tool with turn_deg",
    )


def cube_fault(settings: Cube, cell: CellSettings, robot: Robot) -> Fault | None:
    """Fault if the robot cannot reach the cube, found before anything is played; else None."""
    chain, held = robot.model.chain, robot.controller.held
    if held:
        message = f"[compensation] moves each joint by itself, and joint {held[0] + 1} is held"
        fix = "write robots = 0 there, or take the statement out of [controller] of the robot"
        return Fault(("compensation",), message, fix=fix)
    try:
        simulator = Simulator(robot, chain, cell_from(cell, chain))
        cube_joints(robot, simulator, cube_poses(settings, chain.T_world_base))
    except InputError as error:
        path = tuple(error.field.split("."))
        return Fault(path, error.message, error.code, error.allowed, error.fix, error.value)
    return None
