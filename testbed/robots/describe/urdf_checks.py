"""What a URDF must satisfy before a library sees it: numbers, names, tree, limits, mesh files."""

import math
from pathlib import Path
from typing import Any

from calib.errors import InputError
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
WORDS = {1: "one number", 3: "three numbers, spaces between them", 4: "four numbers"}
MOST_LINKS = 2000
"""Far more than any arm has; what is checked per link stays quick."""
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def check_urdf(
    root: Any, path: Path, *, mesh_root: Path | None = None, allow_missing_meshes: bool = False
) -> list[str]:
    """Check a parsed URDF (lxml); returns sentences about what is odd but legal.

    Raises
    ------
    InputError
        At the first thing that is wrong, with its line: R6, R7, R11 to R16.
    """
    macro = next((one for one in root.iter("{*}*") if "xacro" in str(one.tag)), None)
    if macro is not None:
        raise _error(
            "has xacro macros, which are not URDF yet",
            "R2",
            path,
            macro,
            "xacro",
            fix="write them out first: xacro arm.xacro > arm.urdf",
        )
    if len(root.findall("link")) > MOST_LINKS:
        raise _error(
            f"there are {len(root.findall('link'))} links",
            "R2",
            path,
            root,
            "link",
            allowed=f"at most {MOST_LINKS}",
        )
    for element in root.iter(*NUMBERS):
        _check_numbers(element, path)
    _check_tree(root, path)
    notes = _check_limits(root, path)
    folder = (mesh_root or path.parent).resolve()
    return notes + _check_meshes(root, path, folder, allow_missing_meshes)


def mesh_files(name: str, folder: Path) -> list[Path]:
    """Where the mesh of a URDF may lie: below the folder, or below the package it names there."""
    plain = name.removeprefix("file://").removeprefix("package://")
    candidates = [folder / plain]
    if name.startswith("package://"):  # the package's folder may be the root itself
        candidates.append(folder / plain.partition("/")[2])
    return candidates


def angle_notes(largest: list[float]) -> list[str]:
    """R19: sentences about the largest angles (n,) of turning joints that are in doubt [rad]."""
    if largest and max(largest) > 4 * math.pi:
        return [f"a joint limit is {max(largest):.6g} rad: were degrees taken for radians?"]
    if largest and max(largest) < 0.12:
        return [f"all joint limits are below {max(largest):.3g} rad: were radians converted twice?"]
    return []


def _error(
    message: str, code: str, path: Path, element: Any, field: str, **more: Any
) -> InputError:
    """An error with the line it is about."""
    where = f"{path}:{element.sourceline}"
    return InputError(message, code=code, where=where, field=field, **more)


def _name(element: Any) -> str:
    """Tag and name, the enclosing element's if it has none itself."""
    holder = element
    while holder.get("name") is None and holder.getparent() is not None:
        holder = holder.getparent()
    inside = f" in {holder.tag} {holder.get('name')}" if holder is not element else ""
    return f"<{element.tag}>{inside}" if inside else f"{element.tag} {element.get('name')}"


def _check_numbers(element: Any, path: Path) -> None:
    """R11 and R12: the right count of finite numbers in each numeric attribute."""
    for attribute, count in NUMBERS[element.tag].items():
        text = element.get(attribute)
        if text is None:
            continue
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        uniform_scale = element.tag == "mesh" and len(values) == 1
        if len(values) != count and not uniform_scale:
            raise _error(
                f'{_name(element)} has {attribute}="{text}"',
                "R12",
                path,
                element,
                attribute,
                value=text,
                allowed=WORDS[count],
            )
        if not all(math.isfinite(value) for value in values):
            raise _error(
                f'{_name(element)} has {attribute}="{text}"',
                "R11",
                path,
                element,
                attribute,
                value=text,
                allowed="every value must be finite",
            )


def _check_tree(root: Any, path: Path) -> None:
    """R15 and R16: unique names, known links, one root, every link below it."""
    links, joints = root.findall("link"), root.findall("joint")
    for kind, elements in (("link", links), ("joint", joints)):
        seen: set[str] = set()
        for element in elements:
            name = element.get("name")
            if not name or name in seen:
                problem = f"{kind} {name} is there twice" if name else f"a <{kind}> has no name"
                raise _error(problem, "R15", path, element, "name", value=name)
            seen.add(name)
    names = [link.get("name") for link in links]
    if not names:
        raise _error("there is no link", "R2", path, root, "link")
    parent_of: dict[str, str] = {}
    for joint in joints:
        parent, child = (_joint_end(joint, end, names, path) for end in ("parent", "child"))
        if child in parent_of:
            raise _error(
                f"link {child} is the child of two joints",
                "R15",
                path,
                joint,
                "child",
                value=child,
                allowed="a tree",
            )
        parent_of[child] = parent
    _check_one_root(names, parent_of, root, path)


def _joint_end(joint: Any, end: str, names: list[str], path: Path) -> str:
    """Link a joint begins or ends at."""
    name = joint.get("name")
    if joint.get("type") not in JOINT_TYPES:
        raise _error(
            f"joint {name} has type {joint.get('type')}",
            "R16",
            path,
            joint,
            "type",
            value=joint.get("type"),
            allowed=f"one of {', '.join(JOINT_TYPES)}",
        )
    element = joint.find(end)
    link = element.get("link") if element is not None else None
    if link is None:
        raise _error(f"joint {name} has no <{end} link=...>", "R16", path, joint, end)
    if link not in names:
        raise _error(
            f"joint {name} has {end} link {link}, which does not exist",
            "R16",
            path,
            element,
            end,
            value=link,
            fix=choice_of(link, names),
        )
    return str(link)


def _check_one_root(names: list[str], parent_of: dict[str, str], root: Any, path: Path) -> None:
    """Exactly one link without parent, and no ring of links beside it."""
    tops = [name for name in names if name not in parent_of]
    if len(tops) > 1:
        raise _error(
            f"there are {len(tops)} root links: {', '.join(tops)}",
            "R15",
            path,
            root,
            "link",
            value=tops,
            allowed="one",
        )
    for name in names:
        trail = [name]
        while trail[-1] in parent_of and parent_of[trail[-1]] not in trail:
            trail.append(parent_of[trail[-1]])
        if trail[-1] in parent_of:
            ring = trail[trail.index(parent_of[trail[-1]]) :]
            raise _error(
                f"links {', '.join(reversed(ring))} form a ring",
                "R15",
                path,
                root,
                "link",
                value=ring,
                allowed="a tree",
            )


def _check_limits(root: Any, path: Path) -> list[str]:
    """R13, R14, R19: axes with a direction, ranges not empty, angles that look like rad."""
    notes, turns = [], []
    for joint in root.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        axis, limit = joint.find("axis"), joint.find("limit")
        direction = axis.get("xyz", "1 0 0").split() if axis is not None else ["1"]
        if kind != "fixed" and math.hypot(*map(float, direction)) < 1e-9:
            raise _error(f"joint {name} has a zero axis", "R13", path, axis, "axis")
        if kind not in ("revolute", "prismatic"):
            continue
        if limit is None:
            raise _error(f"joint {name} ({kind}) has no <limit>", "R14", path, joint, "limit")
        lower, upper = float(limit.get("lower", 0)), float(limit.get("upper", 0))
        if lower > upper:
            raise _error(
                f"joint {name} has lower {lower:g} above upper {upper:g}",
                "R14",
                path,
                limit,
                "limit",
                value=(lower, upper),
                allowed="lower below upper",
            )
        if lower == upper:
            notes.append(f"joint {name} cannot move: lower and upper are both {lower:g}")
        elif kind == "revolute":
            turns.append(max(abs(lower), abs(upper)))
    return notes + angle_notes(turns)


def _check_meshes(root: Any, path: Path, folder: Path, allow_missing: bool) -> list[str]:
    """R6 and R7: mesh files are there, and inside the model's folder."""
    notes = []
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" in name and not name.startswith(("package://", "file://")):
            raise _error(
                f"mesh {name} is not a local file",
                "R7",
                path,
                mesh,
                "filename",
                value=name,
                fix="download it and name the file",
            )
        if not name:
            raise _error(f"{_name(mesh)} has no filename", "R7", path, mesh, "filename")
        candidates = mesh_files(name, folder)
        outside = [file for file in candidates if not file.resolve().is_relative_to(folder)]
        if outside:
            raise _error(
                f"mesh {name} lies outside {folder}",
                "R6",
                path,
                mesh,
                "filename",
                value=name,
                fix="give the folder that holds all meshes as mesh_root",
            )
        if not any(file.is_file() for file in candidates):
            if not allow_missing:
                raise _error(
                    f"mesh {name} is missing",
                    "R7",
                    path,
                    mesh,
                    "filename",
                    value=name,
                    allowed=f"a file below {folder}",
                    fix="give the folder that holds all meshes as mesh_root, or allow missing "
                    "meshes",
                )
            notes.append(f"mesh {name} is missing: {_name(mesh)}")
    return notes
