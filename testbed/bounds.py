"""How large and how small a number of each kind may be that is read, whoever reads it.

Beyond these no laboratory, robot or instrument goes, and squares, inverses and sums of what is
inside stay numbers. All sizes are in SI units, signs left aside; the limits are design choices.
"""

from dataclasses import dataclass
from math import inf, pi
from typing import Any

from pydantic import Field

DEG = pi / 180
FACTORS: dict[str, float] = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048,
    "rad": 1.0, "deg": DEG, "mdeg": pi / 180e3, "mrad": 1e-3, "urad": 1e-6, "gon": pi / 200,
    "rev": 2 * pi,
    "rad/s": 1.0, "m/s": 1.0, "deg/s": DEG, "mm/s": 1e-3, "degC": 1.0, "s": 1.0, "": 1.0,
    "kg": 1.0, "kg m": 1.0, "kg m2": 1.0, "kg/m3": 1.0, "m2": 1.0, "m rad": 1.0, "rad2": 1.0,
    "um/m": 1e-6, "hPa": 100.0, "Nm": 1.0, "Nmm": 1e-3, "N": 1.0, "A": 1.0, "mA": 1e-3,
    "N m": 1.0, "m/s2": 1.0,
}  # fmt: skip
"""Units that files have, and their factors to SI (temperatures stay in degC)."""


@dataclass(frozen=True, slots=True)
class Bound:
    """The sizes of one kind of number."""

    what: str
    """What it is, with its article."""
    most: float
    least: float = 0.0
    """Smallest size besides zero."""
    usual: tuple[float, float] = (0.0, inf)
    """Sizes outside are read with a warning."""

    def allowed(self, unit: str, *, usual: bool = False) -> str:
        """The range in words: ``a mass is 1e-09 to 1000000 kg``, or that of usual ones."""
        least, most = (shown(size, unit) for size in (self.usual if usual else self._range))
        if usual:
            return f"{self.what} is usually {least:.9g} to {most:.9g} {unit}".rstrip()
        span = f"{least:.9g} to {most:.9g}" if least else f"at most {most:.9g}"
        return f"{self.what} is {span} {unit}".rstrip()

    def is_usual(self, size: Any) -> Any:
        """Whether an SI size, or each of an array, is usual."""
        return (size >= self.usual[0]) & (size <= self.usual[1])

    @property
    def _range(self) -> tuple[float, float]:
        return self.least, self.most

    def size(self, unit: str) -> Any:
        """Field of a schema for a size in a unit: above zero where there is a least one."""
        least, most = (shown(size, unit) for size in self._range)
        return Field(ge=least, le=most) if least else Field(gt=0.0, le=most)

    def signed(self, unit: str) -> Any:
        """Field of a schema for a number of either sign in a unit."""
        most = shown(self.most, unit)
        return Field(ge=-most, le=most)

    def or_zero(self, unit: str) -> Any:
        """Field of a schema for a size in a unit that may be zero."""
        return Field(ge=0.0, le=shown(self.most, unit))


def shown(size: float, unit: str) -> float:
    """An SI number in a unit, without the last digits that its factor brings."""
    return float(f"{size / FACTORS[unit]:.12g}")


COORDINATE = Bound("a coordinate or distance", 1e5)
"""Halls have frames of their own, and a file in mm may be taken for one in m."""
LINK = Bound("a length of a robot", 1e3)
SHAPE = Bound("a size of a shape", LINK.most, 1e-9)
TOOL = Bound("a tool point", 2.0)
"""Seen from the flange."""
CELL = Bound("a length in a cell", 50.0, 1e-9)
ANGLE = Bound("an angle", 1e6 * DEG)
LIMIT = Bound("a limit or angle of a joint", 1e6)
"""Of either kind, in the unit of its file."""
DIRECTION = Bound("a component of a direction", 1e6)
"""Of an axis, a quaternion or a rotation matrix; their lengths are another question."""
SCALE = Bound("a scale of a mesh", 1e6, 1e-6)
LOAD = Bound("a load of a spring", 1e9, 1e-12)
"""A torque, or a force along a slide."""
MOMENT = Bound("a first moment", 1e6)
GRAVITY = Bound("a component of gravity", 1e3)
MASS = Bound("a mass", 1e6, 1e-9)
DENSITY = Bound("a density", 1e6)
INERTIA = Bound("a moment of inertia", 1e9, 1e-13)
"""MuJoCo refuses masses and inertias of moving bodies below 1e-15."""
TURN_SPEED = Bound("a speed of a turning joint", 1e6 * DEG, 1e-4 * DEG)
SLIDE_SPEED = Bound("a speed of a sliding joint", 1e3, 1e-6)
SCATTER = Bound("a repeatability", 1.0)
"""Of a joint [rad or m]."""
LENGTH_SD = Bound("a standard uncertainty of a length", 1.0, 1e-12, (1e-7, 0.01))
TRACKER_SD = 1e-6
"""What no laser tracker stays below, all its sources together [m]."""
ANGLE_SD = Bound(
    "a standard uncertainty of an angle", 100 * DEG, 1e-9 * DEG, (1e-5 * DEG, 10 * DEG)
)
RANGE_SCALE = Bound("a standard uncertainty of a scale", 0.01, 0.0, (1e-8, 1e-3))
LENGTH_VARIANCE = Bound("a variance of a length", LENGTH_SD.most**2, LENGTH_SD.least**2)
ANGLE_VARIANCE = Bound("a variance of an angle", ANGLE_SD.most**2, ANGLE_SD.least**2)
COVARIANCE = Bound("a covariance", max(LENGTH_VARIANCE.most, ANGLE_VARIANCE.most))
TEMPERATURE = Bound("a temperature (in degC, not in kelvin)", 150.0)
PAYLOAD = Bound("a payload", 1000.0)
PRESSURE = Bound("a pressure of air", 2e5, 1e4)
TORQUE = Bound("a torque, force or current of a drive", 1e6)
TIME = Bound("a time", 1e12)
COUNT = Bound("a number of a visit", 1e9)
