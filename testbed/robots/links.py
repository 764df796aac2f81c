"""The links of an arm in robot.toml: their numbers, the bodies that they move, and their parts."""

from typing import Annotated, Literal, Protocol, Self

import numpy as np
from pydantic import Field, model_validator

from testbed.bounds import ANGLE, INERTIA, LINK, MASS, SCATTER, SLIDE_SPEED, TURN_SPEED
from testbed.strict import Strict

Length = Annotated[float, LINK.signed("mm")]
Angle = Annotated[float, ANGLE.signed("deg")]
Vector = Annotated[tuple[Length, ...], Field(min_length=3, max_length=3)]
Moment = Annotated[float, INERTIA.size("kg m2")]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]


class HasNumbers(Protocol):
    """What has the five numbers of a link."""

    theta_deg: float
    d_mm: float
    a_mm: float
    alpha_deg: float
    beta_deg: float


def link_row(link: HasNumbers) -> list[float]:
    """One row of a chain: theta, d, a, alpha, beta [rad, m]."""
    theta, alpha, beta = map(np.radians, (link.theta_deg, link.alpha_deg, link.beta_deg))
    return [theta, link.d_mm / 1e3, link.a_mm / 1e3, alpha, beta]


class Link(Strict):
    """Keys of revolute and prismatic joints alike: link product and moved body."""

    theta_deg: Angle
    """Angle about the old z axis at joint zero (Denavit-Hartenberg, modified by Hayati's beta)."""
    d_mm: Length
    """Offset along the old z axis at joint zero."""
    a_mm: Length
    """Length along the new x axis."""
    alpha_deg: Angle
    """Twist about the new x axis."""
    beta_deg: Angle = 0.0
    """Twist about the new y axis, for parallel axes."""
    mass_kg: Annotated[float, MASS.size("kg")] | None = None
    """Mass; give it with center and inertia or leave out all three. Only simulated motion needs
    them."""
    center_mm: Vector | None = None
    """Center of mass in the frame of the body."""
    inertia_kg_m2: Annotated[tuple[Moment, ...], Field(min_length=3, max_length=3)] | None = None
    """Principal moments about the center of mass, along the axes of the body."""

    @model_validator(mode="after")
    def _body_is_whole(self) -> "Link":
        """Require mass, center and inertia together, or none of them."""
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
        """Require the lower limit to be below the upper one."""
        for unit in ("deg", "mm"):
            lower, upper = (getattr(self, f"{end}_{unit}", None) for end in ("lower", "upper"))
            if lower is not None and lower >= upper:
                raise ValueError(f"lower_{unit} {lower} is not below upper_{unit} {upper}")
        return self


class RevoluteLink(Link):
    """A turning joint."""

    kind: Literal["revolute"]
    """A turning joint."""
    lower_deg: Angle
    """Lower limit."""
    upper_deg: Angle
    """Upper limit."""
    max_speed_deg_s: Annotated[float, TURN_SPEED.size("deg/s")] | None = None
    """Largest speed."""
    repeatability_urad: Annotated[float, SCATTER.or_zero("urad")] | None = None
    """Standard deviation with which it comes back."""

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
    """A sliding joint."""
    lower_mm: Length
    """Lower limit."""
    upper_mm: Length
    """Upper limit."""
    max_speed_mm_s: Annotated[float, SLIDE_SPEED.size("mm/s")] | None = None
    """Largest speed."""
    repeatability_um: Annotated[float, SCATTER.or_zero("um")] | None = None
    """Standard deviation with which it comes back."""

    @property
    def speed(self) -> float | None:
        """Largest speed [m/s]."""
        return None if self.max_speed_mm_s is None else self.max_speed_mm_s / 1e3

    @property
    def scatter(self) -> float | None:
        """Standard deviation of its repeatability [m]."""
        return None if self.repeatability_um is None else self.repeatability_um * 1e-6


class AttachedPart(Strict):
    """Keys of [[parts]] and [[shapes]] alike: name, link and use."""

    name: Name
    """What the part is called."""
    link: Annotated[int, Field(ge=0)]
    """Body it moves with: 0 is the base."""
    collides: bool = False
    """Whether its convex hull takes part in tests of collision."""
    drawn: bool = True
    """Whether it is visible: drawn, and an obstacle to beams."""

    @model_validator(mode="after")
    def _is_of_use(self) -> Self:
        """Require that it is drawn or collides."""
        if not (self.collides or self.drawn):
            raise ValueError(f"{self.name} is neither drawn nor collides; remove it")
        return self
