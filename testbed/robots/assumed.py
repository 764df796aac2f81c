"""Defaults for numbers that a robot's file may leave out, and the notes on them."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from testbed.robots.links import PrismaticLink, RevoluteLink
from testbed.robots.placements import link_poses, placements
from testbed.robots.robot import NO_MASS
from testbed.units import named

TURN_SPEED, SLIDE_SPEED = np.pi, 1.0
"""Speeds of joints without a stated one [rad/s, m/s]."""
TURN_SCATTER, SLIDE_SCATTER = 14.5e-6, 5e-6
"""Standard deviation of the repeatability of joints without a stated one [rad, m]."""
MASS_PER_LENGTH, SHORTEST, RADIUS = 15.0, 0.1, 0.05
"""Bodies without a mass are rods of this mass per length, least length and radius [kg/m, m, m]."""
Joint = RevoluteLink | PrismaticLink


def no_mass(names: Sequence[str]) -> str:
    """The note on bodies without a mass, by what moves them."""
    return (
        f"{NO_MASS} {', '.join(names)} moves: a rod to the next joint of {MASS_PER_LENGTH:g} kg/m "
        "is assumed"
    )


def rod_moments(mass: float, length: float) -> Array:
    """Three equal moments of inertia that bound those of a rod in any direction [kg m2]."""
    return np.full(3, mass * (length**2 / 12 + RADIUS**2 / 4))


def bodies(joints: Sequence[Joint], chain: Chain) -> tuple[Array, Array, Array]:
    """Masses (n,), centers (n, 3) and moments (n, 3) in the body frames, assumed where missing."""
    frames = link_poses(chain, np.zeros((1, chain.n_joints)))[0, 1:]
    tip = frames[-1] @ placements(chain).tool
    ends = np.vstack([frames[:, :3, 3], tip[:3, 3]])
    masses, centers, moments = [], [], []
    for joint, frame, start, end in zip(joints, frames, ends, ends[1:], strict=False):
        if joint.mass_kg is None or joint.center_mm is None or joint.inertia_kg_m2 is None:
            length = max(float(np.linalg.norm(end - start)), SHORTEST)
            masses.append(MASS_PER_LENGTH * length)
            centers.append(frame[:3, :3].T @ (end - start) / 2)
            moments.append(rod_moments(masses[-1], length))
        else:
            masses.append(joint.mass_kg)
            centers.append(np.array(joint.center_mm) / 1e3)
            moments.append(np.array(joint.inertia_kg_m2))
    return np.array(masses), np.array(centers), np.array(moments)


def assumed_sources(joints: Sequence[Joint]) -> dict[str, str]:
    """Sources of numbers that no joint states."""
    if any(joint.scatter is not None for joint in joints):
        return {}
    return {"repeatability": scatter_source()}


def scatter_source() -> str:
    """Source of a repeatability that no file states."""
    return (
        f"assumed: {TURN_SCATTER * 1e6:g} urad for joints that turn, {SLIDE_SCATTER * 1e6:g} um "
        "for those that slide"
    )


def assumed(joints: Sequence[Joint]) -> tuple[str, ...]:
    """Notes on numbers that the joints do not state."""
    bare = [f"joint {k + 1}" for k, joint in enumerate(joints) if joint.mass_kg is None]
    slow = [f"{k + 1}" for k, joint in enumerate(joints) if joint.speed is None]
    exact = [f"{k + 1}" for k, joint in enumerate(joints) if joint.scatter is None]
    notes = [no_mass(bare)] if bare else []
    for which, what, taken in (
        (slow, "a speed", "180 deg/s, or 1 m/s where it slides,"),
        (exact, "a repeatability", f"{TURN_SCATTER * 1e6:g} urad, or {SLIDE_SCATTER * 1e6:g} um,"),
    ):
        if which:
            notes.append(f"{named('joint', which)} without {what}: {taken} is assumed")
    return tuple(notes)
