"""What an MJCF must satisfy before MuJoCo sees it, and one text with no other file behind it.

Includes are opened here, meshes are read here; MuJoCo gets a text and bytes and opens nothing.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib.errors import InputError
from testbed.robots.describe.mjcf_includes import SOURCE, error_at, remove, whole
from testbed.robots.describe.mjcf_meshes import asset_name, settle_meshes
from testbed.robots.describe.urdf_checks import WORDS

NUMBERS = {
    "pos": 3,
    "quat": 4,
    "axisangle": 4,
    "euler": 3,
    "xyaxes": 6,
    "zaxis": 3,
    "axis": 3,
    "fromto": 6,
    "range": 2,
    "ref": 1,
    "mass": 1,
    "density": 1,
    "diaginertia": 3,
    "fullinertia": 6,
    "scale": 3,
    "refpos": 3,
    "refquat": 4,
    "rgba": 4,
}
"""How many numbers each attribute holds."""
COUNTED = {2: "two numbers, spaces between them", 6: "six numbers, spaces between them", **WORDS}
CODE = ("plugin", "extension")
UNKNOWN = ("composite", "flexcomp", "flex", "replicate", "attach", "model")
"""Elements that grow into others when compiled: nothing an arm is described with."""
UNUSED = (
    "visual",
    "statistic",
    "size",
    "option",
    "custom",
    "keyframe",
    "sensor",
    "texture",
    "hfield",
    "skin",
    "deformable",
    "light",
    "camera",
)
"""Elements that say nothing about where a tool is; taken out."""
MOST_ELEMENTS = 50_000
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
        """Bytes of the meshes under the names they have in the text."""
        return {
            asset_name(k, file): file.read_bytes() for k, file in enumerate(self.files.values())
        }


def gate(path: Path, *, mesh_root: Path | None, allow_missing_meshes: bool) -> Gated:
    """Check an MJCF and all it includes.

    Raises
    ------
    InputError
        At the first thing that is wrong, with its line: R1 to R8, R11 to R14, R17.
    """
    folder = (mesh_root or path.parent).resolve()
    root = whole(path, [path], folder, set())
    elements = list(root.iter("*"))
    if len(elements) > MOST_ELEMENTS:
        raise InputError(
            f"has {len(elements)} elements",
            code="R2",
            where=str(path),
            field="elements",
            allowed=f"at most {MOST_ELEMENTS}",
        )
    gated = Gated(root)
    for element in elements:
        _check_known(element, path)
        _check_numbers(element, path)
    for joint in root.iter("joint"):
        _check_joint(joint, path, gated.notes)
    for element in list(root.iter(*UNUSED)):
        remove(element)
    gated.files = settle_meshes(root, path, folder, gated.notes, allow_missing=allow_missing_meshes)
    for element in root.iter("*"):
        element.attrib.pop(SOURCE, None)
    return gated


def _check_known(element: Any, path: Path) -> None:
    """R8: nothing that runs code, nothing that grows when compiled."""
    if element.tag in CODE:
        raise error_at(
            f"<{element.tag}> is not allowed: plugins run code",
            "R8",
            path,
            element,
            element.tag,
            fix="remove it",
        )
    if element.tag in UNKNOWN:
        raise error_at(
            f"<{element.tag}> cannot be read as part of an arm",
            "R8",
            path,
            element,
            element.tag,
            fix="remove it, or let MuJoCo compile and save the model first",
        )


def _check_numbers(element: Any, path: Path) -> None:
    """R11 and R12: the right count of finite numbers in each numeric attribute."""
    if element.tag in UNUSED or element.tag == "material":
        return
    for attribute, count in NUMBERS.items():
        text = element.get(attribute)
        if text is None:
            continue
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        shown = f'{_called(element)} has {attribute}="{text}"'
        if len(values) != count:
            raise error_at(
                shown, "R12", path, element, attribute, value=text, allowed=COUNTED[count]
            )
        if not all(math.isfinite(value) for value in values):
            raise error_at(
                shown,
                "R11",
                path,
                element,
                attribute,
                value=text,
                allowed="every value must be finite",
            )


def _called(element: Any) -> str:
    """Tag and name, the enclosing body's if it has none itself."""
    name = element.get("name")
    if name is not None:
        return f"{element.tag} {name}"
    above = element.getparent()
    inside = above.get("name") if above is not None else None
    return f"<{element.tag}>" + (f" in {above.tag} {inside}" if inside else "")


def _check_joint(joint: Any, path: Path, notes: list[str]) -> None:
    """R13 and R14: an axis with a direction, a range that is not empty."""
    axis = [float(word) for word in joint.get("axis", "0 0 1").split()]
    if joint.get("type") not in ("ball", "free") and math.hypot(*axis) < 1e-9:
        raise error_at(f"{_called(joint)} has a zero axis", "R13", path, joint, "axis")
    if joint.get("range") is None:
        return
    lower, upper = (float(word) for word in joint.get("range").split())
    if lower > upper:
        raise error_at(
            f"{_called(joint)} has lower {lower:g} above upper {upper:g}",
            "R14",
            path,
            joint,
            "range",
            value=(lower, upper),
            allowed="lower below upper",
        )
    if lower == upper and joint.get("limited") != "false":
        joint.set("range", f"{lower - LOCKED!r} {upper + LOCKED!r}")
        notes.append(f"{_called(joint)} cannot move: lower and upper are both {lower:g}")
