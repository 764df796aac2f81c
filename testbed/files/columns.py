"""The column names of the project's layout: a unit in each, and its factor to SI."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from functools import cache

from testbed.bounds import (
    ANGLE,
    ANGLE_SD,
    ANGLE_VARIANCE,
    COORDINATE,
    COUNT,
    COVARIANCE,
    DIRECTION,
    FACTORS,
    LENGTH_SD,
    LENGTH_VARIANCE,
    PAYLOAD,
    TEMPERATURE,
    TIME,
    TORQUE,
    Bound,
)

LENGTHS = {unit: FACTORS[unit] for unit in ("m", "mm", "um", "in", "cm", "ft")}
ANGLES = {unit: FACTORS[unit] for unit in ("rad", "mrad", "deg", "mdeg", "urad", "gon", "rev")}
LOADS = {unit: FACTORS[unit] for unit in ("Nm", "Nmm", "N")}
CURRENTS = {unit: FACTORS[unit] for unit in ("A", "mA")}
UNITS = {"length": LENGTHS, "angle": ANGLES, "torque": LOADS, "current": CURRENTS}
WRITTEN = {
    "mm": "mm", "m": "m", "um": "um", "µm": "um", "μm": "um", "in": "in", "inch": "in",
    "inches": "in", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "millimeter": "mm",
    "millimeters": "mm", "millimetre": "mm", "millimetres": "mm", "micron": "um", "microns": "um",
    "cm": "cm", "centimeter": "cm", "centimeters": "cm", "centimetre": "cm", "centimetres": "cm",
    "zentimeter": "cm", "ft": "ft", "feet": "ft", "foot": "ft",
    "deg": "deg", "°": "deg", "º": "deg", "degree": "deg", "degrees": "deg", "grad": "deg",
    "degré": "deg", "degrés": "deg", "gradi": "deg", "grados": "deg", "gon": "gon",
    "rad": "rad", "radian": "rad", "radians": "rad", "mrad": "mrad", "mdeg": "mdeg", "c": "degC",
    "degc": "degC", "°c": "degC", "kg": "kg", "s": "s", "sec": "s", "second": "s", "seconds": "s",
    "nm": "Nm", "n m": "Nm", "n*m": "Nm", "n·m": "Nm", "nmm": "Nmm", "n mm": "Nmm", "n": "N",
    "a": "A", "amp": "A", "ma": "mA",
}  # fmt: skip
"""Units as people write them, in small letters."""
QUATERNION_COLUMNS = ("qw", "qx", "qy", "qz")
AXIS_COLUMNS = ("axis_x", "axis_y", "axis_z")
"""Of a turn by axis_angle_deg ... about them."""
MATRIX_COLUMNS = tuple(f"r{i}{j}" for i in "123" for j in "123")
TEXTS = ("pose_id", "station", "split", "approach", "time", "target", "anchor", "euler", "tool",
         "path")  # fmt: skip
"""Columns that hold no numbers."""
NUMBERS = {
    "repeat": COUNT, "order": COUNT, "time_s": TIME, "temperature_degC": TEMPERATURE,
    "payload_kg": PAYLOAD,
}  # fmt: skip
"""Columns of numbers that any table may have, and which numbers they hold."""
COUNTS = ("cycle", "path_point")
"""Columns of whole numbers in tests after ISO 9283."""
COMMANDED = "command_"
"""Before the name of a column: where the robot was sent, instead of where it was seen."""
PLAIN = (*TEXTS, *NUMBERS, *COUNTS, *QUATERNION_COLUMNS, *AXIS_COLUMNS, *MATRIX_COLUMNS)
"""Names that carry no unit, or always the same."""
AXES = ("x", "y", "z", "rx", "ry", "rz")
STEMS: dict[str, str] = {
    **dict.fromkeys(("x", "y", "z", "range", "distance"), "length"),
    **dict.fromkeys(("reflector_x", "reflector_y", "reflector_z"), "length"),
    **dict.fromkeys(("payload_x", "payload_y", "payload_z"), "length"),
    **dict.fromkeys(("difference_x", "difference_y", "difference_z"), "length"),
    **dict.fromkeys(
        ("rx", "ry", "rz", "e1", "e2", "e3", "rvx", "rvy", "rvz", "axis_angle"), "angle"
    ),
    **dict.fromkeys(("azimuth", "elevation", "zenith"), "angle"),
    **{f"{u}{axis}": "length" for u in ("u", "U95") for axis in ("x", "y", "z", "_distance")},
    **{f"{u}{axis}": "angle" for u in ("u", "U95") for axis in ("rx", "ry", "rz")},
}
"""Stem of a column name to what it measures."""
UNNAMED = re.compile(r"column \d+")
"""What a column without a name is called."""
JOINT = re.compile(r"q([1-9]\d?)(_read)?")
DRIVE = re.compile(r"(torque|current)([1-9]\d?)")
"""What a drive reports."""


@cache
def covariance_names(count: int = len(AXES)) -> tuple[str, ...]:
    """The entries of the upper triangle, by rows: ``cov_x_x_m2`` ... ``cov_rz_rz_rad2``.

    `count` is that of the axes: 6 have 21 entries, and the 3 of a position 6.
    """
    units = {2: "m2", 3: "m_rad", 4: "rad2"}  # by the letters of both axes
    pairs = ((a, b) for i, a in enumerate(AXES[:count]) for b in AXES[i:count])
    return tuple(f"cov_{a}_{b}_{units[len(a) + len(b)]}" for a, b in pairs)


def unit_of(name: str) -> str:
    """Unit that the name of a column of numbers carries; empty if none."""
    unit = name.rpartition("_")[2]
    return "m rad" if name.endswith("_m_rad") else unit if unit in FACTORS else ""


def bound_of(name: str) -> Bound:
    """Which numbers a column of a name may hold; those without a unit are directions."""
    unit = unit_of(name)
    if name.startswith("cov_"):
        _, a, b, _ = name.split("_", 3)
        return (LENGTH_VARIANCE if unit == "m2" else ANGLE_VARIANCE) if a == b else COVARIANCE
    if name.startswith(("u", "U95")):
        return LENGTH_SD if unit in LENGTHS else ANGLE_SD
    if name in NUMBERS:
        return NUMBERS[name]
    if unit in LOADS or unit in CURRENTS:
        return TORQUE
    return COORDINATE if unit in LENGTHS else ANGLE if unit in ANGLES else DIRECTION


def is_known(name: str) -> bool:
    """Whether this program has a column of that name."""
    name = name.removeprefix(COMMANDED)
    if name in PLAIN or name in covariance_names():
        return True
    stem, _, unit = name.rpartition("_")
    if JOINT.fullmatch(stem):
        return unit in LENGTHS or unit in ANGLES
    if drive := DRIVE.fullmatch(stem):
        return unit in UNITS[drive[1]]
    return stem in STEMS and unit in UNITS[STEMS[stem]]


def close_to(name: str) -> str:
    """``did you mean "x_mm"?``, or nothing; a bare number is the place of a column, no name."""
    if name.isdigit():
        return ""
    known = [
        *PLAIN,
        *(f"{stem}_{unit}" for stem, kind in STEMS.items() for unit in UNITS[kind]),
        *(f"{COMMANDED}{axis}_{unit}" for axis in AXES[:3] for unit in LENGTHS),
        *(f"q{k}{read}_{unit}" for k in range(1, 10) for read in ("", "_read") for unit in
          ("deg", "rad", "mm", "m")),
        *(f"{stem}{k}_{unit}" for k in range(1, 10) for stem in ("torque", "current") for unit in
          UNITS[stem]),
    ]  # fmt: skip
    close = get_close_matches(name, known, n=1, cutoff=0.75)
    return f'did you mean "{close[0]}"?' if close else ""


def misspelling(names: Iterable[str]) -> str:
    """The hint on the first name that is none of ours and close to one of them, or nothing.

    Without such a name it is one on a column that has no name.
    """
    others = [name for name in names if not is_known(name)]
    bare = (f"give {name} a name, it has none" for name in others if UNNAMED.fullmatch(name))
    return next(filter(None, map(close_to, others)), "") or next(bare, "")


def misspelt_reading(names: Iterable[str]) -> str:
    """The same of columns that were measured: what says when or which does not help there."""
    aside = {f'did you mean "{name}"?' for name in (*TEXTS, *NUMBERS, *COUNTS)}
    hints = (close_to(name) for name in names if not is_known(name))
    return next((hint for hint in hints if hint and hint not in aside), "")
