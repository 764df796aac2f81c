"""Conversion of a described arm to a `Robot`: its chain is tested, missing numbers are assumed."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import refuse
from calib.geometry.chain import Chain, forward
from calib.geometry.inverse import spread
from calib.geometry.model import RobotModel
from testbed import bounds
from testbed.robots.assumed import (
    MASS_PER_LENGTH,
    SHORTEST,
    SLIDE_SCATTER,
    SLIDE_SPEED,
    TURN_SCATTER,
    TURN_SPEED,
    no_mass,
    rod_moments,
    scatter_source,
)
from testbed.robots.describe.description import Body, Description, plain_name
from testbed.robots.describe.floor import floor_of
from testbed.robots.describe.parts import parts_of
from testbed.robots.describe.xml_gate import FileOptions, read_xml
from testbed.robots.placements import LIMIT, difference, link_poses, proof_joints
from testbed.robots.robot import CONVERTED, Robot, body_name
from testbed.units import named

FULL_TURN, FULL_SLIDE = 2 * np.pi, 1.0
"""Limits of joints without any, to both sides of zero [rad, m]."""
UNTESTED = "what it would hit is not tested"
LOCKED = 1e-6
"""Half the range given to a joint whose limits are equal [rad or m]."""
PROOFS = 33
"""Poses at which the chain is compared with the other reader, the first in mid-range."""


def read_description(path: Path, options: FileOptions) -> Robot:
    """Read a URDF or an MJCF, whichever it is, as a robot.

    Raises
    ------
    InputError
        R1 to R19: file and line, what it has, what was expected; R20 if the poses differ.
    """
    tag = read_xml(path, "robot", "mujoco").tag
    if tag == "robot":
        from testbed.robots.describe.urdf import describe_urdf as describe
    else:
        from testbed.robots.describe.mjcf import describe_mjcf as describe
    return robot_of(describe(path, options), allow_missing=options.allow_missing_meshes)


def robot_of(description: Description, *, allow_missing: bool = False) -> Robot:
    """The robot of a description, its chain proven against the poses of the other reader."""
    chain = description.chain
    notes = list(description.notes)
    limits = _limits(description, notes)
    turns = np.array([kind == "revolute" for kind in description.kinds])
    speeds = _speeds(description, turns, notes)
    _check_joints(description, turns, limits, speeds)
    agreement = _prove(description, chain, limits)
    frames = link_poses(chain, np.zeros((1, chain.n_joints)))[0]
    ends = np.vstack([description.points, description.T_world_tip[:3, 3]])
    masses, centers, inertias = _masses(description.bodies[1:], frames[1:], ends, notes)
    for name, mass, moments in zip(description.joint_names, masses, inertias, strict=True):
        moved = f"what joint {name} moves"
        _check(description, moved, "mass", [mass], bounds.MASS, "kg")
        _check(description, moved, "moment of inertia", moments, bounds.INERTIA, "kg m2")
    visuals, primitives, flat = parts_of(description, frames, notes, allow_missing=allow_missing)
    floor, height = floor_of((*visuals, *primitives), chain, limits, stands=description.stands)
    name = plain_name(description.name or description.path.stem, default="robot")
    robot = Robot(
        name=name,
        title=description.name or description.path.stem,
        folder=description.folder,
        model=RobotModel(chain),
        limits=frozen(limits),
        speeds=frozen(speeds),
        masses=frozen(masses),
        centers=frozen(centers),
        inertias=frozen(inertias),
        repeatability=frozen(np.where(turns, TURN_SCATTER, SLIDE_SCATTER)),
        visuals=visuals,
        base_offset=floor,
        mounting_height=height,
        exclusions=_exclusions(description),
        free_sets=MappingProxyType({}),
        sources=MappingProxyType(
            {
                "geometry": f"{description.path.name}, {CONVERTED}; poses equal "
                f"those of {description.reader} to {agreement:.1g} m",
                "limits": description.path.name,
                "masses": f"{description.path.name}, unless noted",
                "repeatability": scatter_source(),
            }
        ),
        joint_names=description.joint_names,
        agreement=agreement,
        primitives=primitives,
        unread=tuple(
            k for k, body in enumerate(description.bodies) if k and (body.unread or k in flat)
        ),
        own_text=description.own_text,
    )
    lacking = {"no shape that collides is given for": robot.shapeless}
    lacking["a shape that collides is not read of"] = robot.partly
    for what, links in lacking.items():
        if links:
            named = ", ".join(description.joint_names[k - 1] for k in links)
            notes.append(f"{what} what {named} moves: {UNTESTED}")
    robot = _without_constant_contacts(robot, notes)
    scatter = f"the repeatability of the joints is assumed ({TURN_SCATTER * 1e6:g} urad"
    notes.append(scatter + (f", sliding {SLIDE_SCATTER * 1e6:g} um)" if not turns.all() else ")"))
    return replace(robot, notes=tuple(notes))


def _check_joints(description: Description, turns: Bool, limits: Array, speeds: Array) -> None:
    """R11: lengths, limits and speeds that a robot.toml may have too."""
    rows = zip(description.joint_names, turns, limits, speeds, strict=True)
    for name, turning, limit, speed in rows:
        size, unit = (bounds.ANGLE, "rad") if turning else (bounds.LINK, "m")
        speed_of = bounds.TURN_SPEED if turning else bounds.SLIDE_SPEED
        _check(description, f"joint {name}", "limit", limit, size, unit)
        _check(description, f"joint {name}", "speed", [speed], speed_of, f"{unit}/s")
    lengths = description.chain.links[:, 1:3].ravel()
    _check(description, "the arm", "length", lengths, bounds.LINK, "m")


def _check(
    description: Description,
    whose: str,
    what: str,
    values: Sequence[float] | Array,
    bound: bounds.Bound,
    unit: str,
) -> None:
    """R11: numbers of sensible size."""
    for value in values:
        if value and not bound.least <= abs(value) <= bound.most:
            message, allowed = f"{whose} has a {what} of {value:.3g} {unit}", bound.allowed(unit)
            where = str(description.path)
            raise refuse(what, float(value), allowed, code="R11", message=message, where=where)


def _prove(description: Description, chain: Chain, limits: Array) -> float:
    """Largest distance of the chain's tool from the description's over many poses [m]."""
    q = proof_joints(limits, PROOFS)
    position, rotation = difference(forward(chain, q), description.poses(q))
    if not max(position, rotation) <= LIMIT:
        message = (
            f"the poses of the chain differ from those of {description.reader} by "
            f"{position:.3g} m and {rotation:.3g} rad"
        )
        raise refuse(
            "poses", position, f"at most {LIMIT:g}", code="R20", message=message,
            fix="check rotations and axes in the file for numbers with few digits",
            where=str(description.path),
        )  # fmt: skip
    return position


def _limits(description: Description, notes: list[str]) -> Array:
    """Joint limits (n, 2), finite and not empty [rad or m]."""
    limits = np.array(description.limits, dtype=np.float64)
    turns = np.array([kind == "revolute" for kind in description.kinds])
    for wanted, size, words in ((turns, FULL_TURN, "360 deg"), (~turns, FULL_SLIDE, "1 m")):
        without = wanted & ~np.isfinite(limits).all(axis=1)
        if without.any():
            names = _listed(description.joint_names, without)
            notes.append(f"{names} without limits: -{words} to {words} is assumed")
        limits[without] = -size, size
    locked = np.ptp(limits, axis=1) < LOCKED
    if locked.any():
        names = _listed(description.joint_names, locked)
        notes.append(f"{names} with equal limits: a range of {2 * LOCKED:g} about them is assumed")
    limits[locked] += np.array([-LOCKED, LOCKED])
    return limits


def _speeds(description: Description, turns: Bool, notes: list[str]) -> Array:
    """Largest joint speeds (n,), finite [rad/s or m/s]."""
    speeds = np.array(description.speeds, dtype=np.float64)
    without = ~np.isfinite(speeds)
    if without.any():
        names = _listed(description.joint_names, without)
        notes.append(f"{names} without a speed: 180 deg/s, or 1 m/s where it slides, is assumed")
    return np.where(without, np.where(turns, TURN_SPEED, SLIDE_SPEED), speeds)


def _listed(names: Sequence[str], which: Bool) -> str:
    """The joints of a note."""
    picked = [name for name, one in zip(names, which, strict=True) if one]
    if len(picked) == len(names) > 1:
        return "all joints"
    return named("joint", picked)


def _masses(
    bodies: Sequence[Body], frames: Array, ends: Array, notes: list[str]
) -> tuple[Array, Array, Array]:
    """Masses (n,), centers (n, 3) and moments (n, 3) in the body frames; assumed where missing.

    `ends` (n + 1, 3) are the joints and the tip: a body without a mass is a rod between two.
    """
    masses, centers, inertias = np.empty(len(bodies)), [], []
    bare, odd, crossed = [], [], []
    for i, (body, frame) in enumerate(zip(bodies, frames, strict=True)):
        length = max(float(np.linalg.norm(ends[i + 1] - ends[i])), SHORTEST)
        masses[i], center = body.mass, body.center
        if not body.mass > 0:
            bare.append(body.name)
            masses[i], center = MASS_PER_LENGTH * length, (ends[i] + ends[i + 1]) / 2
        turned = frame[:3, :3].T @ body.inertia @ frame[:3, :3]
        moments = np.diagonal(turned).copy()
        if body.mass > 0 and not (
            bounds.INERTIA.least <= moments.min()
            and moments.max() <= bounds.INERTIA.most
            and 2 * moments.max() <= moments.sum() * (1 + 1e-9)
        ):
            odd.append(body.name)
        elif np.abs(turned - np.diag(moments)).max() > 0.1 * moments.max():
            crossed.append(body.name)
        if body.name in bare + odd:
            moments = rod_moments(masses[i], length)
        # rounding may put the largest moment slightly above the sum of the others
        moments = np.minimum(moments, (moments.sum() - moments) * (1 - 1e-15))
        centers.append(frame[:3, :3].T @ (center - frame[:3, 3]))
        inertias.append(moments)
    if bare:
        notes.append(no_mass(bare))
    if odd:
        notes.append(f"no body has the inertia given for {', '.join(odd)}: that of a rod is taken")
    if crossed:
        notes.append(f"products of inertia of {', '.join(crossed)} are left out")
    return masses, np.array(centers), np.array(inertias)


def _exclusions(description: Description) -> tuple[tuple[str, str], ...]:
    """Pairs of neighbors, and pairs that the file excludes from collision tests."""
    pairs = {(i, i + 1) for i in range(len(description.bodies) - 1)}
    pairs |= {(min(pair), max(pair)) for pair in description.apart if pair[0] != pair[1]}
    return tuple((body_name(a), body_name(b)) for a, b in sorted(pairs))


def _without_constant_contacts(robot: Robot, notes: list[str]) -> Robot:
    """The robot with those pairs of bodies excluded whose shapes touch at every pose."""
    if not any(part.collides for part in robot.parts):
        return robot
    from testbed.robots.write.mjcf import always_touching

    pairs = always_touching(robot, spread(robot.limits, PROOFS)[1:])
    if not pairs:
        return robot
    listed = ", ".join(f"{a} and {b}" for a, b in pairs)
    notes.append(f"shapes that touch at every pose are never tested: {listed}")
    return replace(robot, exclusions=(*robot.exclusions, *pairs))
