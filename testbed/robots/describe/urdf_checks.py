"""Checks of a URDF before a library reads it: numbers, names, tree, limits, mesh files."""

import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

from testbed.bounds import DIRECTION, INERTIA, LIMIT, LINK, MASS, SCALE, SLIDE_SPEED, TURN_SPEED
from testbed.names import choice_of, some
from testbed.robots.describe.mesh_gate import (
    MESHLESS,
    check_scale,
    mesh_path,
    missing,
    not_local,
    outside,
)
from testbed.robots.describe.urdf_shapes import check_shapes, name_shapes
from testbed.robots.describe.xml_gate import (
    FileOptions,
    Row,
    angle_notes,
    called,
    check_numbers,
    check_range,
    error_at,
    need,
)

NUMBERS = {
    "origin": {"xyz": Row(3, LINK, "m"), "rpy": Row(3, LIMIT, "rad")},
    "axis": {"xyz": Row(3, DIRECTION)},
    "limit": {
        "lower": Row(1, LIMIT), "upper": Row(1, LIMIT), "effort": Row(1), "velocity": Row(1),
    },
    "mass": {"value": Row(1, MASS, "kg")},
    "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), Row(1)),
    "box": {"size": Row(3, LINK, "m")},
    "cylinder": {"radius": Row(1, LINK, "m"), "length": Row(1, LINK, "m")},
    "capsule": {"radius": Row(1, LINK, "m"), "length": Row(1, LINK, "m")},
    "sphere": {"radius": Row(1, LINK, "m")},
    "mesh": {"scale": Row(3, SCALE)},
    "color": {"rgba": Row(4)},
    "mimic": {"multiplier": Row(1), "offset": Row(1)},
    "dynamics": {"damping": Row(1), "friction": Row(1)},
    "safety_controller": dict.fromkeys(
        ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), Row(1)
    ),
    "calibration": dict.fromkeys(("rising", "falling"), Row(1)),
}  # fmt: skip
"""The numbers in each attribute."""
ENDLESS = {"lower": Row(1), "upper": Row(1)}
"""Limits of a continuous joint are not used; some exporters write 1e16 for none."""
MOMENTS = ("ixx", "iyy", "izz")
MOST_LINKS = 2000
"""Far more than any arm has; what is checked per link stays quick."""
PARTS = ("link", "joint", "material")
"""Elements of an arm; all others in a URDF are for simulators and drivers."""
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
    for other in [part for part in root if part.tag not in PARTS]:
        root.remove(other)
    if (count := len(root.findall("link"))) > MOST_LINKS:
        message, allowed = f"there are {count} links", f"at most {MOST_LINKS}"
        raise error_at(root, path, "R2", message, "link", allowed=allowed)
    for element in root.iter(*NUMBERS):
        rows = NUMBERS[element.tag]
        if element.tag == "mesh" and len(element.get("scale", "").split()) == 1:
            rows = {"scale": rows["scale"]._replace(many=1)}  # the same along all axes
        if element.tag == "limit" and element.getparent().get("type") == "continuous":
            rows = rows | ENDLESS
        check_numbers(element, path, rows)
    _check_tree(root, path)
    _check_links(root, path)
    notes = [*check_shapes(root, path), *_check_limits(root, path), *_without_unused(root)]
    notes += _check_meshes(root, path, options)
    name_shapes(root)
    return notes


def mesh_files(name: str, folder: Path) -> dict[Path, Path]:
    """Where the mesh of a URDF may lie, with the folder that it may not lead out of.

    That is the folder of all meshes, and of ``package://NAME/...`` also a folder NAME that holds it
    at any depth, as packages of ROS hold ``urdf/`` beside ``meshes/``.
    """
    plain = name.removeprefix("file://").removeprefix("package://")
    places = {folder / plain: folder}
    if name.startswith("package://"):
        package, _, rest = plain.partition("/")
        places[folder / rest] = folder  # the package's folder may be the root itself
        places |= {above / rest: above for above in folder.parents if above.name == package}
    return places


def _check_tree(root: Any, path: Path) -> None:
    """R15 and R16: names that differ, known links, one root, every link below it."""
    need(root, path, "name")
    links, joints = root.findall("link"), root.findall("joint")
    for elements in (links, joints):
        seen: set[str] = set()
        for element in elements:
            need(element, path, "name")
            if (name := element.get("name")) in seen:
                message = f"{called(element)} appears twice"
                raise error_at(element, path, "R15", message, "name", name)
            seen.add(name)
    names = {link.get("name"): link for link in links}
    if not names:
        raise error_at(root, path, "R2", "there is no link", "link")
    parent_of: dict[str, str] = {}
    for joint in joints:
        parent, child = (_joint_end(joint, end, names, path) for end in ("parent", "child"))
        if child in parent_of:
            message = f"link {child} is the child of two joints"
            raise error_at(joint, path, "R15", message, "child", child, "links must form a tree")
        parent_of[child] = parent
    _check_one_root(list(names), parent_of, root, path)


def _joint_end(joint: Any, end: str, names: Collection[str], path: Path) -> str:
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
        message = f"there are {len(tops)} root links: {some(tops)}"
        raise error_at(root, path, "R15", message, "link", tops, "there must be one")
    sound = set(tops)
    for name in names:
        trail: dict[str, None] = {}  # in the order of the walk
        while name not in sound and name not in trail:
            trail[name] = None
            name = parent_of[name]
        if name in trail:
            ring = list(trail)[list(trail).index(name) :]
            message = f"links {some(ring[::-1])} form a ring"
            raise error_at(root, path, "R15", message, "link", ring, "links must form a tree")
        sound |= set(trail)


def _check_links(root: Any, path: Path) -> None:
    """R11: bodies that can exist, meshes that are not flattened."""
    for inertial in root.iterfind("link/inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is not None and float(mass.get("value", 0)) < 0:
            message = f'{called(mass)} has value="{mass.get("value")}"'
            raise error_at(mass, path, "R11", message, "mass", allowed=MASS.allowed("kg"))
        moments = {} if inertia is None else {key: float(inertia.get(key, 1)) for key in MOMENTS}
        smallest = min(moments, key=moments.__getitem__, default="")
        stated = any(abs(moment) >= INERTIA.least for moment in moments.values())
        if stated and moments[smallest] <= 0:  # exporters round zeros: -5e-20
            message = f'{called(inertia)} has {smallest}="{moments[smallest]:g}"'
            allowed = "the three moments of a body are above zero, or all left at zero"
            raise error_at(inertia, path, "R11", message, smallest, allowed=allowed)
    for mesh in root.iter("mesh"):
        check_scale(mesh, path)


def _without_unused(root: Any) -> list[str]:
    """Sentences on absurd speeds and inertias, which are removed.

    No calibration uses them, so they get the defaults of missing ones.
    """
    speeds, bodies = [], []
    for limit in root.iterfind("joint/limit"):
        sliding = limit.getparent().get("type") == "prismatic"
        bound, unit = (SLIDE_SPEED, "m/s") if sliding else (TURN_SPEED, "rad/s")
        speed = float(limit.get("velocity", 0))
        if speed > 0 and not bound.least <= speed <= bound.most:
            speeds.append(f"{called(limit)} with {speed:g} {unit} ({bound.allowed(unit)})")
            del limit.attrib["velocity"]
    for inertia in root.iterfind("link/inertial/inertia"):
        sizes = {key: abs(float(inertia.get(key, 0))) for key in NUMBERS["inertia"]}
        for key, size in sizes.items():
            least = INERTIA.least if key in MOMENTS else 0.0
            if size and not least <= size <= INERTIA.most:
                bodies.append(f"{called(inertia)} with {key}={inertia.get(key)}")
                inertia.getparent().remove(inertia)
                break
    notes = []
    if speeds:
        notes.append(f"no speed that a joint has, and not used: {some(speeds)}")
    if bodies:
        allowed = INERTIA.allowed("kg m2")
        notes.append(f"no inertia that a body has, and not used: {some(bodies)}; {allowed}")
    return notes


def _check_limits(root: Any, path: Path) -> list[str]:
    """R13, R14, R19: axes with a direction, ranges not empty, angles that look like rad."""
    notes, turns = [], []
    for joint in root.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        axis, limit = joint.find("axis"), joint.find("limit")
        direction = axis.get("xyz", "1 0 0").split() if axis is not None else ["1"]
        if limit is not None and float(limit.get("velocity", 0)) < 0:
            message, allowed = f"joint {name} has a negative speed", "a speed is above zero"
            raise error_at(limit, path, "R11", message, "velocity", allowed=allowed)
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
        places = mesh_files(name, folder)
        found = [mesh_path(mesh, path, file) for file in places]
        if not all(map(Path.is_relative_to, found, places.values())):
            if not options.allow_missing_meshes:
                raise outside(mesh, path, "filename", name, folder, MESHLESS)
            notes.append(f"mesh {name} counts as missing: it lies outside the folder of all meshes")
            mesh.set("filename", "")  # nothing out there is opened
        elif not any(file.is_file() for file in found):
            if not options.allow_missing_meshes:
                raise missing(mesh, path, "filename", name, folder)
            notes.append(f"mesh {name} is missing: {called(mesh)}")
    return notes
