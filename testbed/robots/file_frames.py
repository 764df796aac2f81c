"""The frames in which people state poses of a robot: those of the file that they know.

The chain of a URDF or MJCF starts on its first joint axis and ends on its last one, with frames
that no file names. Poses in programs stand in the root of the file instead, and its flange is the
link or site at which the arm ends. A robot.toml has base and flange of its own.
"""

from pathlib import Path

import numpy as np

from calib.arrays import Array, frozen
from calib.errors import one_line
from calib.geometry.frames import inverse, log_so3, transform_points
from testbed.robots.robot import CONVERTED, Robot
from testbed.robots.source import UrdfText
from testbed.units import DEG, MM

SAME = 1e-9
"""Difference up to which two frames are one [m, 1]."""


def base_of_poses(robot: Robot) -> Array:
    """The frame (4, 4) in which programs state poses, in the world of the nominal robot [m]."""
    return robot.model.chain.T_world_base if robot.own_text is None else np.eye(4)


def flange_of_points(robot: Robot) -> Array:
    """The frame (4, 4) in which people state points at the flange, in the flange of the chain [m].

    In a URDF or MJCF that is the link or site at which the arm ends.
    """
    return np.eye(4) if robot.own_text is None else robot.model.chain.T_flange_tool


def hung_in_chain(robot: Robot, payload: Array | None, center: Array | None) -> Array | None:
    """Centers of mass (m, 3) in the flange of the chain, of payloads (m,) whose are stated [m].

    `center` (m, 3) is stated at the flange; without it payloads hang in the flange itself.
    """
    if robot.own_text is None or payload is None or (center is None and not payload.any()):
        return center
    there = np.zeros((len(payload), 3)) if center is None else center
    return frozen(transform_points(flange_of_points(robot), there))


def stated_at_flange(robot: Robot, point: Array) -> Array:
    """A point (3,) in the flange of the chain, as it is stated at the flange [m]."""
    if robot.own_text is None:
        return point
    return transform_points(inverse(flange_of_points(robot)), point)


def chain_words(robot: Robot) -> str:
    """Where the base of its chain stands in the root of its file; empty where that is one frame.

    Scenarios state stations and boxes in the base of the chain.
    """
    T = robot.model.chain.T_world_base
    if robot.own_text is None or _is_same(T):
        return ""
    return _placed(T, f" in {base_words(robot)}")


def toml_words(robot: Robot) -> tuple[str, ...]:
    """What is stated in other frames in the robot.toml of a URDF or MJCF than in that file."""
    said, source, T = list[str](), robot.own_text, robot.model.chain.T_flange_tool
    if stands := chain_words(robot):
        said.append(f"programs for it state poses in its base, {stands}")
    if source is not None and not _is_same(T):
        there = f"in which {one_line(source.tip)} is {_placed(T)}"
        said.append(f"tools in use and payloads are stated at its flange, {there}")
    return tuple(said)


def of_toml_words(robot: Robot) -> str:
    """In which frame poses are, where a robot.toml was made of a URDF or MJCF with another root."""
    made = robot.own_text is None and CONVERTED in robot.sources.get("geometry", "")
    if not made or _is_same(robot.model.chain.T_world_base):
        return ""
    return (
        "the base of robot.toml, which is not the root of the URDF or MJCF that it was made of: "
        "[base] says where it stands there"
    )


def _is_same(T: Array) -> bool:
    """Whether a frame (4, 4) is the one that it is stated in."""
    return bool(np.abs(T - np.eye(4)).max() < SAME)


def _placed(T: Array, within: str = "") -> str:
    """Where a frame (4, 4) stands [m], within which other one, in words."""
    place, turn = (
        ", ".join(f"{number + 0.0:.6g}" for number in np.round(numbers, 6))
        for numbers in (T[:3, 3] * MM, log_so3(T[:3, :3]) * DEG)
    )
    return f"at ({place}) mm{within}, turned by the rotation vector ({turn}) deg"


def base_words(robot: Robot) -> str:
    """What this frame is, for people; empty where it is the base of a robot.toml."""
    source = robot.own_text
    if source is None:
        return ""
    kind = "root link" if isinstance(source, UrdfText) else "world"
    return f"the {kind} of {one_line(Path(source.path).name)}"
