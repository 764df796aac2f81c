"""A robot as it was identified: the same arm with other numbers."""

import re
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from calib.arrays import frozen
from calib.errors import refuse
from calib.geometry.bodies import Z
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from testbed.robots.describe.axes import reach, regauged
from testbed.robots.parts import Affine, Primitive, Visual
from testbed.robots.placements import difference, link_poses
from testbed.robots.robot import IDENTIFIED, Reflector, Robot

NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
SHIFT, TURN = 0.01, np.radians(1.0)
"""Motion of a link's frame above which it is due to the gauge, not to calibration [m, rad]."""


def identified_robot(
    robot: Robot, model: RobotModel, *, name: str, reflectors: tuple[Reflector, ...] = ()
) -> Robot:
    """The robot with an identified model, under a new name.

    Parts and masses keep their places at joint zero. If a length is larger than the robot, which
    only the gauge can cause, the links get other numbers for the same poses.

    Parameters
    ----------
    robot : Robot
        The robot that was calibrated.
    model : RobotModel
        Identified geometry and joint errors; reflectors and stations are not part of a robot.
    name : str
        Small letters, digits, underscores.
    reflectors : tuple of Reflector
        Reflectors on the tool, in the tool frame of the model.
    """
    require_name(name)
    nominal = robot.model.chain
    if model.chain.kinds != nominal.kinds:
        message = f"the model has joints {model.chain.kinds}"
        allowed = f"those of {robot.name}: {nominal.kinds}"
        raise refuse("model", allowed=allowed, code="A3", message=message)
    chain, notes, errors = model.chain, robot.notes, model.joint_errors
    # lengths that grow and axes of bearings are those of the links as they are
    bound = errors.of_lengths or (errors.springs is not None and (errors.springs.axis != Z).any())
    if not bound and longest(chain) > max(longest(nominal), reach(nominal)):
        other = regauged(chain)
        notes = (
            *notes,
            f"a link came out {longest(chain):.3g} m long, more than the robot; its numbers were "
            f"chosen anew for the same poses, the longest is now {longest(other):.3g} m",
        )
        chain = other
    robot = _rehung(robot, chain)
    sources = dict(robot.sources)
    sources["geometry"] = f"{IDENTIFIED} {robot.name}"
    if model.joint_errors.springs:
        sources["springs"] = f"{IDENTIFIED} {robot.name}"
    if model.joint_errors.terms:
        sources["joint_terms"] = f"{IDENTIFIED} {robot.name}"
    return replace(
        robot,
        name=name,
        title=f"{robot.title}, identified",
        model=RobotModel(chain, model.joint_errors),
        sources=MappingProxyType(sources),
        notes=notes,
        reflectors=reflectors,
        agreement=None,
        own_text=None,
    )


def longest(chain: Chain) -> float:
    """Largest |d| or |a| among the links [m]."""
    return float(np.abs(chain.links[:, 1:3]).max())


def _rehung(robot: Robot, new: Chain) -> Robot:
    """The robot with its bodies described in the frames of a chain of nearly the same poses.

    Frames that moved as little as an identification moves them are taken as they are.
    """
    zero = np.zeros((1, new.n_joints))
    before, after = (
        link_poses(replace(chain, T_world_base=np.eye(4)), zero)[0]
        for chain in (robot.model.chain, new)
    )
    moves = np.array([inverse(there) @ here for here, there in zip(before, after, strict=True)])
    still = np.tile(np.eye(4), (len(moves), 1, 1))
    position, rotation = difference(moves, still)
    if position <= SHIFT and rotation <= TURN:
        return robot

    def moved(part: Visual | Primitive) -> Affine:
        return tuple(map(tuple, (moves[part.link] @ np.array(part.affine)).tolist()))

    centers, inertias = [], []
    for T, center, moments in zip(moves[1:], robot.centers, robot.inertias, strict=True):
        centers.append(T[:3, :3] @ center + T[:3, 3])
        inertias.append(np.diagonal((T[:3, :3] * moments) @ T[:3, :3].T))
    return replace(
        robot,
        visuals=tuple(replace(one, affine=moved(one)) for one in robot.visuals),
        primitives=tuple(replace(one, affine=moved(one)) for one in robot.primitives),
        centers=frozen(np.array(centers)),
        inertias=frozen(inertias),
    )


def require_name(name: str) -> None:
    """Refuse a name that cannot be a robot's."""
    if not NAME.fullmatch(name):
        allowed = "small letters, digits and underscores, a letter first, at most 64"
        raise refuse(
            "name", name, allowed, code="S37", message=f'a robot cannot be called "{name}"'
        )
