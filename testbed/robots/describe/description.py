"""What a URDF or an MJCF describes, before it becomes a chain: axes, bodies, shapes."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.errors import refuse
from calib.geometry.chain import Chain, JointKind
from testbed.names import choice_of, some
from testbed.robots.describe.axes import chain_from_axes
from testbed.robots.parts import Form
from testbed.robots.source import OwnText

TOOL_NAMES = ("tool0", "tool")
"""Names of an end that is the tool if the arm has several ends."""
HELD_ELSEWHERE = (
    "free it, write the arm as a robot.toml by truebed.write_robot, and state under [controller] "
    "how it follows the others"
)
"""Advice on a joint on the way to the tool that others move."""
MOST_JOINTS = 64
"""Most joints from base to tip, far more than any arm has; the work grows with their square."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One mesh or plain shape of a body."""

    source: Path | Form
    """The file of a mesh, or the shape itself."""
    affine: Array
    """(4, 4) transform of its points to the world at joint zero, with the scale of a mesh [m]."""
    rgb: tuple[float, float, float]
    """Color, 0 to 1."""
    collides: bool
    """Whether it takes part in collision tests."""
    drawn: bool = True
    """Whether it is seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Everything that moves with one joint, in the world frame at joint zero."""

    name: str
    """Name for messages and parts."""
    mass: float = 0.0
    """Mass; zero if the file does not state it [kg]."""
    center: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) center of mass [m]."""
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3) about the center, world axes [kg m^2]."""
    shapes: tuple[Shape, ...] = ()
    """Shapes that are drawn or collide."""
    unread: bool = False
    """Whether it has a colliding shape that cannot be read, and no drawn one to replace it."""


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """A serial arm as its file describes it."""

    name: str
    """Name of the arm in the file."""
    path: Path
    """The file."""
    folder: Path
    """Folder with all its meshes."""
    reader: str
    """Name of the other reader of such files: yourdfpy or MuJoCo."""
    joint_names: tuple[str, ...]
    """(n,) base to tip."""
    kinds: tuple[JointKind, ...]
    """(n,)"""
    points: Array
    """(n, 3) a point on each axis at joint zero, in the world [m]."""
    axes: Array
    """(n, 3) unit direction of each axis at joint zero, in the world."""
    T_world_tip: Array
    """(4, 4) tip at joint zero [m]."""
    limits: Array
    """(n, 2) lower and upper joint limits, -inf and inf where there are none [rad or m]."""
    speeds: Array
    """(n,) largest joint speeds, inf where the file does not state them [rad/s or m/s]."""
    bodies: tuple[Body, ...]
    """(n + 1,) base first."""
    poses: Callable[[Array], Array]
    """Poses of the tip (m, 4, 4) at q (m, n), by the other reader [m]."""
    apart: tuple[tuple[int, int], ...] = ()
    """Pairs of bodies that the file excludes from collision tests."""
    notes: tuple[str, ...] = ()
    """Sentences on what is legal but odd."""
    stands: bool = False
    """Whether the link that the first joint turns on stands upright in the world."""
    own_text: OwnText | None = None
    """The text that it was read from."""

    @property
    def chain(self) -> Chain:
        """Its geometry in link numbers, from the world to the tip [m, rad]."""
        return chain_from_axes(self.points, self.axes, self.kinds, self.T_world_tip)


def shapes_of(
    drawn: Sequence[Shape | None], solid: Sequence[Shape | None]
) -> tuple[list[Shape], bool]:
    """Drawn and colliding shapes as one list, and whether a colliding shape is missing from it.

    None is a shape that cannot be read. If that is a colliding one, drawn shapes collide instead;
    if no drawn one can be read, colliding shapes are drawn.
    """
    unread = any(one is None for one in solid)
    seen, hulls = (
        {(one.source, one.affine.tobytes()): one for one in some if one is not None}
        for some in (drawn, solid)
    )
    out = [replace(one, collides=unread or key in hulls) for key, one in seen.items()]
    out += [
        replace(one, collides=True, drawn=not seen) for key, one in hulls.items() if key not in seen
    ]
    return out, unread and not seen


def choose_tip(
    tip: str | None, ends: Iterable[str], known: Iterable[str], path: Path
) -> tuple[str, str]:
    """Frame at which the arm ends, and a sentence if it was chosen among several.

    Parameters
    ----------
    tip : str, optional
        Frame that the user asks for.
    ends : iterable of str
        Frames without children.
    known : iterable of str
        All frames.
    path : Path
        File, for the message.

    Raises
    ------
    InputError
        R16: there is no such frame, or there are several ends and none of `TOOL_NAMES`.
    """
    ends, known = list(ends), list(known)
    if tip is not None:
        if tip in known:
            return tip, ""
        message, fix = f'there is no link "{tip}"', choice_of(tip, known)
        raise refuse("tip", tip, code="R16", message=message, fix=fix, where=str(path))
    if len(ends) == 1:
        return ends[0], ""
    for name in TOOL_NAMES:
        if name in ends:
            others = some([end for end in ends if end != name])
            return name, f"the arm is taken to end at {name}; it also has {others}"
    message = f"the arm has {len(ends)} ends: {some(ends)}"
    raise refuse(
        "tip", ends, "it must be a serial arm, with one end", code="R16", message=message,
        fix="name the end that is calibrated: --tip LINK (for a scenario: truebed new scene)",
        where=str(path),
    )  # fmt: skip


def check_count(moving: int, tip: str, path: Path) -> None:
    """R16: require at least one and at most `MOST_JOINTS` moving joints on the way to the tip."""
    if not 1 <= moving <= MOST_JOINTS:
        message = f"{moving or 'no'} joint{'s' * (moving > 1)} move{'s' * (moving < 1)} {tip}"
        allowed = f"an arm has 1 to {MOST_JOINTS}"
        raise refuse("tip", tip, allowed, code="R16", message=message, where=str(path))


def plain_name(text: str, *, default: str) -> str:
    """A name as robot.toml allows it: small letters, digits, underscores, at most 48."""
    name = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")[:48]
    return name if name[:1].isalpha() else f"{default}_{name}".rstrip("_")[:48]
