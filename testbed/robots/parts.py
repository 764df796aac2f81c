"""Parts of a robot: meshes and plain shapes, each on its link, to be drawn or to collide."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from calib.arrays import Array

Affine: TypeAlias = tuple[tuple[float, ...], ...]
"""Rows of a (4, 4) matrix that takes places of a part to the frame of a link [m]."""
IN_PLACE: Affine = tuple(tuple(float(i == k) for k in range(4)) for i in range(4))
FormKind = Literal["box", "cylinder", "capsule", "sphere"]


class Form(NamedTuple):
    """A plain shape about its own center; cylinders and capsules lie along z."""

    kind: FormKind
    size: tuple[float, ...]
    """Edges of a box; radius of the others, then the length of a cylinder, or that between the
    centers of a capsule's two half balls [m]."""

    def support(self, direction: Array) -> float:
        """How far it reaches from its center along a unit vector (3,) [m]."""
        if self.kind == "box":
            return float(np.abs(direction) @ self.size) / 2
        radius, *length = self.size
        along = abs(float(direction[2])) * sum(length) / 2
        level = float(np.hypot(direction[0], direction[1])) if self.kind == "cylinder" else 1.0
        return along + radius * level


@dataclass(frozen=True, slots=True)
class Attached:
    """What all parts of a robot share: the link they move with, place, color and use."""

    rgb: tuple[float, float, float]
    """Color, 0 to 1."""
    collides: bool
    """Whether it takes part in collision tests: a mesh by its convex hull."""
    link: int
    """Body it moves with, 0 = base ... n."""
    name: str
    """Name of the part."""
    affine: Affine = IN_PLACE
    """Places in the part's own frame to places in that of the link; of a mesh with its scale."""
    drawn: bool = True
    """Whether it is seen: drawn, and in the way of beams."""


@dataclass(frozen=True, slots=True, repr=False)
class Visual(Attached):
    """One part that is a mesh."""

    file: Path = field(kw_only=True)
    """Mesh file, in the frame of its link [m] unless `affine` is given."""

    def __repr__(self) -> str:
        return f"Visual({self.name!r} of body {self.link})"


@dataclass(frozen=True, slots=True, repr=False)
class Primitive(Attached):
    """One part that is a plain shape."""

    form: Form = field(kw_only=True)
    """What it is, about its own center."""

    def __repr__(self) -> str:
        return f"Primitive({self.form.kind} {self.name!r} of body {self.link})"
