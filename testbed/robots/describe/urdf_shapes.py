"""The shapes of a URDF: checked, named after their kind, and read."""

from pathlib import Path
from typing import Any

from testbed.bounds import SHAPE
from testbed.names import some
from testbed.robots.describe.xml_gate import called, error_at, need
from testbed.robots.parts import Form

SHAPES: dict[str, tuple[str, ...]] = {
    "box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"),
    "sphere": ("radius",), "mesh": ("filename",),
}  # fmt: skip
"""What a geometry may be, and what it needs."""
UNREAD = "unread"
"""Name of a part whose shape is none that is known, or has no size."""


def check_shapes(root: Any, path: Path) -> list[str]:
    """R16: require a shape for each part; sentences on unknown shapes and on sizes of zero."""
    unknown, nothing = [], []
    for part in _parts(root):
        geometry = part.find("geometry")
        shape = next(iter(geometry), None) if geometry is not None else None
        if shape is None:
            message, allowed = f"{called(part)} has no geometry", f"one of {', '.join(SHAPES)}"
            raise error_at(part, path, "R16", message, "geometry", None, allowed)
        if shape.tag not in SHAPES:
            unknown.append(called(shape))
        for attribute in SHAPES.get(shape.tag, ()):
            need(shape, path, attribute)
        if empty := _without_size(shape):
            nothing.append(f'{called(shape)} with {empty}="{shape.get(empty)}"')
    notes = []
    if unknown:
        notes.append(f"no shape that is known, and left out: {some(unknown)}")
    if nothing:
        notes.append(f"no shape of that size: {some(nothing)}; {SHAPE.allowed('m')}")
    return notes


def _parts(root: Any) -> list[Any]:
    """Everything that is drawn or collides."""
    return [*root.iterfind("link/visual"), *root.iterfind("link/collision")]


def _without_size(shape: Any) -> str:
    """The first attribute by which a plain shape has no size, if there is one."""
    needed = () if shape.tag == "mesh" else SHAPES.get(shape.tag, ())
    return next((a for a in needed if min(map(float, shape.get(a).split())) < SHAPE.least), "")


def name_shapes(root: Any) -> None:
    """Name each part after its shape, or `UNREAD`, and write what yourdfpy does not know as a ball.

    A capsule, which it does not know either, becomes a cylinder.
    """
    for part in _parts(root):
        shape = part.find("geometry")[0]
        known = shape.tag in SHAPES and not _without_size(shape)
        part.set("name", shape.tag if known else UNREAD)
        if shape.tag == "capsule":
            shape.tag = "cylinder"
        elif shape.tag not in SHAPES:
            shape.tag = "sphere"
            shape.set("radius", "1")


def form_of(part: Any) -> Form | None:
    """A plain shape; the name of the part says which (`name_shapes`)."""
    shape, kind = part.geometry, part.name
    if kind == UNREAD:
        return None
    if shape.box is not None:
        return Form("box", tuple(map(float, shape.box.size)))
    if shape.sphere is not None:
        return Form("sphere", (float(shape.sphere.radius),))
    rod = shape.cylinder
    size = (float(rod.radius), float(rod.length))
    return Form("capsule" if kind == "capsule" else "cylinder", size)
