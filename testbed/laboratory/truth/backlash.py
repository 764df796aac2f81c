"""Play between a drive and its joint, and the load of gravity that may decide its side."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.catalog import Robot
from testbed.robots.placements import link_poses
from testbed.scenario.laboratory import TruthSettings

GRAVITY = 9.81
"""Along minus z of the world [m/s^2]."""
SAMPLE = 2000
"""Postures in the joint limits at which the largest load of a joint is looked up."""
STEEPNESS = 20.0
"""How soon a load decides the side of the play: tanh of this times its share of the largest."""
Side = Literal["approach", "load", "posture"]


@dataclass(frozen=True, slots=True, eq=False)
class Backlash:
    """Play between drive and joint: dq = half_width * side, the side from -1 to 1."""

    robot: Robot
    """Nominal; gravity pulls at its bodies."""
    half_width: Array
    """(n,) half of the play of each joint [rad or m]."""
    side: Side
    """What decides on which side a joint rests."""
    largest: Array
    """(n,) largest load of each joint, where gravity decides; else (0,) [N m or N]."""

    def offsets(self, q: Array, previous: Array) -> Array:
        """Joint offsets (m, n) at q (m, n), reached by a straight move from `previous` (m, n)."""
        return np.asarray(self.half_width * self.sides(q, previous))

    def sides(self, q: Array, previous: Array) -> Array:
        """Where in its play each joint rests (m, n): -1 to 1; 0 for one that nothing pushes."""
        if self.side == "approach":
            return np.sign(q - previous)
        if self.side == "posture":
            side = np.zeros_like(q)
            side[:, 2] = np.tanh(STEEPNESS * np.sin(q[:, 1] + q[:, 2]))
            side[:, 4] = np.sign(np.cos(q[:, 3]) * np.sin(q[:, 4]))
            return side
        load = gravity_loads(self.robot.model.chain, self.robot.masses, self.robot.centers, q)
        felt = self.largest > 1e-9 * max(self.largest.max(), 1e-9)
        return np.where(felt, np.tanh(STEEPNESS * load / np.where(felt, self.largest, 1.0)), 0.0)


def backlash(robot: Robot, truth: TruthSettings, half_width: Array) -> Backlash:
    """The play of a robot, with what its side depends on."""
    if truth.backlash_side != "load":
        return Backlash(robot, half_width, truth.backlash_side, np.zeros(0))
    chain, (low, high) = robot.model.chain, robot.limits.T
    # a fixed sample: the largest load belongs to the robot, not to a seed
    q = np.random.default_rng(0).uniform(low, high, (SAMPLE, len(low)))
    largest = np.abs(gravity_loads(chain, robot.masses, robot.centers, q)).max(axis=0)
    return Backlash(robot, half_width, "load", largest)


def gravity_loads(chain: Chain, masses: Array, centers: Array, q: Array) -> Array:
    """Torque (or force) of gravity on each joint (m, n), along its axis [N m or N].

    Parameters
    ----------
    chain : Chain
        Geometry of the bodies.
    masses : (n,) array
        Of the bodies [kg].
    centers : (n, 3) array
        Centers of mass in the body frames [m].
    q : (m, n) array
        Joint values [rad, m].
    """
    bodies = link_poses(chain, q)[:, 1:]
    axes, origins = bodies[:, :, :3, 2], bodies[:, :, :3, 3]
    places = origins + (bodies[:, :, :3, :3] @ centers[:, :, None])[..., 0]
    weights = np.array([0.0, 0.0, -GRAVITY]) * masses[:, None]
    out = np.empty_like(q)
    for i in range(q.shape[1]):
        if chain.kinds[i] == "prismatic":
            out[:, i] = axes[:, i] @ weights[i:].sum(axis=0)
        else:
            arms = places[:, i:] - origins[:, i, None]
            out[:, i] = (np.cross(arms, weights[i:]).sum(axis=1) * axes[:, i]).sum(axis=1)
    return out
