"""The schemas of robot.toml and tracker.toml: every key with its unit, as people write them."""

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from calib.geometry.chain import chain_names
from calib.geometry.joint_errors import Wave
from testbed.bounds import (
    ANGLE,
    CELL,
    COORDINATE,
    INERTIA,
    LINK,
    MASS,
    SCATTER,
    SLIDE_SPEED,
    TURN_SPEED,
)
from testbed.robots.springs import SpringsTable
from testbed.robots.tolerances import LinkTolerances
from testbed.strict import PlainText, Strict, choice_of

Length = Annotated[float, LINK.signed("mm")]
Angle = Annotated[float, ANGLE.signed("deg")]
Vector = Annotated[tuple[Length, ...], Field(min_length=3, max_length=3)]
Angles = Annotated[tuple[Angle, ...], Field(min_length=3, max_length=3)]
Place = Annotated[
    tuple[Annotated[float, COORDINATE.signed("mm")], ...], Field(min_length=3, max_length=3)
]
"""Of a frame: an identified robot stands in the frame that it was measured in."""
Moment = Annotated[float, INERTIA.size("kg m2")]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
Color = Annotated[
    tuple[Annotated[float, Field(ge=0, le=1)], ...], Field(min_length=3, max_length=3)
]


def _inside(file: str) -> str:
    """Refuse a path that could leave the model's folder."""
    if file.startswith(("/", "\\")) or ".." in file.replace("\\", "/").split("/") or ":" in file:
        raise ValueError("must stay inside the model's folder")
    return file


ModelFile = Annotated[PlainText, AfterValidator(_inside)]


class Link(Strict):
    """What revolute and prismatic joints share: the link product and the body they move."""

    theta_deg: Angle
    d_mm: Length
    a_mm: Length
    alpha_deg: Angle
    beta_deg: Angle = 0.0
    mass_kg: Annotated[float, MASS.size("kg")] | None = None
    """With center and inertia, all of them or none: only what moves by itself asks for them."""
    center_mm: Vector | None = None
    inertia_kg_m2: Annotated[tuple[Moment, ...], Field(min_length=3, max_length=3)] | None = None

    @model_validator(mode="after")
    def _body_is_whole(self) -> "Link":
        """Mass, center and inertia are all there, or none of them."""
        body = {key: getattr(self, key) for key in ("mass_kg", "center_mm", "inertia_kg_m2")}
        missing = [key for key, value in body.items() if value is None]
        if 0 < len(missing) < 3:
            there = next(key for key, value in body.items() if value is not None)
            raise ValueError(f"{there} stands without {' and '.join(missing)}; give all or none")
        return self

    @model_validator(mode="after")
    def _inertia_can_exist(self) -> "Link":
        """The largest principal moment is at most the sum of the others."""
        if self.inertia_kg_m2 is None:
            return self
        *small, large = sorted(self.inertia_kg_m2)
        if large > sum(small) * (1 + 1e-12):
            raise ValueError("inertia_kg_m2: the largest moment exceeds the sum of the others")
        return self

    @model_validator(mode="after")
    def _range_is_not_empty(self) -> "Link":
        """Lower limit below upper."""
        for unit in ("deg", "mm"):
            lower, upper = (getattr(self, f"{end}_{unit}", None) for end in ("lower", "upper"))
            if lower is not None and lower >= upper:
                raise ValueError(f"lower_{unit} {lower} is not below upper_{unit} {upper}")
        return self


class RevoluteLink(Link):
    """A turning joint."""

    kind: Literal["revolute"]
    lower_deg: Angle
    upper_deg: Angle
    max_speed_deg_s: Annotated[float, TURN_SPEED.size("deg/s")] | None = None
    repeatability_urad: Annotated[float, SCATTER.or_zero("urad")] | None = None

    @property
    def speed(self) -> float | None:
        """Largest speed [rad/s]."""
        return None if self.max_speed_deg_s is None else float(np.radians(self.max_speed_deg_s))

    @property
    def scatter(self) -> float | None:
        """Standard deviation of its repeatability [rad]."""
        return None if self.repeatability_urad is None else self.repeatability_urad * 1e-6


class PrismaticLink(Link):
    """A sliding joint."""

    kind: Literal["prismatic"]
    lower_mm: Length
    upper_mm: Length
    max_speed_mm_s: Annotated[float, SLIDE_SPEED.size("mm/s")] | None = None
    repeatability_um: Annotated[float, SCATTER.or_zero("um")] | None = None

    @property
    def speed(self) -> float | None:
        """Largest speed [m/s]."""
        return None if self.max_speed_mm_s is None else self.max_speed_mm_s / 1e3

    @property
    def scatter(self) -> float | None:
        """Standard deviation of its repeatability [m]."""
        return None if self.repeatability_um is None else self.repeatability_um * 1e-6


class Frame(Strict):
    """A fixed frame: place and rotation vector."""

    position_mm: Place = (0.0, 0.0, 0.0)
    rotation_vector_deg: Angles = (0.0, 0.0, 0.0)


class WorkspaceBox(Strict):
    """[workspace]: where the arm is at work and a tracker sees it, base frame."""

    box_center_mm: Vector
    box_size_mm: Annotated[
        tuple[Annotated[float, CELL.size("mm")], ...], Field(min_length=3, max_length=3)
    ]
    station_mm: Place
    joint_ranges_deg: tuple[
        Annotated[tuple[Angle, ...], Field(min_length=2, max_length=2)], ...
    ] = ()


class ReflectorEntry(Strict):
    """[[reflectors]]: a target that is mounted on the tool, place in the tool frame."""

    name: Annotated[PlainText, Field(min_length=1, max_length=200)]
    position_mm: Vector


class JointTermEntry(Strict):
    """[[joint_terms]]: a wave of a joint's error, wave(weights . q) times its coefficient.

    Or what follows a row: "approach" its directions, "torque" its reported torques beyond the
    reference, "lengths" (joint 0) its temperature. `share`: how large for its kind it may be.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][A-Za-z0-9_.]*$", max_length=64)]
    joint: Annotated[int, Field(ge=0)]
    wave: Wave
    weights: tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...]
    reference: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    """Torque [N m, N, A] or temperature [degC] where it is zero."""
    share: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    coefficient_deg: Angle | None = None
    """Of a turning joint; of a torque per N m."""
    coefficient_mm: Length | None = None
    """Of a sliding joint; of a force per N."""
    coefficient_per_k: Annotated[float, Field(ge=-1.0, le=1.0)] | None = None
    """Of lengths."""

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


class Part(Strict):
    """One mesh file: on which body it sits, its color, whether it can hit others."""

    name: Name
    link: Annotated[int, Field(ge=0)]
    file: ModelFile
    color: PlainText
    collides: bool = False


class Drawn(Strict):
    """What robots and instruments share: a name, a picture, where it all comes from."""

    format: Literal[1]
    name: Name
    title: PlainText = ""
    drawing: PlainText = ""
    colors: dict[PlainText, Color] = Field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    sources: dict[PlainText, PlainText] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _parts_are_sound(self) -> "Drawn":
        """Part names differ and their colors exist."""
        for part in self.parts:
            if part.color not in self.colors:
                raise ValueError(
                    f'part {part.name}: no color "{part.color}"; '
                    f"{choice_of(part.color, self.colors)}"
                )
        names = [part.name for part in self.parts]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"part {twice[0]} is there twice")
        return self


class RobotFile(Drawn):
    """A robot model, ``robot.toml``."""

    floor_mm: Length = 0.0
    base: Frame = Frame()
    tool: Frame = Frame()
    workspace: WorkspaceBox | None = None
    joints: Annotated[
        tuple[Annotated[RevoluteLink | PrismaticLink, Field(discriminator="kind")], ...],
        Field(min_length=1),
    ]
    never_collide: tuple[Annotated[tuple[int, ...], Field(min_length=2, max_length=2)], ...] = ()
    free_sets: dict[PlainText, tuple[str, ...]] = Field(default_factory=dict)
    joint_terms: tuple[JointTermEntry, ...] = ()
    springs: SpringsTable | None = None
    reflectors: tuple[ReflectorEntry, ...] = ()
    tolerances: LinkTolerances | None = None
    notes: tuple[PlainText, ...] = ()

    @model_validator(mode="after")
    def _reflectors_differ(self) -> "RobotFile":
        """No name stands for two reflectors."""
        names = [reflector.name for reflector in self.reflectors]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"reflector {twice[0]} is there twice")
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
        for part in self.parts:
            if part.link > n:
                raise ValueError(f"part {part.name} is on link {part.link}; the last is {n}")
        for pair in self.never_collide:
            if not all(0 <= link <= n for link in pair) or pair[0] == pair[1]:
                raise ValueError(f"never_collide has {list(pair)}; allowed: two of 0 to {n}")
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
