"""What each target of a program carries, where that is not what the measurements state.

The tool in use is one that was not measured: its tip is stated in the frame of the flange, so that
a target may have it. Where the measurements say where a payload hangs and a target does not, it
hangs there.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.uncertainty.statement.conditions import CENTER, Conditions
from calib.uncertainty.statement.departure import Departure, named
from testbed.robots.robot import Robot
from testbed.scenario.tool_in_use import ToolInUse
from testbed.units import listed

SAME = 1e-6
"""Tips this near are one: files have their places in mm with digits behind the point [m]."""
FULL_POSE = 6
"""With as many joints an arm brings every point of its flange to where it was meant to be."""


def known_tips(in_use: ToolInUse | None, robot: Robot, *, cartesian: bool) -> tuple[str, ...]:
    """Names of the tools whose tip is at a target although they were not measured.

    Cartesian targets, and those of arms that are brought there by their tool point alone, are of
    the tool of the robot's file.
    """
    if in_use is None:
        return ()
    if cartesian or robot.model.chain.n_joints < FULL_POSE:
        away = in_use.in_chain(np.array(in_use.point)) - robot.model.chain.T_flange_tool[:3, 3]
        if any(in_use.box) or np.abs(away).max() > SAME:
            return ()
    return (in_use.name,)


def has_tip(own: Conditions, measured: Conditions, in_use: ToolInUse | None, m: int) -> Bool | None:
    """Whether what is stated of each target (m,) is of the tip of the tool in use.

    A target that names no tool has that one. None without a tool in use.
    """
    if in_use is None:
        return None
    if own.tool is None:
        return frozen(np.ones(m, np.bool_), np.bool_)
    others = {*(measured.tool or ())} - {in_use.name}
    return frozen(np.array([name not in others for name in own.tool]), np.bool_)


def carried_load(own: Conditions, measured: Conditions, away: Departure) -> Conditions:
    """The conditions that targets are corrected for.

    A model of unknown load cannot be put under another one: its moments hold what was carried. The
    same is true of where the load hung.
    """
    if "payload" in away.unknown:
        return replace(own, payload=None, center=None)
    if CENTER in away.unknown:
        return replace(own, center=None)
    center = usual_center(measured)
    if own.payload is None or own.center is not None or center is None:
        return own
    return replace(own, center=frozen(np.tile(center, (len(own.payload), 1))))


def usual_center(measured: Conditions) -> Array | None:
    """Center of mass (3,) of all that the rows carried [m]; None where they do not say it."""
    if measured.payload is None or measured.center is None or not measured.payload.any():
        return None
    return np.average(measured.center, axis=0, weights=measured.payload)


def tool_words(away: Departure, in_use: ToolInUse | None, tips: Collection[str]) -> tuple[str, ...]:
    """What to write for a region at targets with a tool that was not measured; what one holds for.

    `tips` are as in `known_tips`.
    """
    said = []
    if away.placed.any() and in_use is not None and "payload" not in away.other:
        said.append(
            f"[tool_in_use] states where the tip of {in_use.name} is, and nothing states what it "
            "weighs: what is said of these targets holds as long as the arm carries the same load "
            "as in the measurements; state payload_kg under [conditions] and [use] to have it "
            "compared"
        )
    missing = np.zeros(len(away.outside), np.bool_)
    for by in (away.other, away.untold):
        missing |= by.get("tool", False)
    if not missing.any():
        return tuple(said)
    rows = np.flatnonzero(missing)
    names = sorted({name for name in away.targets.rows(rows).tool or () if name})
    which, where = listed(names) or "without a name", named("target", rows)
    if in_use is not None and in_use.name in names and not tips:
        said.append(
            f"{where} {'is' if len(rows) == 1 else 'are'} of the tool of the robot's file, whose "
            f"tip is not where [tool_in_use] has that of {in_use.name}: for a region there, give "
            "the joints of the targets alone, or make that tip the tool of the robot's file"
        )
    elif in_use is not None:
        said.append(
            f"for a region at {where}: if the tool {which} is the one under [tool_in_use], write "
            f'name = "{names[0] if names else ""}" there in place of "{in_use.name}"'
        )
    else:
        said.append(
            f"for a region at {where}, state under [tool_in_use] of session.toml name = "
            f'"{names[0] if names else ""}" and point_mm = [x, y, z], where the tip of that tool '
            "is in the frame of the flange"
        )
    return tuple(said)
