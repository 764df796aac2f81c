"""What a URDF must satisfy before a library sees it: numbers, names, tree, limits, mesh files."""

import math
from pathlib import Path
from typing import Any

from testbed.robots.describe.xml_gate import (
    FileOptions,
    angle_notes,
    called,
    check_numbers,
    check_range,
    error_at,
    missing,
    not_local,
    outside,
)
from testbed.strict import choice_of

NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mass": {"value": 1},
    "inertia": {"ixx": 1, "ixy": 1, "ixz": 1, "iyy": 1, "iyz": 1, "izz": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
    "mimic": {"multiplier": 1, "offset": 1},
    "dynamics": {"damping": 1, "friction": 1},
}
"""How many numbers each attribute holds."""
MOST_LINKS = 2000
"""Far more than any arm has; what is checked per link stays quick."""
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def check_urdf(root: Any, path: Path, options: FileOptions) -> list[str]:
    """Check a parsed URDF (lxml); returns sentences about what is odd but legal.

    Raises
    ------
    InputError
        At the first thing that is wrong, with its line: R6, R7, R11 to R16.
    """
    macro = next((one for one in root.iter("{*}*") if "xacro" in str(one.tag)), None)
    if macro is not None:
        message = "has xacro macros, which are not URDF yet"
        fix = "write them out first: xacro arm.xacro > arm.urdf"
        raise error_at(macro, path, "R2", message, "xacro", fix=fix)
    if (count := len(root.findall("link"))) > MOST_LINKS:
        message, allowed = f"there are {count} links", f"at most {MOST_LINKS}"
        raise error_at(root, path, "R2", message, "link", allowed=allowed)
    for element in root.iter(*NUMBERS):
        counts = NUMBERS[element.tag]
        if element.tag == "mesh" and len(element.get("scale", "").split()) == 1:
            counts = {"scale": 1}  # the same along all axes
        check_numbers(element, path, counts)
    _check_tree(root, path)
    notes = _check_limits(root, path)
    return notes + _check_meshes(root, path, options)


def mesh_files(name: str, folder: Path) -> list[Path]:
    """Where the mesh of a URDF may lie: below the folder, or below the package it names there."""
    plain = name.removeprefix("file://").removeprefix("package://")
    candidates = [folder / plain]
    if name.startswith("package://"):  # the package's folder may be the root itself
        candidates.append(folder / plain.partition("/")[2])
    return candidates


def _check_tree(root: Any, path: Path) -> None:
    """R15 and R16: unique names, known links, one root, every link below it."""
    links, joints = root.findall("link"), root.findall("joint")
    for kind, elements in (("link", links), ("joint", joints)):
        seen: set[str] = set()
        for element in elements:
            name = element.get("name")
            if not name or name in seen:
                problem = f"{kind} {name} is there twice" if name else f"a <{kind}> has no name"
                raise error_at(element, path, "R15", problem, "name", name)
            seen.add(name)
    names = [link.get("name") for link in links]
    if not names:
        raise error_at(root, path, "R2", "there is no link", "link")
    parent_of: dict[str, str] = {}
    for joint in joints:
        parent, child = (_joint_end(joint, end, names, path) for end in ("parent", "child"))
        if child in parent_of:
            message = f"link {child} is the child of two joints"
            raise error_at(joint, path, "R15", message, "child", child, "a tree")
        parent_of[child] = parent
    _check_one_root(names, parent_of, root, path)


def _joint_end(joint: Any, end: str, names: list[str], path: Path) -> str:
    """Link a joint begins or ends at."""
    name, kind = joint.get("name"), joint.get("type")
    if kind not in JOINT_TYPES:
        message, allowed = f"joint {name} has type {kind}", f"one of {', '.join(JOINT_TYPES)}"
        raise error_at(joint, path, "R16", message, "type", kind, allowed)
    element = joint.find(end)
    link = element.get("link") if element is not None else None
    if link is None:
        raise error_at(joint, path, "R16", f"joint {name} has no <{end} link=...>", end)
    if link not in names:
        message = f"joint {name} has {end} link {link}, which does not exist"
        raise error_at(element, path, "R16", message, end, link, fix=choice_of(link, names))
    return str(link)


def _check_one_root(names: list[str], parent_of: dict[str, str], root: Any, path: Path) -> None:
    """Exactly one link without parent, and no ring of links beside it."""
    tops = [name for name in names if name not in parent_of]
    if len(tops) > 1:
        message = f"there are {len(tops)} root links: {', '.join(tops)}"
        raise error_at(root, path, "R15", message, "link", tops, "one")
    for name in names:
        trail = [name]
        while trail[-1] in parent_of and parent_of[trail[-1]] not in trail:
            trail.append(parent_of[trail[-1]])
        if trail[-1] in parent_of:
            ring = trail[trail.index(parent_of[trail[-1]]) :]
            message = f"links {', '.join(reversed(ring))} form a ring"
            raise error_at(root, path, "R15", message, "link", ring, "a tree")


def _check_limits(root: Any, path: Path) -> list[str]:
    """R13, R14, R19: axes with a direction, ranges not empty, angles that look like rad."""
    notes, turns = [], []
    for joint in root.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        axis, limit = joint.find("axis"), joint.find("limit")
        direction = axis.get("xyz", "1 0 0").split() if axis is not None else ["1"]
        if kind != "fixed" and math.hypot(*map(float, direction)) < 1e-9:
            raise error_at(axis, path, "R13", f"joint {name} has a zero axis", "axis")
        if kind not in ("revolute", "prismatic"):
            continue
        if limit is None:
            raise error_at(joint, path, "R14", f"joint {name} ({kind}) has no <limit>", "limit")
        lower, upper = float(limit.get("lower", 0)), float(limit.get("upper", 0))
        if note := check_range(limit, path, "limit", f"joint {name}", (lower, upper)):
            notes.append(note)
        elif kind == "revolute":
            turns.append(max(abs(lower), abs(upper)))
    return notes + angle_notes(turns)


def _check_meshes(root: Any, path: Path, options: FileOptions) -> list[str]:
    """R6 and R7: mesh files are there, and inside the model's folder."""
    notes, folder = [], options.folder(path)
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" in name and not name.startswith(("package://", "file://")):
            raise not_local(mesh, path, "filename", name)
        if not name:
            raise error_at(mesh, path, "R7", f"{called(mesh)} has no filename", "filename")
        candidates = mesh_files(name, folder)
        if not all(file.resolve().is_relative_to(folder) for file in candidates):
            raise outside(mesh, path, "filename", name, folder)
        if not any(file.is_file() for file in candidates):
            if not options.allow_missing_meshes:
                raise missing(mesh, path, "filename", name, folder)
            notes.append(f"mesh {name} is missing: {called(mesh)}")
    return notes
