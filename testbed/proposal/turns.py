"""Columns of rotations, in each unit and convention that is left open."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from testbed.files.columns import AXIS_COLUMNS, MATRIX_COLUMNS, QUATERNION_COLUMNS
from testbed.files.rotations import EULER
from testbed.files.tried.other_rotations import BY_AXIS
from testbed.proposal.data import Document, Found
from testbed.proposal.names import Meaning, turns_of_letters
from testbed.proposal.sizes import by_size, signed

VECTOR = ("rvx", "rvy", "rvz")
AXIS = (*AXIS_COLUMNS, "axis_angle")
TWICE = ("e1", "e2", "e3")
"""Angles two of which are about one axis."""
FORMS = (QUATERNION_COLUMNS, MATRIX_COLUMNS, AXIS, ("rx", "ry", "rz"), VECTOR, TWICE)
DIRECTIONS: tuple[Document, ...] = ({}, {"gives": "T_tool_tracker"})
TURN = 6.4
"""Angles are never larger where they are in radians [rad]."""
UNIT = 1e-2
"""How far from 1 the length of an axis may be."""


def turn_columns(look: Found) -> tuple[str, ...]:
    """The columns of a table that say how the tool is turned; none if none do."""
    there = (form for form in FORMS if look.has(*form) and (form != AXIS or _are_axes(look)))
    return tuple(look.stems[stem].theirs for stem in next(there, ()))


def turnings(
    look: Found, turns: tuple[str, ...], means: dict[str, Meaning]
) -> Iterator[tuple[dict[str, str], Document, tuple[str, ...]]]:
    """Columns, keys and notes of rotations in these columns."""
    if not turns:
        yield {}, {}, ()
        return
    if turns == tuple(look.stems[stem].theirs for stem in AXIS if look.has(stem)):
        yield from _about_axes(look)
        return
    known = all(name in means and means[name].known for name in turns)
    if len(turns) == 4:
        # a name such as qw says which number it is, and one that counts does not
        told = turns[0] in means and not all(name.rstrip("]) ")[-1:].isdigit() for name in turns)
        for order, gives in product(("wxyz",) if told else ("wxyz", "xyzw"), DIRECTIONS):
            columns = (
                {}
                if known and told
                else {f"q{a}": name for a, name in zip(order, turns, strict=True)}
            )
            said = "rotations: no name states the order of the quaternions; assumed: "
            said += " ".join(order)
            yield columns, gives, (_direction(gives), *(() if told else (said,)))
        return
    if len(turns) == 9:
        named = {} if known else dict(zip(MATRIX_COLUMNS, turns, strict=True))
        for gives in DIRECTIONS:
            yield named, gives, (_direction(gives),)
        return
    if turns == tuple(look.stems[stem].theirs for stem in VECTOR if look.has(stem)):
        for gives in DIRECTIONS:
            yield {}, gives, (_direction(gives),)
        return
    if "euler" in look.head:
        for gives in DIRECTIONS:
            yield {}, gives, (_direction(gives),)
        return
    if turns == tuple(look.stems[stem].theirs for stem in TWICE if look.has(stem)):
        yield from _by_letters(look, known=known)
        return
    unit = next((means[name].unit for name in turns if name in means), "")
    units = (unit,) if known or unit else by_size(look, turns, TURN, ("deg", "rad"))
    usual = ("ZYX", "XYZ") if turns_of_letters(look.head) else ("XYZ", "ZYX")
    forms = (*usual, *(a for a in BY_AXIS if a not in usual), "rotation_vector")
    for gives, one, form in product(DIRECTIONS, units, forms):
        columns = (
            {} if known else {f"r{a}_{one}": name for a, name in zip("xyz", turns, strict=True)}
        )
        said = f"rotations: no file states how the three angles turn; assumed: {form}"
        said += "" if unit or known else f", in {one}"
        yield columns, {"euler": form, **gives}, (said, _direction(gives))


def _by_letters(
    look: Found, *, known: bool
) -> Iterator[tuple[dict[str, str], Document, tuple[str, ...]]]:
    """The same of three angles by letters that fix their order, or of our own columns."""
    there = [look.stems[stem] for stem in TWICE]
    names = [one.theirs for one in there]
    unit = next((one.unit for one in there if one.unit), "")
    units = (unit,) if known or unit else by_size(look, names, TURN, ("deg", "rad"))
    forms = ("ZYZ",) if not known else tuple(one for one in EULER if one[0] == one[2])
    for gives, one, form in product(DIRECTIONS, units, forms):
        columns = {} if known else dict(zip((f"{e}_{one}" for e in TWICE), names, strict=True))
        said = (
            f"rotations: {', '.join(names)} are taken as turns about z, the turned y, the turned z"
        )
        if known:
            said = f"rotations: no file states how the three angles turn; assumed: {form}"
        said += "" if unit or known else f", in {one}"
        yield columns, {"euler": form, **gives}, (said, _direction(gives))


def _about_axes(look: Found) -> Iterator[tuple[dict[str, str], Document, tuple[str, ...]]]:
    """The same of an axis and the angle about it."""
    angle = look.stems["axis_angle"]
    told = angle.known or bool(angle.unit)
    units = (angle.unit,) if told else by_size(look, [angle.theirs], TURN, ("deg", "rad"))
    for gives, unit in product(DIRECTIONS, units):
        columns = {stem: look.stems[stem].theirs for stem in AXIS_COLUMNS
                   if not look.stems[stem].known}  # fmt: skip
        if not angle.known:
            columns[f"axis_angle_{unit}"] = angle.theirs
        said = f"rotations: no column states the unit of the angle; assumed: {unit}"
        yield columns, gives, (*(() if told else (said,)), _direction(gives))


def _are_axes(look: Found) -> bool:
    """Whether three columns are axes of length 1 in most rows, as accelerations are not."""
    axes = signed(look, [look.stems[stem].theirs for stem in AXIS_COLUMNS])
    return bool(np.nanmedian(np.abs(np.linalg.norm(axes, axis=0) - 1)) < UNIT)


def _direction(gives: Document) -> str:
    """What transform was taken."""
    what = "the tracker in the tool" if gives else "the tool in the tracker"
    return f"transforms: assumed to be those of {what}"
