"""Transforms that are printed as squares, four lines for each, as one line for each."""

import re
from collections.abc import Sequence
from dataclasses import replace

from testbed.files.dialects.numbers import number_of
from testbed.gates.text import FileText

SIZE = 4
LAST = [0.0, 0.0, 0.0, 1.0]
"""Row below the rotation and the place."""
BETWEEN = re.compile(r"[\s,;]+")
FEWEST = 2


def with_square_rows(text: FileText) -> FileText:
    """A file of nothing but squares, each written into its last line; others as they come.

    A line of words may stand above each of them. If all of these differ, they are names, and come
    before the numbers.
    """
    content = text.content("#", "//", "%")
    cells = [BETWEEN.split(line.strip(" \t,;[]()")) for _, line in content]
    square = [len(one) == SIZE and all(number_of(cell) == number_of(cell) for cell in one)
              for one in cells]  # fmt: skip
    titled = bool(square) and not square[0]
    size = SIZE + titled
    if len(content) < FEWEST * size or len(content) % size:
        return text
    blocks = [range(k, k + size) for k in range(0, len(content), size)]
    if not all(_is_square(block[titled:], cells, square) for block in blocks):
        return text
    if titled and any(square[block[0]] for block in blocks):
        return text
    names = ["_".join(cells[block[0]]) for block in blocks] if titled else []
    named = len(set(names)) == len(names) > 0
    lines = [""] * len(text.lines)
    for k, block in enumerate(blocks):
        numbers = [cell for row in block[titled:] for cell in cells[row]]
        lines[content[block[-1]][0] - 1] = " ".join([names[k], *numbers] if named else numbers)
    return replace(text, lines=tuple(lines))


def _is_square(rows: Sequence[int], cells: Sequence[Sequence[str]], square: Sequence[bool]) -> bool:
    """Whether four lines have four numbers each, the last ones 0 0 0 1."""
    return all(square[k] for k in rows) and [number_of(cell) for cell in cells[rows[-1]]] == LAST
