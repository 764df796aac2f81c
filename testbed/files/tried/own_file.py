"""What to do first where the file of a robot has no place for what is to be written into it."""

import shlex
from dataclasses import replace

from testbed.files.rows.counts import HERE
from testbed.files.tried.interpretations import Tried
from testbed.robots.robot import Robot


def with_robot_toml(one: Tried, robot: Robot) -> Tried:
    """The same, with how a URDF or an MJCF becomes the robot.toml that its message asks for."""
    own, other = robot.own_text, one.alternative
    if own is None or HERE not in other.fix:
        return one
    command = shlex.join(["truebed", "new", "robot", str(own.path), "--tip", own.tip])
    first = f"; {own.path.name} has no place for it: {command} writes a robot.toml to give as ROBOT"
    return replace(one, alternative=replace(other, fix=other.fix + first))
