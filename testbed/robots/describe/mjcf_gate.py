"""Checks of an MJCF before MuJoCo reads it, and its content as one text without further files.

Includes and meshes are read here; MuJoCo gets a text and bytes, and opens no file.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from calib.errors import refuse
from testbed.bounds import COORDINATE, DENSITY, DIRECTION, INERTIA, LIMIT, LINK, MASS, SCALE
from testbed.gates.paths import real
from testbed.robots.describe.mesh_gate import check_scale, mesh_path, missing, not_local, outside
from testbed.robots.describe.xml_gate import (
    LARGEST,
    SOURCE,
    FileOptions,
    Row,
    called,
    check_numbers,
    check_range,
    error_at,
    parse_xml,
    place_of,
    read_xml,
)
from testbed.robots.meshes.files import check_meshes, mesh_bytes

MOMENT = replace(INERTIA, least=0.0)
NUMBERS = {
    "ref": Row(1, LIMIT), "range": Row(2, LIMIT), "euler": Row(3, LIMIT),
    "mass": Row(1, MASS, "kg"), "density": Row(1, DENSITY, "kg/m3"),
    **dict.fromkeys(("pos", "refpos"), Row(3, LINK, "m")), "fromto": Row(6, LINK, "m"),
    **dict.fromkeys(("zaxis", "axis"), Row(3, DIRECTION)), "xyaxes": Row(6, DIRECTION),
    **dict.fromkeys(("quat", "axisangle", "refquat"), Row(4, DIRECTION)), "rgba": Row(4),
    "diaginertia": Row(3, MOMENT, "kg m2"), "fullinertia": Row(6, MOMENT, "kg m2"),
    "scale": Row(3, SCALE),
}  # fmt: skip
"""The numbers in each attribute; MuJoCo itself requires moments above zero."""
CODE = ("plugin", "extension")
UNKNOWN = ("composite", "flexcomp", "flex", "replicate", "attach", "model")
"""Elements that expand into others when compiled, which descriptions of arms do not need."""
UNUSED = (
    *("visual", "statistic", "size", "option", "custom", "keyframe", "sensor", "texture"),
    *("hfield", "skin", "deformable", "light", "camera"),
)
"""Elements that do not matter for the place of a tool; taken out."""
MOST_ELEMENTS, MOST_BODIES, MOST_FILES = 10_000, 2_000, 64
"""Far more than any arm has: MuJoCo compares all names and all bodies with each other."""
PATHS = ("meshdir", "texturedir", "assetdir", "strippath", "discardvisual", "fusestatic")
"""Attributes of <compiler> that are settled here."""
LOCKED = 1e-6
"""A range that is empty gets this to both sides, in the file's unit."""


@dataclass(slots=True, eq=False)
class Gated:
    """An MJCF that may be compiled."""

    root: Any
    """Its tree (lxml), one document."""
    files: dict[str, Path] = field(default_factory=dict)
    """Mesh files by the names of their meshes."""
    notes: list[str] = field(default_factory=list)
    """What is legal but odd, in sentences."""

    def assets(self) -> dict[str, bytes]:
        """Bytes of the meshes, looked at, under the names they have in the text."""
        check_meshes(*self.files.values())
        return dict(zip(self.asset_names(), map(mesh_bytes, self.files.values()), strict=True))

    def asset_names(self) -> list[str]:
        """Names of the mesh files in the text."""
        return [_asset_name(k, file) for k, file in enumerate(self.files.values())]


def gate(path: Path, options: FileOptions, data: bytes) -> Gated:
    """Check an MJCF, whose content is `data`, and all it includes.

    Raises
    ------
    InputError
        At the first thing that is wrong, with its line: R1 to R8, R11 to R14, R17.
    """
    folder = options.folder(path)
    root = whole(path, folder, data)
    elements = list(root.iter("*"))
    for most, what in ((MOST_ELEMENTS, elements), (MOST_BODIES, list(root.iter("body")))):
        if len(what) > most:
            kind = "elements" if what is elements else "bodies"
            message, allowed = f"has {len(what)} {kind}", f"at most {most}"
            raise refuse(kind, allowed=allowed, code="R2", message=message, where=str(path))
    gated = Gated(root)
    for element in list(root.iter(*UNUSED)):
        _remove(element)
    for geom in [geom for geom in root.iter("geom") if geom.get("hfield")]:
        _remove(geom)  # ground, whose heights are taken out
    for element in root.iter("*"):
        _check_known(element, path)
        if element.tag != "material":
            check_numbers(element, path, NUMBERS)
            _check_size(element, path)
    for mesh in root.iter("mesh"):
        check_scale(mesh, path)
    for joint in root.iter("joint"):
        _check_joint(joint, path, gated.notes)
    _settle_meshes(gated, path, folder, allow_missing=options.allow_missing_meshes)
    return gated


def whole(path: Path, folder: Path, data: bytes) -> Any:
    """The tree of a file, whose content is `data`, with the files it includes in their places.

    Elements of these have their file as `SOURCE`.
    """
    root = parse_xml(data, "mujoco", where=str(path))
    return _with_includes(root, path, [path], folder, set())


def _with_includes(
    root: Any, path: Path, trail: list[Path], folder: Path, seen: set[Path]
) -> Any:  # fmt: skip
    """The tree of one of the files of a trail, with what it includes."""
    seen.add(path.resolve())
    for element in list(root.iter("include")):
        name = element.get("file", "")
        place = place_of(element, path)
        beside = {
            real(one / name, field="include", code="R8", where=place): one / name
            for one in (trail[0].parent, path.parent)
        }
        found = next((one for one in beside if one.is_file()), next(iter(beside)))
        file = beside[found]
        chain = " -> ".join([*(one.name for one in trail), name])
        problem = ""
        if not name or not found.is_file():
            problem = f"include {name} is missing"
        elif not found.is_relative_to(folder):
            problem = f"include {name} lies outside {folder}"
        elif found in seen:
            problem = f"include {name} appears twice, or within itself"
        elif len(seen) >= MOST_FILES:
            problem = f"more than {MOST_FILES} files are included"
        elif sum(one.stat().st_size for one in (*seen, found)) > LARGEST:
            problem = f"the included files have more than {LARGEST} bytes"
        if problem:
            raise error_at(element, path, "R8", f"{problem} ({chain})", "include", name)
        part = read_xml(file, "mujoco", "mujocoinclude")
        part = _with_includes(part, file, [*trail, file], folder, seen)
        parent = element.getparent()
        for child in list(part):
            for one in child.iter("*"):
                if one.get(SOURCE) is None:
                    one.set(SOURCE, str(file))
            element.addprevious(child)
        parent.remove(element)
    return root


def _remove(element: Any) -> None:
    """Take an element out, if it is still in."""
    parent = element.getparent()
    if parent is not None:
        parent.remove(element)


def _check_known(element: Any, path: Path) -> None:
    """R8: refuse what runs code or expands when compiled, and patterns of C's printf."""
    tag = element.tag
    for key, value in element.items():
        if "%" in value:  # MuJoCo prints what it refuses by itself as a pattern, and dies of %n
            message = f'{key} of <{tag}> is "{value}", and % means a value to MuJoCo'
            raise error_at(element, path, "R8", message, key, value, fix="write it without %")
    if tag in CODE:
        message = f"<{tag}> is not allowed: plugins run code"
        raise error_at(element, path, "R8", message, tag, fix="remove it")
    if tag in UNKNOWN or element.get("builtin"):
        fix = "remove it, or let MuJoCo compile and save the model first"
        message = f"<{tag}> cannot be read as part of an arm"
        raise error_at(element, path, "R8", message, tag, fix=fix)


def _check_size(element: Any, path: Path) -> None:
    """R11: shapes of sensible size, whatever their count of numbers."""
    if 1 <= (many := len(element.get("size", "").split(None, 4))) <= 3:
        check_numbers(element, path, {"size": Row(many, COORDINATE, "m")})


def _check_joint(joint: Any, path: Path, notes: list[str]) -> None:
    """R13 and R14: an axis with a direction, a range that is not empty."""
    axis = [float(word) for word in joint.get("axis", "0 0 1").split()]
    if joint.get("type") not in ("ball", "free") and math.hypot(*axis) < 1e-9:
        raise error_at(joint, path, "R13", f"{called(joint)} has a zero axis", "axis")
    if joint.get("range") is None or joint.get("limited") == "false":
        return
    lower, upper = (float(word) for word in joint.get("range").split())
    if lower == upper == 0 and joint.get("limited") != "true":
        return  # what MuJoCo has for no range
    note = check_range(joint, path, "range", called(joint), (lower, upper))
    if note:
        joint.set("range", f"{lower - LOCKED!r} {upper + LOCKED!r}")
        notes.append(note)


def _settle_meshes(gated: Gated, path: Path, folder: Path, *, allow_missing: bool) -> None:
    """R6 and R7: mesh files are there and inside the folder; each gets a name MuJoCo is handed."""
    root, place, strip = gated.root, "", False
    for compiler in root.iter("compiler"):
        place = compiler.get("meshdir") or compiler.get("assetdir") or place
        strip = compiler.get("strippath", str(strip).lower()) == "true"
        for key in PATHS:
            compiler.attrib.pop(key, None)
    for material in root.iter("material"):
        material.attrib.pop("texture", None)
        for layer in list(material):
            _remove(layer)
    gone: set[str] = set()
    for mesh in [mesh for asset in root.iter("asset") for mesh in asset.findall("mesh")]:
        name = mesh.get("file")
        if name is None:
            continue  # its vertices stand in the text
        if "://" in name:
            raise not_local(mesh, path, "file", name)
        plain = Path(name.replace("\\", "/"))
        own = mesh.get("name") or plain.stem
        file = _mesh_file(mesh, Path(place) / (plain.name if strip else plain), path, folder)
        if file is None:
            if not allow_missing:
                raise missing(mesh, path, "file", name, folder)
            gated.notes.append(f"mesh {name} is missing")
            gone.add(own)
            _remove(mesh)
            continue
        mesh.set("name", own)
        mesh.set("file", _asset_name(len(gated.files), file))
        gated.files[own] = file
    for geom in [geom for geom in root.iter("geom") if geom.get("mesh") in gone]:
        _remove(geom)


def _mesh_file(mesh: Any, name: Path, path: Path, folder: Path) -> Path | None:
    """Where a mesh lies, or None; refused if that is outside the folder."""
    candidates = [folder / name, path.parent / name]
    inside = [file for file in candidates if mesh_path(mesh, path, file).is_relative_to(folder)]
    found = next((file for file in inside if file.is_file()), None)
    if found is None and len(inside) < len(candidates):
        raise outside(mesh, path, "file", name.as_posix(), folder)
    return found


def _asset_name(number: int, file: Path) -> str:
    """Under which name MuJoCo is handed a mesh, whatever its file and folder are called."""
    return f"mesh{number}{file.suffix.lower()}"
