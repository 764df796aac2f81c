"""Other readings of the same numbers: units, signs, orders of angles, directions of transforms."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse, transform
from calib.measurement.observations import Measurements
from testbed.files.readings import Reading
from testbed.files.rotations import EULER, MATRIX, QUATERNION, VECTOR, rotations
from testbed.files.session import Stated

LENGTHS = (
    (1e-3, "if the positions are in mm, not m", "they look like mm: name the columns x_mm ..."),
    (1e3, "if the positions are in m, not mm", "they look like m: name the columns x_m ..."),
    (25.4, "if the positions are in inches, not mm", "name the columns x_in ..."),
    (1 / 25.4, "if the positions are in mm, not inches", "name the columns x_mm ..."),
)
"""Factor, what it means, and what to do."""
TURN = np.pi / 180
UNITS = (
    (TURN, "if the joints are in deg, not rad", "name the columns q1_deg ..."),
    (1 / TURN, "if the joints are in rad, not deg", "name the columns q1_rad ..."),
)


@dataclass(frozen=True, slots=True)
class Alternative:
    """One other way to read a file."""

    name: str
    told: str
    """``if the positions are in mm``: ends a sentence on what it leaves."""
    fix: str
    code: str
    field: str


def alternatives_of(
    reading: Reading, stated: Stated, chain: Chain
) -> Iterator[tuple[Alternative, Reading]]:
    """Other readings of the numbers of some rows.

    Parameters
    ----------
    reading : Reading
        As the file was read.
    stated : Stated
        How its rotations stand there; `reading.numbers` has the rows' own.
    chain : Chain
        Kinds of the joints.
    """
    for factor, told, fix in LENGTHS:
        yield (
            Alternative("length", told, fix, "M21", "length"),
            replace(reading, position=reading.position * factor),
        )
    yield from _joints(reading, chain)
    for axis, name in enumerate("xyz"):
        if reading.rotation is None and axis:
            break  # points in a mirror are the same points, whichever axis it turns
        flip = np.ones(3)
        flip[axis] = -1
        one = f"{name} has" if reading.rotation is not None else "one of x, y, z has"
        yield (
            Alternative(
                "mirror",
                f"if {one} the other sign",
                "the frame is left-handed: check the axes of the export",
                "M32",
                f"{name}_mm",
            ),
            replace(reading, position=reading.position * flip),
        )
    if reading.rotation is not None:
        yield from _directions(reading)
        yield from _rotations(reading, stated)


def distance_alternatives(table: Measurements) -> Iterator[tuple[Alternative, Measurements]]:
    """Other readings of distances, in consecutive rows."""
    for factor, told, fix in LENGTHS:
        words = told.replace("positions", "distances")
        name = fix.replace("columns x_", "column distance_").replace(" ...", "")
        yield (
            Alternative("length", words, name, "M21", "length"),
            replace(table, distance=table.distance * factor),
        )


def _joints(reading: Reading, chain: Chain) -> Iterator[tuple[Alternative, Reading]]:
    """Units, signs and couplings of the joints."""
    turning = chain.prismatic == 0
    for factor, told, fix in UNITS if turning.any() else ():
        yield (
            Alternative("joints", told, fix, "M20", "joints"),
            replace(reading, q=np.where(turning, reading.q * factor, reading.q)),
        )
    for factor, told, fix in LENGTHS[:2] if not turning.all() else ():
        words = told.replace("positions", "sliding joints"), fix.replace("x_", "q1_")
        yield (
            Alternative("joints", words[0], words[1], "M20", "joints"),
            replace(reading, q=np.where(turning, reading.q, reading.q * factor)),
        )
    for j in range(chain.n_joints):
        flip = np.ones(chain.n_joints)
        flip[j] = -1
        yield (
            Alternative(
                "sign",
                f"if joint {j + 1} turns the other way",
                f"change the sign of q{j + 1}",
                "M20",
                f"q{j + 1}",
            ),
            replace(reading, q=reading.q * flip),
        )
    for a, b in ((1, 2), (4, 5)):
        if b >= chain.n_joints or not (turning[a] and turning[b]):
            continue
        for sign in (1.0, -1.0):
            q = reading.q.copy()
            q[:, b] += sign * q[:, a]
            told = f"if joint {b + 1} is q{b + 1} {'+' if sign > 0 else '-'} q{a + 1}"
            yield (
                Alternative("coupling", told, "undo the coupling", "M20", f"q{b + 1}"),
                replace(reading, q=q),
            )


def _directions(reading: Reading) -> Iterator[tuple[Alternative, Reading]]:
    """Transforms and rotations the other way round."""
    assert reading.rotation is not None  # only poses have directions
    back = np.swapaxes(reading.rotation, 1, 2)
    T = inverse(transform(reading.rotation, reading.position))
    yield (
        Alternative(
            "inverse",
            "if the file gives the inverse transforms",
            'write gives = "T_tool_tracker" (or take it out) under [frames] in session.toml',
            "M32",
            "frames.gives",
        ),
        replace(reading, position=T[:, :3, 3], rotation=T[:, :3, :3]),
    )
    yield (
        Alternative(
            "transposed",
            "if the rotations are the other way round",
            "give the rotations that take tool axes into tracker axes, matrices by rows",
            "M23",
            "frames",
        ),
        replace(reading, rotation=back),
    )


def _rotations(reading: Reading, stated: Stated) -> Iterator[tuple[Alternative, Reading]]:
    """The same three or four numbers in another order or convention."""
    if reading.numbers is None or stated.form in (MATRIX, "none"):
        return
    for told, fix, code, form, numbers in _other_forms(reading.numbers, stated.form):
        R = rotations(form, numbers)
        position = reading.position
        if stated.inverted:
            # the file's own position, turned back by the new rotation
            assert reading.rotation is not None  # poses only
            own = -(np.swapaxes(reading.rotation, 1, 2) @ position[..., None])
            R = np.swapaxes(R, 1, 2)
            position = -(R @ own)[..., 0]
        yield (
            Alternative("rotation", told, fix, code, "frames"),
            replace(reading, position=position, rotation=R),
        )


def _other_forms(numbers: Array, form: str) -> Iterator[tuple[str, str, str, str, Array]]:
    """Sentence, fix, code, form and numbers of every other reading of rotations."""
    if form == QUATERNION:
        for order, word in (([3, 0, 1, 2], "x y z w"), ([1, 2, 3, 0], "z w x y")):
            told = f"if the columns qw qx qy qz hold {word}"
            yield told, "name the columns in their order", "M22", form, numbers[:, order]
        return
    for factor, told in ((TURN, "deg, not rad"), (1 / TURN, "rad, not deg")):
        words = f"if the angles of the tool are in {told}", "name the columns with that unit"
        yield *words, "M24", form, numbers * factor
    if form == VECTOR:
        for other in EULER_BY_AXIS:
            told = f"if the three angles are Euler angles {other}"
            yield told, f'write euler = "{other}"', "M24", other, _ordered(numbers, other)
        return
    if set(form.upper()) != set("XYZ"):
        for other in EULER:
            if other != form and len(set(other)) == 2:
                yield f"if they turn as {other}", f'write euler = "{other}"', "M24", other, numbers
        return
    by_axis = numbers[:, np.argsort(["XYZ".index(letter) for letter in form.upper()])]
    words = "if the three angles are a rotation vector", 'write euler = "rotation_vector"'
    yield *words, "M24", VECTOR, by_axis
    for other in EULER_BY_AXIS:
        if _plain(other) != _plain(form):
            fixed = "".join(reversed(other)).lower()
            told = f"if the angles turn as {other} (that is {fixed} about fixed axes)"
            yield told, f'write euler = "{other}"', "M24", other, _ordered(by_axis, other)
    swapped = by_axis[:, ::-1]
    for other in EULER_BY_AXIS:
        told = f"if the angles turn as {other} and the columns rx and rz are swapped"
        yield told, "swap the columns rx and rz", "M24", other, _ordered(swapped, other)


EULER_BY_AXIS = tuple("".join(triple) for triple in permutations("XYZ"))
"""Sequences with one angle for each axis; those about fixed axes are the same ones backwards."""


def _ordered(by_axis: Array, form: str) -> Array:
    """Angles about x, y, z in the order of the letters."""
    return by_axis[:, ["XYZ".index(letter) for letter in form.upper()]]


def _plain(form: str) -> str:
    """A sequence about axes that turn along, whichever way it is written."""
    return form if form.isupper() else "".join(reversed(form)).upper()
