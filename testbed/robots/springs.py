"""[springs] of robot.toml: compliances of joints under the weight of an arm, read and written."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from calib.geometry.chain import Chain, JointKind
from calib.geometry.gravity import AXES, MOMENTS, Weight
from calib.geometry.joint_errors import JointErrors
from calib.geometry.springs import UNSAID, SprungJoints
from testbed.bounds import ANGLE, GRAVITY, LINK, LOAD, MASS, MOMENT
from testbed.robots.links import link_row
from testbed.robots.units import degrees, millimeters
from testbed.strict import Strict

Length = Annotated[float, LINK.signed("mm")]
Angle = Annotated[float, ANGLE.signed("deg")]
Three = Field(min_length=3, max_length=3)
FirstMoment = Annotated[float, MOMENT.signed("kg m")]
FirstMoments = Annotated[tuple[FirstMoment, ...], Three]
TURNS, SLIDES = ("load_nm", "bend_deg"), ("load_n", "bend_mm")


class SpringEntry(Strict):
    """[[springs.bends]]: one axis of one joint, and its bend at a load."""

    joint: Annotated[int, Field(ge=1)]
    """Number of the joint, counted from one at the base."""
    axis: Literal["x", "y", "z"]
    """Axis of the body behind the joint; z is the axis of the joint itself."""
    load_nm: Annotated[float, LOAD.size("N m")] | None = None
    """Torque at which it bends by `bend_deg`."""
    bend_deg: Angle | None = None
    """Angle by which it turns at that torque."""
    load_n: Annotated[float, LOAD.size("N")] | None = None
    """Force along a slide at which it moves by `bend_mm`."""
    bend_mm: Length | None = None
    """Distance by which it moves at that force."""

    @model_validator(mode="after")
    def _has_one_bend(self) -> "SpringEntry":
        """Degrees at a torque, or millimeters at a force along a slide."""
        there = [getattr(self, key) is not None for key in TURNS + SLIDES]
        if there not in ([True, True, False, False], [False, False, True, True]):
            raise ValueError(
                f"spring of joint {self.joint} about {self.axis} needs load_nm and bend_deg, or "
                "along a slide load_n and bend_mm"
            )
        return self

    @property
    def load(self) -> float:
        """Load at which it bends by `bend` [N m, N]."""
        return self.load_nm or self.load_n or 0.0

    @property
    def bend(self) -> float:
        """Bend at that load [rad, m]."""
        return float(np.radians(self.bend_deg or 0.0)) + (self.bend_mm or 0.0) / 1e3


class BodyEntry(Strict):
    """[[springs.bodies]]: a link of the arm whose weight loads the springs."""

    theta_deg: Angle
    """Angle theta of the link."""
    d_mm: Length
    """Its offset d."""
    a_mm: Length
    """Its length a."""
    alpha_deg: Angle
    """Its twist alpha."""
    beta_deg: Angle = 0.0
    """Its second twist beta."""
    mass_kg: Annotated[float, MASS.or_zero("kg")]
    """Mass of the link."""
    moment_kg_m: FirstMoments = (0.0, 0.0, 0.0)
    """Mass times center of mass, in the frame just after the joint."""
    free: tuple[Literal["m", "hx", "hy", "hz"], ...] = ()
    """Which of mass and moments were identified."""
    added_kg: Annotated[float, MASS.signed("kg")] = 0.0
    """Identified addition to the mass."""
    added_kg_m: FirstMoments = (0.0, 0.0, 0.0)
    """Identified addition to the moments."""

    @model_validator(mode="after")
    def _added_is_free(self) -> "BodyEntry":
        """Require that only free numbers have additions."""
        added = zip(MOMENTS, (self.added_kg, *self.added_kg_m), strict=True)
        if held := [name for name, value in added if value and name not in self.free]:
            key = "added_kg" if held[0] == "m" else "added_kg_m"
            raise ValueError(f'{key} is set, but free does not name "{held[0]}"; add it to free')
        return self


class SpringsTable(Strict):
    """[springs]: loads of the joints, and how far they bend."""

    gravity_m_s2: Annotated[tuple[Annotated[float, GRAVITY.signed("m/s2")], ...], Three]
    """Gravity in the frame of the base."""
    tilt_deg: Annotated[tuple[Angle, ...], Field(min_length=2, max_length=2)] | None = None
    """Two identified rotations of gravity."""
    passes: Annotated[int, Field(ge=1, le=20)] = 1
    """Number of times that loads are computed: 1 on the rigid arm, each further one on the arm as
    bent so far."""
    bearings: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    """Prior standard deviation of bends about x and y, in units of the usual one."""
    unsaid_kg: Annotated[float, MASS.or_zero("kg")] = UNSAID
    """Unstated payload that the prior of the free moments allows for."""
    payload_kg: Annotated[float, MASS.or_zero("kg")] = 0.0
    """Payload that is included in the torques."""
    payload_moment_kg_m: FirstMoments = (0.0, 0.0, 0.0)
    """Its mass times its center of mass in the flange frame."""
    bends: Annotated[tuple[SpringEntry, ...], Field(min_length=1)]
    bodies: tuple[BodyEntry, ...]

    def contradictions(self, kinds: Sequence[JointKind]) -> str:
        """What does not fit the joints of a robot, in words; empty if all does."""
        n, seen = len(kinds), set()
        if len(self.bodies) != n:
            return f"springs: there are {len(self.bodies)} bodies for {n} joints; give one each"
        for spring in self.bends:
            words = f"springs: spring of joint {spring.joint} about {spring.axis}"
            if spring.joint > n:
                return f"{words}; there are {n} joints"
            if (spring.joint, spring.axis) in seen:
                return f"{words} appears twice"
            seen.add((spring.joint, spring.axis))
            slides = kinds[spring.joint - 1] == "prismatic" and spring.axis == "z"
            if slides != (spring.bend_deg is None):
                given, wanted = (TURNS, SLIDES) if slides else (SLIDES, TURNS)
                return f"{words} has {' and '.join(given)}; write {' and '.join(wanted)}"
        return ""

    def joint_errors(self, chain: Chain) -> JointErrors:
        """The springs with their numbers [rad, m; kg, kg m]."""
        weight = Weight(
            Chain(np.array([link_row(body) for body in self.bodies]), chain.kinds),
            np.array([(body.mass_kg, *body.moment_kg_m) for body in self.bodies]),
            np.array((self.payload_kg, *self.payload_moment_kg_m)),
            np.array(self.gravity_m_s2),
        )
        free = np.array([[name in body.free for name in MOMENTS] for body in self.bodies])
        added = np.array([(body.added_kg, *body.added_kg_m) for body in self.bodies])
        springs = SprungJoints(
            weight,
            np.array([spring.joint - 1 for spring in self.bends]),
            np.array([AXES.index(spring.axis) for spring in self.bends]),
            np.array([spring.load for spring in self.bends]),
            free,
            self.passes,
            self.tilt_deg is not None,
            self.bearings,
            self.unsaid_kg,
        )
        numbers = [
            *(spring.bend for spring in self.bends),
            *added[free],
            *np.radians(self.tilt_deg or ()),
        ]
        return JointErrors((), np.array(numbers), springs)


def springs_table(errors: JointErrors) -> dict[str, Any] | None:
    """The table [springs] of joint errors, which reads back; None without springs."""
    springs = errors.springs
    if springs is None:
        return None
    weight, p, f = springs.weight, len(springs.load), int(springs.free.sum())
    numbers = errors.of_springs
    added = np.zeros(springs.free.shape)
    added[springs.free] = numbers[p : p + f]
    bends = []
    for k, (name, length) in enumerate(zip(springs.names[:p], springs.is_length, strict=False)):
        (load, bend), own = (SLIDES, millimeters) if length else (TURNS, degrees)
        bends.append(
            {
                "joint": int(springs.joint[k]) + 1,
                "axis": name[-1],
                load: float(springs.load[k]),
                bend: own(numbers[k]),
            }
        )
    bodies = []
    for i, (theta, d, a, alpha, beta) in enumerate(weight.chain.links):
        bodies.append(
            {
                "theta_deg": degrees(theta),
                "d_mm": millimeters(d),
                "a_mm": millimeters(a),
                "alpha_deg": degrees(alpha),
                "beta_deg": degrees(beta),
                **_weighed("mass_kg", "moment_kg_m", weight.moments[i]),
                "free": [name for name, free in zip(MOMENTS, springs.free[i], strict=True) if free],
                **_weighed("added_kg", "added_kg_m", added[i]),
            }
        )
    return {
        "gravity_m_s2": weight.gravity.tolist(),
        **({"tilt_deg": [degrees(x) for x in numbers[p + f :]]} if springs.tilts else {}),
        "passes": springs.passes,
        **({} if springs.bearings == 1.0 else {"bearings": float(springs.bearings)}),
        **({} if springs.unsaid == UNSAID else {"unsaid_kg": float(springs.unsaid)}),
        **_weighed("payload_kg", "payload_moment_kg_m", weight.payload),
        "bends": bends,
        "bodies": bodies,
    }


def _weighed(mass: str, moment: str, four: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Mass and first moments under their keys."""
    return {mass: float(four[0]), moment: four[1:].tolist()}
