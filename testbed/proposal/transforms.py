"""Entries of transforms, by their names or by their place in rows without names."""

import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool
from testbed.files.rotations import MENDED

TRANSFORM = re.compile(r"([a-z]) ?([0-4]),? ?([0-4])")
"""T11 ... T34, m_00 ... m_23, R(1,1) ... R(3,3)."""
OF_PAUL = {f"{c}{a}": f"r{i}{j}" for j, c in enumerate("noa", 1) for i, a in enumerate("xyz", 1)}
"""Normal, orientation and approach of a hand (Paul 1981): the columns of its rotation."""


def entry_of(text: str, others: Collection[str]) -> str:
    """The stem of an entry, x or r12, if all entries of its letter exist; else empty.

    There are twelve entries, or nine for the letter r; the last row of a transform has none. The
    nine of a rotation may also be called nx ... az.
    """
    if text in OF_PAUL and OF_PAUL.keys() <= set(others):
        return OF_PAUL[text]
    entry = TRANSFORM.fullmatch(text)
    if entry is None:
        return ""
    found = filter(None, map(TRANSFORM.fullmatch, others))
    places = {(int(one[2]), int(one[3])) for one in found if one[1] == entry[1]}
    first = 0 if (0, 0) in places else 1
    row, column = (int(entry[k]) - first + 1 for k in (2, 3))
    for columns in (4, 3) if entry[1] == "r" else (4,):
        whole = {(first + i, first + j) for i in range(3) for j in range(columns)}
        if whole <= places and 0 < row < 4 and 0 < column <= columns:
            return "xyz"[row - 1] if column == 4 else f"r{row}{column}"
    return ""


AXES = ("axis {}", "axis{}", "a{}", "k{}", "rot axis {}", "rotation axis {}", "achse {}",
        "drehachse {}", "axe {}", "asse {}", "eje {}")  # fmt: skip
"""What components of an axis are called, where a turn about it stands beside them."""
ABOUT = {"angle", "axis angle", "rotation angle", "rot angle", "theta", "winkel", "drehwinkel",
         "angolo", "ángulo"}  # fmt: skip


def axis_names(texts: Collection[str]) -> dict[str, str]:
    """Stems of an axis and of the only angle beside it; empty where they are not there."""
    angles = ABOUT.intersection(texts)
    for form in AXES:
        axis = {form.format(letter): f"axis_{letter}" for letter in "xyz"}
        if len(angles) == 1 and set(axis) <= set(texts):
            return axis | dict.fromkeys(angles, "axis_angle")
    return {}


@dataclass(frozen=True, slots=True)
class Block:
    """Places of the entries of a transform in the numbers of a row."""

    words: str
    place: tuple[int, ...]
    """Places of x, y, z."""
    turn: tuple[int, ...]
    """Places of r11, r12 ... r33."""
    size: int = 12
    last: tuple[int, ...] = ()
    """Places of the row 0 0 0 1, if it exists."""

    def fits(self, numbers: Array) -> bool:
        """Whether most rows (m, size) are transforms in this order."""
        turns = numbers[:, self.turn]
        good: Bool = np.asarray(np.isfinite(turns).all(axis=1))
        R = np.where(good[:, None], turns, 0.0).reshape(-1, 3, 3)
        # as tolerant as reading, which corrects such rotations
        good &= np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2)) < MENDED
        if self.last:
            good &= (numbers[:, self.last] == (0.0, 0.0, 0.0, 1.0)).all(axis=1)
        return bool(2 * good.sum() > len(good))


_ROWS, _COLUMNS = (0, 1, 2, 3, 4, 5, 6, 7, 8), (0, 3, 6, 1, 4, 7, 2, 5, 8)
SHORT = Block("transforms, 3 x 4, row by row", (3, 7, 11), (0, 1, 2, 4, 5, 6, 8, 9, 10))
BLOCKS = (
    Block("a place, then a rotation row by row", (0, 1, 2), tuple(k + 3 for k in _ROWS)),
    SHORT,
    Block("transforms, 3 x 4, column by column", (9, 10, 11), _COLUMNS),
    Block("a place, then a rotation column by column", (0, 1, 2), tuple(k + 3 for k in _COLUMNS)),
    Block("a rotation row by row, then a place", (9, 10, 11), _ROWS),
    Block("transforms, 4 x 4, row by row", (3, 7, 11), (0, 1, 2, 4, 5, 6, 8, 9, 10), 16,
          (12, 13, 14, 15)),
    Block("transforms, 4 x 4, column by column", (12, 13, 14), (0, 4, 8, 1, 5, 9, 2, 6, 10), 16,
          (3, 7, 11, 15)),
)  # fmt: skip
"""Usual orders of the entries."""
