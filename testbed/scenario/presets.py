"""What a scenario leaves open: presets of the truth, and what its robot decides."""

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from calib.errors import CalibError
from testbed.faults import KeyPath, flat, nested
from testbed.scenario.planning import DEFAULT_POSES
from testbed.scenario.tables import PAPER_SET

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot

SOFT: dict[str, object] = {
    "angle_sd_deg": 0.032,
    "twist_share": 0.3,  # 0.0096 deg
    "offset_share": 0.064 / 0.12,
    "harmonic_mdeg": [5.0, 5.0, 5.0, 8.0, 8.0, 8.0],
    "frame_sd_mm": 0.1,
    "frame_sd_deg": 0.01,
}
ELASTIC: dict[str, object] = SOFT | {
    "gravity_mdeg": [0.0, 0.0, 0.0],
    "drive_nm_per_mrad": [90.0, 90.0, 40.0, 12.0, 10.0, 6.0],
    "bearing_nm_per_mrad": [600.0, 500.0, 300.0, 100.0, 80.0, 50.0],
    "payload_kg": 2.0,
}
TRUTH_PRESETS: dict[str, dict[str, object]] = {
    "rigid": {"gravity_mdeg": [0.0, 0.0, 0.0], "harmonic_mdeg": 0.0},
    "wen2022": {"gravity_mdeg": [10.0, 6.0, 8.0], "harmonic_mdeg": 6.0},
    "soft": SOFT | {"gravity_mdeg": [25.0, 15.0, 30.0]},
    "unmodelled": {
        "high_harmonic_mdeg": 2.5,
        "backlash_mdeg": [0.0, 0.0, 8.0, 0.0, 8.0, 0.0],
        "backlash_side": "posture",
    },
    "elastic": ELASTIC,
    "drives": SOFT
    | {"gravity_mdeg": [0.0, 0.0, 0.0], "transmission_mdeg": [8.0, 8.0, 8.0, 5.0, 5.0, 5.0]},
    "payloads": ELASTIC | {"payload_kg": 2.5, "payloads_kg": [0.0, 5.0]},
    "gears": SOFT
    | {
        "gravity_mdeg": [0.0, 0.0, 0.0],
        "gear_mdeg": [6.0, 6.0, 6.0, 4.0, 4.0, 4.0],
        "gear_ratio": [101.0, 101.0, 81.0, 60.5, 50.4, 32.0],  # assumed
    },
    "moving": ELASTIC
    | {"motion": True, "friction_nm": [3.0, 3.0, 1.5, 0.5, 0.35, 0.2]},  # 1 % of rated torque
}
"""What differs between the presets; magnitudes are assumed after published fits."""
ALONG = (
    "harmonic_mdeg",
    "transmission_mdeg",
    "gear_mdeg",
    "gear_ratio",
    "drive_nm_per_mrad",
    "bearing_nm_per_mrad",
    "friction_nm",
)
"""Keys whose lists follow the number of joints; play belongs to joints 3 and 5 of any arm."""
TRUTH_COMMON: dict[str, object] = {
    "angle_sd_deg": 0.02,
    "length_sd_mm": 0.12,
    "frame_sd_mm": 0.0,
    "frame_sd_deg": 0.0,
}


def resolved_truth(
    truth: Mapping[str, Any], robot: "Robot | None", *, at960: bool
) -> dict[str, Any]:
    """[truth] with its preset applied; wrong types are left for the strict check to name.

    Where the closed form of gravity does not hold for the robot, a file that names no preset leaves
    the sag out.
    """
    joints = SIX if robot is None else robot.model.chain.n_joints
    preset = truth.get("preset", "wen2022")
    chosen = TRUTH_PRESETS.get(preset, {}) if isinstance(preset, str) else {}
    filled = TRUTH_PRESETS["wen2022"] | TRUTH_COMMON | chosen | {"preset": preset}
    for key in (*ALONG, "backlash_mdeg"):
        values = filled.get(key)
        if isinstance(values, list):
            rest = [0.0] * (joints - len(values))
            filled[key] = along(values, joints) if key in ALONG else [*values, *rest][:joints]
    if robot is not None and "preset" not in truth:
        from calib.identification.joint_models import gravity_is_closed

        if not gravity_is_closed(robot.model.chain):
            filled["gravity_mdeg"] = [0.0, 0.0, 0.0]
    has_set = robot is not None and PAPER_SET in robot.free_sets
    filled["perturb"] = "wen2022" if has_set else "links"
    filled["joint_repeatability_mdeg"] = None if at960 else 0.0
    filled |= truth
    if filled["joint_repeatability_mdeg"] == "robot":
        filled["joint_repeatability_mdeg"] = None
    return filled


def along(values: list[float], joints: int) -> list[float]:
    """A preset's list for six axes, spread along an arm of another number of joints.

    Each joint takes the number of the axis that is as far along the six.

    Examples
    --------
    >>> along([5.0, 5.0, 5.0, 8.0, 8.0, 8.0], 7)
    [5.0, 5.0, 5.0, 5.0, 8.0, 8.0, 8.0]
    """
    last = len(values) - 1
    return [values[(i * last) // max(joints - 1, 1)] for i in range(joints)]


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


def decided_by(robot: "Robot", given: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """[pool] box, [tracker] station and estimators that fit the robot, for what is not given."""
    from testbed.robots.robot import workspace

    tables: dict[str, dict[str, Any]] = {}
    if PAPER_SET not in robot.free_sets:
        tables["identification"] = {"estimators": ["whitened"]}
    box = ("box_center_mm", "box_size_mm")
    wanted = {"pool": box, "tracker": ("station_mm",)}
    # a robot without a stated workspace has its postures looked through: only if it is needed
    if any(key not in given[name] for name in wanted if name in given for key in wanted[name]):
        place = workspace(robot)
        tables["tracker"] = {"station_mm": list(place.station_mm)}
        tables["pool"] = {key: list(getattr(place, key)) for key in box}
        if place.joint_ranges_deg:
            tables["pool"]["joint_ranges_deg"] = [list(pair) for pair in place.joint_ranges_deg]
    return tables


def resolved(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document with presets applied; wrong types are left for the strict check to name."""
    robot = robot_of(document)
    given: dict[str, Mapping[str, Any]] = {
        name: table
        for name in ("truth", "tracker", "pool", "identification", "plan")
        if isinstance(table := document.get(name, {}), Mapping)
    }
    decided = {} if robot is None else decided_by(robot, given)
    out = dict(document)
    out |= {name: decided.get(name, {}) | dict(table) for name, table in given.items()}
    if "tracker" in given:
        out["tracker"] = {"preset": "paper", **out["tracker"]}
    if "truth" in given:
        at960 = "tracker" in given and out["tracker"]["preset"] == "at960"
        out["truth"] = resolved_truth(given["truth"], robot, at960=at960)
    if "plan" in given:
        plan, size = given["plan"], given.get("pool", {}).get("size")
        small = type(size) is int and 10 <= size < DEFAULT_POSES
        poses = size if small else DEFAULT_POSES
        out["plan"] = {"poses": 0 if "target_um" in plan else poses} | dict(plan)
        if isinstance(goal := plan.get("goal"), Mapping):
            out["plan"]["goal"] = {"kind": "box"} | dict(goal)
        if "plan" in document and "trial" not in document:
            # a file made for planning can be played too, as one designed set
            out["trial"] = [{"name": "designed", "poses": poses, "method": "detmax"}]
    return out


REPEATABILITY: KeyPath = ("truth", "joint_repeatability_mdeg")
"""Null in a scenario, "robot" in its file: TOML has no null."""
ROWS: tuple[KeyPath, ...] = (("trial",), ("cell", "obstacle"))
"""Lists of tables, given as a whole: nothing decides their defaults."""


def written(document: Mapping[str, Any]) -> dict[str, Any]:
    """A document without nulls, which TOML does not have."""
    values = flat(document)
    if REPEATABILITY in values and values[REPEATABILITY] is None:
        values[REPEATABILITY] = "robot"
    return nested({path: value for path, value in values.items() if value is not None})


def given_in(document: Mapping[str, Any], filled: Mapping[str, Any]) -> dict[str, Any]:
    """What a checked document gave; lists of tables as the filled one has them, with defaults."""
    values, there = flat(written(document)), flat(filled)
    return nested(values | {path: there[path] for path in ROWS if path in values})
