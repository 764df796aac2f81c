"""Joints of an MJCF that cannot move alone: with several axes, coupled, passive or in a loop."""

from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.robots.describe.description import HELD_ELSEWHERE
from testbed.robots.write.mjcf import called, kind_of

DRIVEN = ("joint", "jointinparent")
"""Attributes of actuators that name the joint they drive."""
KEPT = ("connect", "weld", "joint")
"""Constraints that MuJoCo resolves; others may join elements that are not in its text."""
ALONE = "joints must be hinges or slides that move independently"


def taken(root: Any) -> dict[str, list[Any]]:
    """Elements that drive or couple joints, by tag; all but `KEPT` are removed from the tree."""
    out: dict[str, list[Any]] = {"actuator": [], "tendon": [], "equality": [], "contact": []}
    for section in [child for child in root if child.tag in out]:
        parts = [part for part in section if section.tag != "equality" or part.tag not in KEPT]
        out[section.tag] += parts
        for part in parts:
            section.remove(part)
        if section.tag != "equality":
            root.remove(section)
    return out


def require_alone(model: Any, joints: list[int], drives: dict[str, list[Any]], path: Path) -> None:
    """R16: require that every joint on the way moves alone and is in no loop."""
    names = {called(model, "joint", joint): joint for joint in joints}
    driven = {motor.get(key) for motor in drives["actuator"] for key in DRIVEN}
    reached = {part.get("joint") for tendon in drives["tendon"] for part in tendon.iter("joint")}
    follows = _follows(model) | _tied(drives, set(names))
    for name, joint in names.items():
        kind, problem = kind_of(model, joint), ""
        if kind in ("ball", "free"):
            problem = f"joint {name} is a {kind} joint"
        elif name in follows:
            problem = f"joint {name} {follows[name]}"
        elif driven & set(names) and name not in driven | reached:
            problem = f"joint {name} is passive: no actuator drives it, but others are driven"
        if problem:
            fix = HELD_ELSEWHERE if name in follows else ""
            raise refuse(
                "joint", name, ALONE, code="R16", message=problem, fix=fix, where=str(path)
            )
    if (ring := _ring(model, joints, path)) is not None:
        raise ring


def _follows(model: Any) -> dict[str, str]:
    """Joints that an active constraint gives a value, in words."""
    import mujoco

    found = {}
    for k in range(model.neq):
        if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[k]:
            name, other = (
                called(model, "joint", int(ids[k])) if ids[k] >= 0 else ""
                for ids in (model.eq_obj1id, model.eq_obj2id)
            )
            found[name] = f"is a mimic joint of {other}" if other else "is held by <equality>"
    return found


def _tied(drives: dict[str, list[Any]], names: set[str]) -> dict[str, str]:
    """Joints on the way that a tendon of constant length ties to each other and to no others."""
    parts = {
        tendon.get("name"): [part.get("joint") for part in tendon.iter("joint")]
        for tendon in drives["tendon"]
    }
    found = {}
    for one in drives["equality"]:
        ends = [one.get(key) for key in ("tendon1", "tendon2") if one.get(key)]
        tied = [joint for end in ends for joint in parts.get(end, ())]
        if tied and one.get("active") != "false" and set(tied) <= names:
            found[tied[-1]] = f"is tied by tendon {' and '.join(ends)}"
    return found


def _ring(model: Any, joints: list[int], path: Path) -> InputError | None:
    """The error for a constraint between bodies that different joints of the way carry.

    A mocap body, which only the user moves, closes no loop.
    """
    import mujoco

    bodies = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}
    carried = _carried(model, joints)
    for k in range(model.neq):
        tag = bodies.get(mujoco.mjtEq(int(model.eq_type[k])))
        if tag is None or not model.eq_active0[k]:
            continue
        ends = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            ends = [int(model.site_bodyid[end]) for end in ends]
        hand = any(model.body_mocapid[end] >= 0 for end in ends)
        if not hand and carried[ends[0]] != carried[ends[1]]:
            names = sorted(called(model, "body", end) for end in ends)
            message = f"<{tag}> closes a ring at body {', '.join(names)}"
            return refuse(
                tag, allowed="it must be a serial arm", code="R16", message=message, where=str(path)
            )
    return None


def _carried(model: Any, joints: list[int]) -> list[int]:
    """How many of the joints on the way carry each body; others play no part."""
    carried = [0]
    for body in range(1, model.nbody):  # parents come first
        first = int(model.body_jntadr[body])
        own = range(first, first + int(model.body_jntnum[body]))
        carried.append(carried[int(model.body_parentid[body])] + sum(k in joints for k in own))
    return carried
