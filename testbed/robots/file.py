"""The schemas of robot.toml and tracker.toml: every key with its unit, as people write them."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from calib.geometry.chain import chain_names
from calib.geometry.joint_errors import Wave
from testbed.bounds import CELL, COORDINATE
from testbed.names import choice_of
from testbed.robots.coupled import ControllerTable
from testbed.robots.links import (
    Angle,
    AttachedPart,
    Length,
    Name,
    PrismaticLink,
    RevoluteLink,
    Vector,
)
from testbed.robots.shapes import ShapeEntry
from testbed.robots.springs import SpringsTable
from testbed.robots.tolerances import LinkTolerances
from testbed.strict import PlainText, Strict

Angles = Annotated[tuple[Angle, ...], Field(min_length=3, max_length=3)]
Place = Annotated[
    tuple[Annotated[float, COORDINATE.signed("mm")], ...], Field(min_length=3, max_length=3)
]
"""Position of a frame; an identified robot is in the frame in which it was measured."""
Color = Annotated[
    tuple[Annotated[float, Field(ge=0, le=1)], ...], Field(min_length=3, max_length=3)
]


def _inside(file: str) -> str:
    """Refuse a path that could leave the model's folder."""
    if file.startswith(("/", "\\")) or ".." in file.replace("\\", "/").split("/") or ":" in file:
        raise ValueError("must stay inside the model's folder")
    return file


ModelFile = Annotated[PlainText, AfterValidator(_inside)]


class Frame(Strict):
    """A fixed frame: place and rotation vector."""

    position_mm: Place = (0.0, 0.0, 0.0)
    """Its origin."""
    rotation_vector_deg: Angles = (0.0, 0.0, 0.0)
    """Axis times angle of its rotation."""


class WorkspaceBox(Strict):
    """[workspace]: where the arm works within sight of a tracker, base frame."""

    box_center_mm: Vector
    """Center of the box."""
    box_size_mm: Annotated[
        tuple[Annotated[float, CELL.size("mm")], ...], Field(min_length=3, max_length=3)
    ]
    """Its edges."""
    station_mm: Place
    """Where the beam of the tracker starts."""
    joint_ranges_deg: tuple[
        Annotated[tuple[Angle, ...], Field(min_length=2, max_length=2)], ...
    ] = ()
    """Lowest and highest value of each joint there, narrower than its limits."""


class ReflectorEntry(Strict):
    """[[reflectors]]: a target that is mounted on the tool, place in the tool frame."""

    name: Annotated[PlainText, Field(min_length=1, max_length=200)]
    """What it is called in measurement files."""
    position_mm: Vector
    """Its center."""


class JointTermEntry(Strict):
    """[[joint_terms]]: a wave of a joint's error, wave(weights . q) times its coefficient.

    Or a term of a row's conditions: "approach" its directions, "torque" its torques beyond the
    reference, "lengths" (joint 0) its temperature. `share`: prior size relative to its kind.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][A-Za-z0-9_.]*$", max_length=64)]
    """What the coefficient is called."""
    joint: Annotated[int, Field(ge=0)]
    """Number of the joint, counted from one at the base; 0: all lengths."""
    wave: Wave
    """Function of the joints, or the condition of a row that it depends on."""
    weights: tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...]
    """One per joint: the argument of the wave is their sum times the joints."""
    reference: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    """Torque [N m, N, A] or temperature [degC] where it is zero."""
    share: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    """Prior standard deviation, in units of the usual one for its kind."""
    coefficient_deg: Angle | None = None
    """Coefficient of a turning joint; of a torque per N m."""
    coefficient_mm: Length | None = None
    """Coefficient of a sliding joint; of a force per N."""
    coefficient_per_k: Annotated[float, Field(ge=-1.0, le=1.0)] | None = None
    """Coefficient of lengths."""

    @model_validator(mode="after")
    def _has_one_coefficient(self) -> "JointTermEntry":
        """Degrees for a turning joint, millimeters for a sliding one, 1/K for lengths."""
        if self.wave == "lengths":
            if self.coefficient_per_k is None or self.joint:
                raise ValueError(f"{self.name} needs coefficient_per_k, and joint = 0")
        elif not self.joint or self.coefficient_per_k is not None:
            raise ValueError(f"{self.name} needs a joint, and no coefficient_per_k")
        elif (self.coefficient_deg is None) == (self.coefficient_mm is None):
            raise ValueError(f"{self.name} needs coefficient_deg or coefficient_mm, one of them")
        return self


class Part(AttachedPart):
    """One mesh file: on which body it sits, its color, whether it can hit others."""

    file: ModelFile
    """Mesh, relative to robot.toml."""
    color: PlainText
    """One of the names under [colors]."""


class Drawn(Strict):
    """Keys of robots and instruments alike: a name, a picture, and sources."""

    format: Literal[1]
    """Version of the file format."""
    name: Name
    """Its name in commands and files."""
    title: PlainText = ""
    """One line about it."""
    drawing: PlainText = ""
    """Drawing in truebed from which its meshes are made; empty for meshes of other origin."""
    colors: dict[PlainText, Color] = Field(default_factory=dict)
    """Red, green and blue of each color, by name."""
    parts: tuple[Part, ...] = ()
    sources: dict[PlainText, PlainText] = Field(default_factory=dict)
    """Where the numbers come from, by subject."""

    @model_validator(mode="after")
    def _parts_are_sound(self) -> "Drawn":
        """Require different names of parts, and colors that exist."""
        for part in self.parts:
            if part.color not in self.colors:
                raise ValueError(
                    f'part {part.name}: no color "{part.color}"; '
                    f"{choice_of(part.color, self.colors)}"
                )
        names = [part.name for part in self.parts]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"part {twice[0]} appears twice")
        return self


class RobotFile(Drawn):
    """A robot model, ``robot.toml``."""

    floor_mm: Length | None = None
    """Height in the base frame of the surface that the base is mounted on: floor, wall or ceiling,
    perpendicular to its z axis. 0 by default; for an arm on a rail then there is none."""
    mounting_height_mm: Annotated[float, CELL.size("mm")] | None = None
    """Of a base on a wall, below a ceiling or along a rail: height of its origin above the level
    floor of the room. Up is z of the world, in which [base] stands."""
    base: Frame = Frame()
    tool: Frame = Frame()
    workspace: WorkspaceBox | None = None
    joints: Annotated[
        tuple[Annotated[RevoluteLink | PrismaticLink, Field(discriminator="kind")], ...],
        Field(min_length=1),
    ]
    controller: ControllerTable | None = None
    never_collide: tuple[Annotated[tuple[int, ...], Field(min_length=2, max_length=2)], ...] = ()
    """Pairs of bodies that are never tested against each other; 0 is the base."""
    free_sets: dict[PlainText, tuple[str, ...]] = Field(default_factory=dict)
    """Names of numbers that are identified together, by the name of the set."""
    joint_terms: tuple[JointTermEntry, ...] = ()
    springs: SpringsTable | None = None
    reflectors: tuple[ReflectorEntry, ...] = ()
    shapes: tuple[ShapeEntry, ...] = ()
    tolerances: LinkTolerances | None = None
    notes: tuple[PlainText, ...] = ()
    """Remarks that the report prints."""

    @model_validator(mode="after")
    def _reflectors_differ(self) -> "RobotFile":
        """No name stands for two reflectors."""
        names = [reflector.name for reflector in self.reflectors]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"reflector {twice[0]} appears twice")
        return self

    @model_validator(mode="after")
    def _links_exist(self) -> "RobotFile":
        """Parts and exclusions name bodies from 0 (base) to n."""
        n = len(self.joints)
        ranges = self.workspace.joint_ranges_deg if self.workspace else ()
        if ranges and len(ranges) != n:
            raise ValueError(f"workspace: joint_ranges_deg has {len(ranges)} of {n} joints")
        if self.tolerances is not None and (strange := self.tolerances.strange(n)):
            raise ValueError(f"tolerances: joint {strange} is not there; the last is {n}")
        for part in (*self.parts, *self.shapes):
            if part.link > n:
                raise ValueError(f"part {part.name} is on link {part.link}; the last is {n}")
        for pair in self.never_collide:
            if not all(0 <= link <= n for link in pair) or pair[0] == pair[1]:
                raise ValueError(f"never_collide has {list(pair)}; allowed: two of 0 to {n}")
        return self

    @model_validator(mode="after")
    def _shapes_are_sound(self) -> "RobotFile":
        """Names of shapes are those of no other part, and their colors exist."""
        names = {part.name for part in self.parts}
        for shape in self.shapes:
            if shape.name in names:
                raise ValueError(f"part {shape.name} appears twice")
            names.add(shape.name)
            if shape.color and shape.color not in self.colors:
                raise ValueError(
                    f'part {shape.name}: no color "{shape.color}"; '
                    f"{choice_of(shape.color, self.colors)}"
                )
        return self

    @model_validator(mode="after")
    def _controller_can_be(self) -> "RobotFile":
        """Statements on the controller's joints can be solved for either side."""
        if self.controller is not None:
            try:
                self.controller.controller([joint.kind for joint in self.joints])
            except ValueError as error:
                raise ValueError(f"[controller] {error}") from error
        return self

    @model_validator(mode="after")
    def _joint_terms_fit(self) -> "RobotFile":
        """Terms have different names, name joints that exist and weigh every joint."""
        n = len(self.joints)
        seen = set(chain_names(n))
        for term in self.joint_terms:
            if term.name in seen:
                raise ValueError(f"joint_terms: {term.name} is the name of another number")
            seen.add(term.name)
            if term.joint > n:
                raise ValueError(
                    f"joint_terms: {term.name} is on joint {term.joint}; there are {n}"
                )
            if len(term.weights) != n:
                raise ValueError(
                    f"joint_terms: {term.name} has {len(term.weights)} weights; one for each of "
                    f"{n} joints"
                )
        if self.springs and (wrong := self.springs.contradictions([j.kind for j in self.joints])):
            raise ValueError(wrong)
        return self


class TrackerFile(Drawn):
    """A drawn instrument, ``tracker.toml``: link 0 stands, 1 turns about z, 2 tilts about y."""

    beam_height_mm: Annotated[float, CELL.size("mm")]
    """Height at which the beam starts above the floor."""
