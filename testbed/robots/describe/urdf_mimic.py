"""Joints of a URDF that follow another one: what to do where they stand on the way to the tool."""

from collections.abc import Sequence
from typing import Any

from testbed.robots.describe.description import HELD_ELSEWHERE
from testbed.units import DEG, MM

STATED = (
    "take <mimic> out, write the arm as a robot.toml by truebed.write_robot, and state there under "
    "[controller]: "
)


def how_to_follow(joint: Any, way: Sequence[Any]) -> str:
    """What to do about a `joint` with a mimic, among those on the `way` to the tip.

    Where the joint that leads is on the way as well, that is the line of robot.toml; of a finger,
    whose leader is not and behind which no other joint moves, the end of the arm before it.
    """
    moving = [one for one in way if one.type != "fixed"]
    names, mimic = [one.name for one in moving], joint.mimic
    at = names.index(joint.name)
    if mimic.joint not in names:
        last = at > 0 and all(one.mimic is not None for one in moving[at:])
        return f"if it is of a gripper, end the arm before it: --tip {joint.parent}" if last else (
            HELD_ELSEWHERE
        )  # fmt: skip
    lead = names.index(mimic.joint)
    if (joint.type == "prismatic") != (moving[lead].type == "prismatic"):
        return HELD_ELSEWHERE  # their ratio has a unit
    factor = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
    told = {1.0: "", -1.0: "-"}.get(factor, f"{factor:.9g} ")
    fix = f'{STATED}joints = ["q{at + 1} = {told}q{lead + 1}"]'
    if mimic.offset:
        slides = joint.type == "prismatic"
        offset = float(mimic.offset) * (MM if slides else DEG)
        key, unit = ("d_mm", "mm") if slides else ("theta_deg", "deg")
        fix += f"; add its offset, {offset:.9g} {unit}, to {key} of joint {at + 1} there"
    return fix
