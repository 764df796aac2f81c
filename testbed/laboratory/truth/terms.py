"""What the true robot does beyond its model: play, warmth, springs, motion; and the switches."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.catalog import Robot
from testbed.robots.placements import link_poses
from testbed.scenario.laboratory import TruthSettings

REFERENCE = 20.0
"""Temperature at which lengths are those of a drawing (ISO 1) [degC]."""
GRAVITY = 9.81
"""Along minus z of the world [m/s^2]."""
SAMPLE = 2000
"""Postures in the joint limits at which the largest load of a joint is looked up."""
STEEPNESS = 20.0
"""How soon a load decides the side of the play: tanh of this times its share of the largest."""
Side = Literal["approach", "load", "posture"]

TERM_KEYS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "geometry": {"angle_sd_deg": 0.0, "length_sd_mm": 0.0},
        "frames": {"frame_sd_mm": 0.0, "frame_sd_deg": 0.0},
        "gravity": {"gravity_mdeg": (0.0, 0.0, 0.0)},
        "harmonics": {"harmonic_mdeg": 0.0},
        "high_harmonics": {"high_harmonic_mdeg": 0.0},
        "transmission": {"transmission_mdeg": 0.0},
        "encoder": {"encoder_mdeg": 0.0},
        "gear": {"gear_mdeg": 0.0},
        "backlash": {"backlash_mdeg": 0.0},
        "thermal": {"thermal_k": 0.0},
        "elastic": {
            "drive_nm_per_mrad": (),
            "bearing_nm_per_mrad": (),
            "payload_kg": 0.0,
            "payloads_kg": (),
        },
        "motion": {"motion": False},
        "repeatability": {"joint_repeatability_mdeg": 0.0},
    }
)
"""The terms of the truth and the keys of [truth] that switch them, with what switches them off."""
NEEDED: Mapping[str, tuple[str, ...]] = MappingProxyType({"motion": ("elastic",)})
"""Terms that are nothing without others."""


def terms_of(truth: TruthSettings) -> tuple[str, ...]:
    """Names of the terms that are switched on."""
    # None is the robot's own repeatability
    return tuple(
        term
        for term, keys in TERM_KEYS.items()
        if any(value is None or np.any(value) for value in (getattr(truth, key) for key in keys))
    )


def only(truth: TruthSettings, *terms: str) -> TruthSettings:
    """The same truth with no other terms than these; what they draw stays the same."""
    off = {
        key: value
        for term in TERM_KEYS
        if term not in terms
        for key, value in TERM_KEYS[term].items()
    }
    return truth.model_copy(update=off)


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

    def offsets(self, q: Array, moves: Array) -> Array:
        """Joint offsets (m, n) at q (m, n), after last moves in the directions `moves` (m, n)."""
        return np.asarray(self.half_width * self.sides(q, moves))

    def sides(self, q: Array, moves: Array) -> Array:
        """Where in its play each joint rests (m, n): -1 to 1; 0 for one that nothing pushes."""
        if self.side == "approach":
            return moves
        if self.side == "posture":
            side = np.zeros_like(q)
            side[:, 2] = np.tanh(STEEPNESS * np.sin(q[:, 1] + q[:, 2]))
            side[:, 4] = np.sign(np.cos(q[:, 3]) * np.sin(q[:, 4]))
            return side
        load = gravity_loads(self.robot.model.chain, self.robot.masses, self.robot.centers, q)
        felt = self.largest > 1e-9 * max(self.largest.max(), 1e-9)
        return np.where(felt, np.tanh(STEEPNESS * load / np.where(felt, self.largest, 1.0)), 0.0)


@dataclass(frozen=True, slots=True)
class Thermal:
    """Links that warm up from the start of the campaign: dT = rise (1 - exp(-t / tau))."""

    rise: float
    """In the end [K]."""
    tau: float
    """[s]"""
    expansion: float
    """[1/K]"""

    def growth(self, time: Array) -> Array:
        """Relative growth (m,) of all link lengths at times (m,) [s]."""
        return np.asarray(-self.expansion * self.rise * np.expm1(-time / self.tau))

    def temperature(self, time: Array) -> Array:
        """Of the links (m,) at times (m,) [s]; they are as long as in `model` at first [degC]."""
        return np.asarray(REFERENCE - self.rise * np.expm1(-time / self.tau))


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Masses and stiffnesses of an arm that gives way."""

    masses: Array
    """(n,) of the bodies [kg]."""
    centers: Array
    """(n, 3) centers of mass in the body frames [m]."""
    inertias: Array
    """(n, 3) principal moments, axes of the body frames; rest does not depend on them [kg m^2]."""
    drive: Array
    """(n,) stiffness about the joint's axis [N m/rad]."""
    bearing: Array
    """(n,) about x and about y of the body, or (0,) for stiff ones [N m/rad]."""
    payload: float
    """On the flange [kg]."""
    payload_center: Array
    """(3,) of the payload in the flange frame [m]."""
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -GRAVITY]))
    """(3,) in the world [m/s^2]."""
    payloads: Array = field(default_factory=lambda: np.zeros(0))
    """(c,) what hangs there instead where poses of the pool are visited, in turn [kg]."""

    def in_turn(self, m: int) -> Array | None:
        """What hangs at m poses of the pool that are visited one after the other (m,) [kg]."""
        return np.resize(self.payloads, m) if len(self.payloads) else None


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """How an arm on springs comes to its poses, and what holds it back."""

    speeds: Array
    """(n,) largest of each joint [rad/s]."""
    tool_speed: float
    """Largest of the tool; 0: the joints alone decide [m/s]."""
    approach: float
    """Last part of each move that is played, of the joint that moves farthest [rad]."""
    dwell: float
    """From the motors' stop until the tracker looks [s]."""
    friction: Array
    """(n,) dry friction of each joint [N m]."""
    damping: float
    """Of every spring, as a share of the critical one."""


@dataclass(frozen=True, slots=True)
class UnmodelledTerms:
    """What no `RobotModel` can hold of a true robot; each None where it is switched off."""

    backlash: Backlash | None = None
    thermal: Thermal | None = None
    springs: Springs | None = field(default=None, repr=False)
    motion: Approach | None = None


def last_moves(q: Array) -> Array:
    """Directions (m, n) of each joint's last move, where q (m, n) are visited in turn from zero on.

    A joint that stays where it is keeps the side it came from; one that never moved has none: 0.
    """
    moves = np.sign(np.diff(q, axis=0, prepend=0.0))
    latest = np.where(moves != 0, np.arange(len(q))[:, None], 0)
    return np.take_along_axis(moves, np.maximum.accumulate(latest, axis=0), axis=0)


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
