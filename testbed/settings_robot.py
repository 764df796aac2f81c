"""What a scenario leaves open and its robot decides: workspace, tracker station, estimators."""

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypedDict

from calib.errors import CalibError

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

PAPER_SET = "wen2022"
"""Name of the free set that the paper's estimator identifies."""
SIX = 6
"""Joints taken for granted where the robot cannot be loaded; its own error is told later."""


def robot_of(document: Mapping[str, Any]) -> "Robot | None":
    """The robot of a scenario not yet checked; None if it names none that can be loaded."""
    from testbed.robots.catalog import load_robot, robot_names

    name = document.get("robot")
    if not isinstance(name, str) or not name:
        return None
    try:
        return _shipped(name) if name in robot_names() else load_robot(name)
    except (CalibError, OSError, ValueError):
        return None  # the strict check says what is wrong with it


@lru_cache(maxsize=8)
def _shipped(name: str) -> "Robot":
    """A shipped robot; its files do not change while a program runs."""
    from testbed.robots.catalog import load_robot

    return load_robot(name)


class Facts(TypedDict):
    """What the presets of the truth ask of a robot."""

    joints: int
    """How many numbers lists have that hold one per joint."""
    paper_set: bool
    """Whether the set that the paper identifies is one of its free sets."""
    sags: bool
    """Whether the closed form of gravity holds for it."""


def facts_of(robot: "Robot | None") -> Facts:
    """What the presets of the truth ask of a robot."""
    from calib.identification.extended import gravity_is_closed

    if robot is None:
        return Facts(joints=SIX, paper_set=False, sags=True)
    chain = robot.model.chain
    return Facts(
        joints=chain.n_joints,
        paper_set=PAPER_SET in robot.free_sets,
        sags=gravity_is_closed(chain),
    )


def with_workspace(document: Mapping[str, Any], robot: "Robot | None") -> dict[str, Any]:
    """The document with [pool] box, [tracker] station and estimators that fit the robot.

    What is written stays; tables of a wrong type are left for the strict check to name.
    """
    out = dict(document)
    if robot is None:
        return out
    from testbed.robots.workspace import workspace

    tables: dict[str, Mapping[str, Any]] = {}
    for name in ("pool", "tracker", "identification"):
        table = out.get(name, {})
        if isinstance(table, Mapping):
            tables[name] = table
    box = ("box_center_mm", "box_size_mm")
    pool, tracker = tables.get("pool"), tables.get("tracker")
    # a robot without a stated workspace has its postures looked through: only if it is needed
    if (pool is not None and not all(key in pool for key in box)) or (
        tracker is not None and "station_mm" not in tracker
    ):
        place = workspace(robot)
        if pool is not None:
            filled: dict[str, Any] = {key: list(getattr(place, key)) for key in box}
            if place.joint_ranges_deg:
                filled["joint_ranges_deg"] = [list(pair) for pair in place.joint_ranges_deg]
            out["pool"] = filled | dict(pool)
        if tracker is not None:
            out["tracker"] = {"station_mm": list(place.station_mm)} | dict(tracker)
    identification = tables.get("identification")
    if identification is not None and PAPER_SET not in robot.free_sets:
        out["identification"] = {"estimators": ["whitened"]} | dict(identification)
    return out
