"""What to do first where the file of a robot has no place for what is to be written into it."""

from dataclasses import replace

from testbed.files.tried.interpretations import Tried
from testbed.robots.robot import Robot

HERE = "in its robot.toml"
"""What a message says of the place of a line."""


def with_robot_toml(one: Tried, robot: Robot) -> Tried:
    """The same, with how a URDF or an MJCF becomes the robot.toml that its message asks for."""
    own, other = robot.own_text, one.alternative
    if own is None or HERE not in other.fix:
        return one
    name = own.path.name
    first = (
        f'; {name} has no place for it: in Python, arm = truebed.robot("{name}", tip="{own.tip}") '
        'and truebed.write_robot(arm, arm.model, "folder") write folder/robot.toml, to be given '
        "as ROBOT"
    )
    return replace(one, alternative=replace(other, fix=other.fix + first))
