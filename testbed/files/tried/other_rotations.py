"""The three or four numbers of rotations in another order, unit or convention."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from calib.arrays import Array
from testbed.files.rotations import AXIS, EULER, QUATERNION, VECTOR, axes_of

TURN = np.pi / 180
BY_AXIS = tuple("".join(triple) for triple in permutations("XYZ"))
"""Sequences with one angle for each axis; those about fixed axes are the same ones backwards."""


def other_forms(numbers: Array, form: str) -> Iterator[tuple[str, str, str, str, Array]]:
    """Condition, fix, code, form and numbers of every other reading of rotations."""
    if form == QUATERNION:
        for order, word in (([3, 0, 1, 2], "x y z w"), ([1, 2, 3, 0], "z w x y")):
            condition = f"if the columns qw qx qy qz hold {word}"
            yield condition, "name the columns in their order", "M22", form, numbers[:, order]
        return
    for factor, units in ((TURN, "deg, not rad"), (1 / TURN, "rad, not deg")):
        condition = f"if the angles of the tool are in {units}"
        yield condition, "name the columns with that unit", "M24", form, numbers * factor
    for condition, fix, other, values in _other_sequences(numbers, form):
        yield condition, fix or f'write euler = "{other}"', "M24", other, values


def _other_sequences(numbers: Array, form: str) -> Iterator[tuple[str, str, str, Array]]:
    """Condition, fix if it is not the sequence, form and numbers of other readings of angles."""
    if form == AXIS:
        return
    if form == VECTOR:
        for other in BY_AXIS:
            condition = f"if the three angles are Euler angles {other}"
            yield condition, "", other, numbers[:, axes_of(other)]
        return
    if set(form.upper()) != set("XYZ"):
        for other in EULER:
            if other != form and len(set(other)) == 2:
                yield f"if they turn in the order {other}", "", other, numbers
        return
    by_axis = numbers[:, np.argsort(axes_of(form))]
    yield "if the three angles are a rotation vector", "", VECTOR, by_axis
    moving = form if form.isupper() else form[::-1].upper()
    for other in BY_AXIS:
        if other != moving:
            fixed = other[::-1].lower()
            condition = f"if the angles turn in the order {other} (or {fixed} about fixed axes)"
            yield condition, "", other, by_axis[:, axes_of(other)]
    swapped = by_axis[:, ::-1]
    for other in BY_AXIS:
        condition = f"if the angles turn in the order {other}, rx and rz swapped"
        yield condition, "swap the columns rx and rz", other, swapped[:, axes_of(other)]
