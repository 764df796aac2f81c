"""Cells of a table as numbers: what Python reads otherwise, and decimal commas."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from testbed.gates.text import FileText

NUMBER = re.compile(r"[+\u2212-]?\d[\d.,]*([eE][+-]?\d+)?")
NUMBERS_ALONE = re.compile(r"[\s\d.,;eE+\u2212\[\](){}-]*")
"""A line of nothing but numbers, and brackets around some of them."""
ASSIGNED = re.compile(r"\s*\w+\s*=\s*(np\.|numpy\.)?(array\()?(?=\[)")
"""What a script writes before numbers in brackets."""
FORTRAN = re.compile(r"(?<![\w.])([+-]?(?:\d++\.\d*+|\.\d++))[dD]([+-]\d{1,3})(?!\w)")
"""A number of double precision as Fortran writes it, 1.234D-03."""
GLUED = re.compile(r"(?<=\d)-(?=\d)")
"""A minus that is all there is between two numbers of fixed width."""


def with_exponents(text: FileText) -> FileText:
    """A file with an E in place of the D of Fortran's exponents."""
    if not any(sign in line for line in text.lines for sign in ("D-", "D+", "d-", "d+")):
        return text
    return replace(text, lines=tuple(FORTRAN.sub(r"\1E\2", line) for line in text.lines))


def with_bare_numbers(text: FileText) -> FileText:
    """A file of numbers in brackets without these, or of numbers that touch with a space between.

    Scripts and consoles print arrays so. All other files come back as they are.
    """
    content = text.content("#", "//", "%")
    if not content:
        return text
    first = content[0][0]
    lines = dict(content)
    if (said := ASSIGNED.match(lines[first])) is not None:
        lines[first] = lines[first][said.end() :]
    if not all(NUMBERS_ALONE.fullmatch(line) for line in lines.values()):
        return text
    if any(mark in line for line in lines.values() for mark in "[({"):
        lines = {k: _without_brackets(line) for k, line in lines.items()}
    elif not any(mark in line for line in lines.values() for mark in ",;\t"):
        apart = {k: GLUED.sub(" -", line) for k, line in lines.items()}
        if apart == lines or len({len(line.split()) for line in apart.values()}) > 1:
            return text
        lines = apart
    else:
        return text
    changed = (lines.get(k, line) for k, line in enumerate(text.lines, 1))
    return replace(text, lines=tuple(changed))


def _without_brackets(line: str) -> str:
    """A line without brackets, its lists parted as the numbers in them."""
    mark = "," if "," in line else " "
    line = re.sub(r"[\])}][\s,;]*[\[({]", mark, line.strip())
    return re.sub(r"[\[\](){}]", " ", line.rstrip(";,])} ")).strip()


def floats(cells: Sequence[str]) -> Array:
    """Numbers (m,); nan where a cell is none."""
    if not any("_" in cell for cell in cells):  # Python reads 1_000, a table should not
        try:
            return np.array([float(cell) for cell in cells], dtype=np.float64)
        except ValueError:
            pass
    return np.array([number_of(cell) for cell in cells], dtype=np.float64)


def number_of(cell: str) -> float:
    """One number, its minus as in print or not, or nan."""
    try:
        return np.nan if "_" in cell else float(cell.replace("\u2212", "-"))
    except ValueError:
        return np.nan


def pointed(cell: str) -> str:
    """A number with a decimal comma as one with a point; a point there makes it no number."""
    return cell.replace(",", ".") if "." not in cell else "?"


def digits_after(cell: str, mark: str) -> int:
    """Digits after the decimal mark."""
    mantissa = re.split("[eE]", cell)[0]
    return len(mantissa.split(mark)[1]) if mark in mantissa else 0
