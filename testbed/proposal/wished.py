"""Targets and differences in rows of measurements: what they are, and whether they agree."""

import re

import numpy as np

from calib.arrays import Array
from testbed.bounds import FACTORS
from testbed.files.dialects.marks import with_point
from testbed.files.dialects.numbers import number_of
from testbed.proposal.data import Found
from testbed.proposal.names import Meaning
from testbed.proposal.naming.plain import without_unit
from testbed.proposal.parts import DIFFERENCE, TARGET
from testbed.proposal.words import ANGLE
from testbed.toml_text import toml_value

UNITS = ("mm", "m")
"""Units tried for columns without one: first for measured ones, then targets and differences."""

COMPUTED = re.compile(r"(tcp|flange|ee|cartesian)[\s_]?pose[\s_]?\d|O_T_EE[\s_]?\d+", re.IGNORECASE)
"""Columns of logs, of Universal Robots and Franka among others, with numbers of a pose."""


def wished_lines(look: Found) -> tuple[list[str], set[str]]:
    """Notes on targets and differences in a table with measured positions, and their columns."""
    stems = look.stems
    if not look.has("x", "y", "z"):
        return [], set()
    there = {
        what: [stems[stem] for stem in names]
        for what, names in (("targets", TARGET), ("differences", DIFFERENCE))
        if look.has(*names)
    }
    said = [
        f"{what}, not used: {', '.join(toml_value(one.theirs) for one in ones)}"
        for what, ones in there.items()
    ]
    if len(there) == 2:
        measured = [stems[axis] for axis in "xyz"]
        said[1] += f": {_checked(look, measured, *there.values())}"
    return said, {one.theirs for ones in there.values() for one in ones}


def _checked(
    look: Found, measured: list[Meaning], target: list[Meaning], away: list[Meaning]
) -> str:
    """Whether differences are measured - target, or the reverse, in words."""
    least, told = np.inf, ""
    for one in _units(measured):
        m, rounded = _meters(look, measured, one)
        for other in _units(target):
            t, coarse = _meters(look, target, other)
            for third in _units(away):
                d, rough = _meters(look, away, third)
                for sign, words in ((1.0, "measured - target"), (-1.0, "target - measured")):
                    off = np.abs(d - sign * (m - t)).max(axis=1)
                    rows = np.isfinite(off)
                    if not rows.any() or (worst := float(off[rows].max())) >= least:
                        continue
                    least = worst
                    # each cell is rounded by half of its last digit; float64 of meters beside it
                    agree = worst <= 0.5 * (rounded + coarse + rough) + 1e-12
                    told = (
                        f"they are {words} in all {int(rows.sum())} rows"
                        if agree
                        else f"they are neither measured - target nor the reverse, but up to "
                        f"{1e3 * worst:.3g} mm off: of another frame, or of other rows"
                    )
    return told or "no row has numbers in all of them"


def _units(columns: list[Meaning]) -> tuple[str, ...]:
    """The stated unit of columns, or the possible ones."""
    known = {one.stem.rpartition("_")[2] if one.known else one.unit for one in columns}
    return UNITS if "" in known else (known.pop(),)


def _meters(look: Found, columns: list[Meaning], unit: str) -> tuple[Array, float]:
    """Numbers (m, 3) of columns with a unit [m], and the size of their last digit [m]."""
    cells = [[with_point(cell) for cell in look.column(one.theirs)] for one in columns]
    digits = min(len(cell.partition(".")[2]) for column in cells for cell in column)
    values: Array = np.array([[number_of(cell) for cell in column] for column in cells]).T
    return values * FACTORS[unit], 10.0**-digits * FACTORS[unit]


def is_computed(name: str) -> bool:
    """Whether a column is of a pose in the log of a controller: actual_TCP_pose_0, O_T_EE_12."""
    return COMPUTED.search(name) is not None


def is_angle(name: str) -> bool:
    """Whether a column is a direction angle of an instrument."""
    return bool(ANGLE & set(without_unit(name)[0].split()))
