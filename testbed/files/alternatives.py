"""Other readings of the same numbers: units, signs, orders of angles, directions of transforms."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse, transform
from calib.measurement.observations import Measurements
from testbed.files.rotations import MATRIX, rotations
from testbed.files.rows.counts import Count, added, other_counts
from testbed.files.session import Stated
from testbed.files.tried.other_rotations import TURN, other_forms
from testbed.robots.controller import AS_THE_ARM, Controller

LENGTHS = (
    (1e-3, "if the positions are in mm, not m", "they look like mm: name the columns x_mm ..."),
    (1e3, "if the positions are in m, not mm", "they look like m: name the columns x_m ..."),
    (25.4, "if the positions are in inches, not mm", "name the columns x_in ..."),
    (1 / 25.4, "if the positions are in mm, not inches", "name the columns x_mm ..."),
)
"""Factor, condition and fix."""
RARE = [(by, f"if the positions are in {unit}, not {read}", f"name the columns x_{unit} ...")
        for by, unit, read in ((10.0, "cm", "mm"), (0.01, "cm", "m"), (304.8, "ft", "mm"),
                               (0.3048, "ft", "m"))]  # fmt: skip
"""The same of units that few programs write."""
ANGLES = (
    (TURN, "if the joints are in deg, not rad", "name the columns q1_deg ..."),
    (1 / TURN, "if the joints are in rad, not deg", "name the columns q1_rad ..."),
    (0.9, "if the joints are in gon, not deg", "name the columns q1_gon ..."),
    (2 * np.pi, "if the joints are in revolutions, not rad", "name the columns q1_rev ..."),
    (360.0, "if the joints are in revolutions, not deg", "name the columns q1_rev ..."),
)
UNIT, ORDER = "joints", "order"
"""Names of the alternatives that joints have another unit, or stand in another order."""
MIRROR = "mirror"
"""That of a left-handed frame."""
SMALL = 2 * np.pi * TURN
"""A joint of so few degrees, or of one turn in radians that were taken for degrees [rad]."""
MOST_MIXED = 3
"""Joints that look like radians among degrees, above which each and all of them are tried."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """One other way to read a file."""

    name: str
    condition: str
    """``if the positions are in mm``: ends a sentence on what it leaves."""
    fix: str
    """What to do then."""
    code: str
    """Of the message that refuses the file."""
    field: str
    """Column or key that the message is about."""


@dataclass(frozen=True, slots=True, eq=False)
class Interpretation:
    """Joints and what was measured there, as one reading of the file has them."""

    q: Array
    """(m, n) [rad, m]."""
    position: Array
    """(m, 3) [m]."""
    rotation: Array | None
    """(m, 3, 3); None for points."""
    numbers: Array | None = None
    """(m, k) rotations as they stand in the file, as in `Stated.numbers`."""


OtherReadings: TypeAlias = Iterator[tuple[Alternative, Interpretation]]
"""Other ways to read some rows, and the rows as read so."""


def alternatives_of(
    rows: Interpretation, stated: Stated, chain: Chain, controller: Controller = AS_THE_ARM
) -> OtherReadings:
    """Other readings of the numbers of some rows.

    Parameters
    ----------
    rows : Interpretation
        As the file was read.
    stated : Stated
        How its rotations stand there; `rows.numbers` has those of the rows.
    chain : Chain
        Kinds of the joints.
    controller : Controller
        How the file was taken to count them.
    """
    for factor, condition, fix in (*LENGTHS, *RARE):
        length = Alternative("length", condition, fix, "M21", "length")
        yield length, replace(rows, position=rows.position * factor)
    J = controller.of_arm(rows.q)
    for other, read in _joints(replace(rows, q=J), chain, controller):
        yield other, replace(read, q=controller.to_arm(read.q))
    for one in other_counts(J, chain, controller):
        yield coupling_of(one), replace(rows, q=one.q)
    for a, b in combinations(range(3 if rows.rotation is not None else 0), 2):
        condition = f"if the columns {'xyz'[a]} and {'xyz'[b]} are swapped"
        fix = "name them the other way round"
        swap = Alternative("swap", condition, fix, "M32", f"{'xyz'[a]}_mm")
        yield swap, replace(rows, position=_swapped(rows.position, a, b))
    # points in a mirror are the same points, whichever axis it turns
    for axis, name in enumerate("xyz" if rows.rotation is not None else "x"):
        condition = f"if {name} has the other sign"
        if rows.rotation is None:
            condition = "if one of x, y, z has the other sign or two are swapped"
        fix = "the frame is left-handed: check the axes of the export"
        mirror = Alternative(MIRROR, condition, fix, "M32", f"{name}_mm")
        yield mirror, replace(rows, position=_scaled(rows.position, axis, -1.0))
    for axis, name in enumerate("xyz"):
        for factor, condition, _ in LENGTHS:
            condition = condition.replace("the positions are", f"{name} alone is")
            fix = "write all three coordinates in one unit"
            scale = Alternative("axis", condition, fix, "M21", f"{name}_mm")
            yield scale, replace(rows, position=_scaled(rows.position, axis, factor))
    if rows.rotation is not None:
        yield from _directions(rows, rows.rotation)
        yield from _rotations(rows, rows.rotation, stated)


def distance_alternatives(table: Measurements) -> Iterator[tuple[Alternative, Measurements]]:
    """Other readings of distances, in consecutive rows."""
    for factor, condition, fix in LENGTHS:
        condition = condition.replace("positions", "distances")
        fix = fix.replace("columns x_", "column distance_").replace(" ...", "")
        length = Alternative("length", condition, fix, "M21", "length")
        yield length, replace(table, distance=table.distance * factor)


def shifted(shift: int, which: str = "") -> Alternative:
    """The readings some rows further down belong to the joints."""
    many = "one row" if abs(shift) == 1 else f"{abs(shift)} rows"
    fix = f"move the readings{which} {many} {'up' if shift > 0 else 'down'}, beside their joints"
    return Alternative("rows", f"if row k{shift:+d}{which} belongs to pose k", fix, "M31", "match")


def coupling_of(count: Count) -> Alternative:
    """Joints that are counted otherwise, as another reading."""
    return Alternative("coupling", count.condition, count.fix, "M20", f"q{count.joint + 1}")


def _joints(rows: Interpretation, chain: Chain, controller: Controller) -> OtherReadings:
    """Units, signs and order of joints, as the controller counts them."""
    turning = chain.prismatic == 0
    for factor, condition, fix in ANGLES if turning.any() else ():
        unit = Alternative(UNIT, condition, fix, "M20", "joints")
        yield unit, replace(rows, q=np.where(turning, rows.q * factor, rows.q))
    yield from _some_joints(rows, turning)
    for factor, condition, fix in LENGTHS[:2] if not turning.all() else ():
        condition, fix = condition.replace("positions", "sliding joints"), fix.replace("x_", "q1_")
        unit = Alternative(UNIT, condition, fix, "M20", "joints")
        yield unit, replace(rows, q=np.where(turning, rows.q, rows.q * factor))
    for j in controller.counted(chain.n_joints).tolist():
        name, condition = f"q{j + 1}", f"if joint {j + 1} turns the other way"
        fix = f"change the sign of {name}"
        if j not in controller.stated:
            fix += f", or {added(controller, f'{name} = -J{j + 1}')}"
        sign = Alternative("sign", condition, fix, "M20", name)
        yield sign, replace(rows, q=_scaled(rows.q, j, -1.0))
    for a, b in combinations(np.flatnonzero(turning).tolist(), 2):
        condition = f"if the columns q{a + 1} and q{b + 1} are swapped"
        fix = "name them the other way round"
        swap = Alternative(ORDER, condition, fix, "M20", f"q{a + 1}")
        yield swap, replace(rows, q=_swapped(rows.q, a, b))


def _some_joints(rows: Interpretation, turning: Bool) -> OtherReadings:
    """Some joints in radians, the others in degrees; `turning` (n,) are angles."""
    small = (np.abs(rows.q).max(axis=0) <= SMALL) & turning & rows.q.any(axis=0)
    there = np.flatnonzero(small)
    if not 0 < len(there) < turning.sum():
        return
    counts = range(1, len(there) + 1) if len(there) <= MOST_MIXED else (1, len(there))
    for chosen in (some for count in counts for some in combinations(there.tolist(), count)):
        factor = np.ones(len(turning))
        factor[list(chosen)] = 1 / TURN
        names = [f"q{j + 1}" for j in chosen]
        condition = f"if {', '.join(names)} {'is' if len(names) == 1 else 'are'} in rad, not deg"
        fix = f"name {'this column' if len(names) == 1 else 'these columns'} {names[0]}_rad"
        unit = Alternative(UNIT, condition, fix + " ..." * (len(names) > 1), "M20", names[0])
        yield unit, replace(rows, q=rows.q * factor)


def small_rows(q: Array, turning: Bool) -> Bool:
    """Rows (m,) of joints (m, n) that look like radians among degrees; none if all do."""
    small: Bool = (np.abs(q) * turning).max(axis=1) <= SMALL
    return small & (not small.all())


def some_rows(rows: Interpretation, turning: Bool, first: str) -> OtherReadings:
    """Joints of some rows in radians, those of the others in degrees.

    Parameters
    ----------
    rows : Interpretation
        As the file was read.
    turning : (n,) array of bool
        Joints that are angles.
    first : str
        File and line of the first such row.
    """
    small = small_rows(rows.q, turning)
    if small.any():
        line = first.rpartition(":")[2]
        condition = f"if the joints of some rows, the first in line {line}, are in rad, not deg"
        unit = Alternative(UNIT, condition, "write all rows in one unit", "M20", "joints")
        factor = np.where(small[:, None] & turning, 1 / TURN, 1.0)
        yield unit, replace(rows, q=rows.q * factor)


def _swapped(values: Array, a: int, b: int) -> Array:
    """Values (m, k) with two columns in each other's place."""
    order = np.arange(values.shape[1])
    order[[a, b]] = b, a
    return values[:, order]


def _scaled(values: Array, column: int, factor: float) -> Array:
    """Values (m, k) with one column times a factor."""
    factors = np.ones(values.shape[1])
    factors[column] = factor
    return values * factors


def _directions(rows: Interpretation, R: Array) -> OtherReadings:
    """Transforms and rotations R (m, 3, 3) the other way round."""
    T = inverse(transform(R, rows.position))
    condition = "if the file gives the inverse transforms"
    fix = 'write gives = "T_tool_tracker" (or take it out) under [frames] in session.toml'
    other = Alternative("inverse", condition, fix, "M32", "frames.gives")
    yield other, replace(rows, position=T[:, :3, 3], rotation=T[:, :3, :3])
    condition = "if the rotations are the other way round"
    fix = "give the rotations that take tool axes into tracker axes, matrices by rows"
    other = Alternative("transposed", condition, fix, "M23", "frames")
    yield other, replace(rows, rotation=np.swapaxes(R, 1, 2))


def _rotations(rows: Interpretation, R: Array, stated: Stated) -> OtherReadings:
    """The three or four numbers of rotations R (m, 3, 3) in another order or convention."""
    if rows.numbers is None or stated.form in (MATRIX, "none"):
        return
    for condition, fix, code, form, numbers in other_forms(rows.numbers, stated.form):
        turned, position = rotations(form, numbers), rows.position
        if stated.inverted:
            # the file's own position, turned back by the new rotation
            own = -(np.swapaxes(R, 1, 2) @ position[..., None])
            turned = np.swapaxes(turned, 1, 2)
            position = -(turned @ own)[..., 0]
        other = Alternative("rotation", condition, fix, code, "frames")
        yield other, replace(rows, position=position, rotation=turned)
