"""[[shapes]] of robot.toml: parts that are plain shapes, read and written."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from calib.geometry.frames import transform_step
from testbed.bounds import SHAPE
from testbed.robots.links import Angle, AttachedPart, Vector
from testbed.robots.parts import Form, Primitive
from testbed.robots.placements import frame_of
from testbed.robots.units import degrees, millimeters
from testbed.strict import PlainText

Size = Annotated[float, SHAPE.size("mm")]
Rgb = tuple[float, float, float]
GRAY: Rgb = (0.7, 0.7, 0.7)
"""Color of what has none."""


class PlainShape(AttachedPart):
    """What all plain shapes share beside."""

    position_mm: Vector = (0.0, 0.0, 0.0)
    """Its center in the frame of the body."""
    rotation_vector_deg: Annotated[tuple[Angle, ...], Field(min_length=3, max_length=3)] = (
        0.0, 0.0, 0.0,
    )  # fmt: skip
    """Turn of its axes against those of the body."""
    color: PlainText = ""
    """One of the names under [colors]; gray without."""
    collides: bool = True
    """Whether it takes part in tests of collision, exactly as it is."""
    drawn: bool = True
    """Whether it is seen: drawn, and in the way of beams. Not where a mesh is drawn for it."""


class BoxShape(PlainShape):
    """[[shapes]] kind "box"."""

    kind: Literal["box"]
    """A box."""
    size_mm: Annotated[tuple[Size, ...], Field(min_length=3, max_length=3)]
    """Full lengths of its edges."""


class SphereShape(PlainShape):
    """[[shapes]] kind "sphere"."""

    kind: Literal["sphere"]
    """A ball."""
    radius_mm: Size
    """Its radius."""


class RodShape(PlainShape):
    """[[shapes]] kind "cylinder" or "capsule"."""

    kind: Literal["cylinder", "capsule"]
    """A cylinder along z; a capsule is one with half a ball on each end."""
    radius_mm: Size
    """Its radius."""
    length_mm: Size
    """Of the cylinder, the half balls of a capsule aside."""


ShapeEntry = Annotated[BoxShape | SphereShape | RodShape, Field(discriminator="kind")]


def primitive(entry: BoxShape | SphereShape | RodShape, colors: Mapping[str, Rgb]) -> Primitive:
    """A plain shape of a robot file [m]."""
    if isinstance(entry, BoxShape):
        size: tuple[float, ...] = entry.size_mm
    elif isinstance(entry, SphereShape):
        size = (entry.radius_mm,)
    else:
        size = (entry.radius_mm, entry.length_mm)
    T = frame_of(entry.position_mm, entry.rotation_vector_deg)
    return Primitive(
        colors[entry.color] if entry.color else GRAY,
        entry.collides,
        entry.link,
        entry.name,
        tuple(map(tuple, T.tolist())),
        entry.drawn,
        form=Form(entry.kind, tuple(length / 1e3 for length in size)),
    )


def shapes_table(
    primitives: Sequence[Primitive], colors: Mapping[Rgb, str]
) -> list[dict[str, Any]]:
    """[[shapes]] of these parts; `colors` has the names of theirs."""
    out = []
    for one in primitives:
        step, size = transform_step(np.array(one.affine)), list(map(millimeters, one.form.size))
        keys = ("size_mm",) if one.form.kind == "box" else ("radius_mm", "length_mm")
        sizes = [size] if one.form.kind == "box" else size
        out.append(
            {
                "name": one.name,
                "link": one.link,
                "kind": one.form.kind,
                **dict(zip(keys, sizes, strict=False)),
                "position_mm": [millimeters(x) for x in step[:3]],
                "rotation_vector_deg": [degrees(x) for x in step[3:]],
                "color": colors[one.rgb],
                "collides": one.collides,
                **({} if one.drawn else {"drawn": False}),
            }
        )
    return out
