"""Names of the entries of transforms and rotations, counted from 1 or from 0."""

import re
from collections.abc import Sequence

TRANSFORM = re.compile(r"([a-z]) ?([0-4]) ?([0-4])")
"""T11 ... T34, m_00 ... m_23."""


def entry_of(text: str, others: Sequence[str]) -> str:
    """The stem of an entry, x or r12, where all of one letter are there; else empty.

    Those are twelve, or nine of the letter r; the last row of a transform is none.
    """
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
