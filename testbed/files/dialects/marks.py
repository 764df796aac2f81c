"""Decimal and thousands marks of a table: those on which all of its numbers agree."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from calib.errors import InputError
from testbed.files.columns import unit_of
from testbed.files.dialects.numbers import number_of
from testbed.files.refusal import refusal

BLANKS = " '\u00a0\u202f\u2019"
"""Thousands marks that are never decimal marks."""
TOUCHING = re.compile(rf"\d[{BLANKS}]\d")
ODD = re.compile(rf"[,{BLANKS}]"), re.compile(r"\.[^\n]*\.")
"""What no column of plain numbers has in it, its cells one a line."""
GROUPED = re.compile(
    rf"[+\u2212-]?[1-9]\d{{0,2}}([.,{BLANKS}])\d{{3}}(?:\1\d{{3}})*+(?:(?!\1)([.,])\d*+)?"
    r"(?:[eE][+-]?\d+)?"
)
"""A number in groups of three digits: its thousands mark, and its decimal mark if it has one."""
LONG = re.compile(r"[+\u2212-]?\d{4}")
"""The beginning of a number of thousands without such marks."""
THREE = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
TURNS = ("deg", "rad", "gon", "rev")
"""Units of which nothing measures a thousand: a comma before three digits is the decimal mark."""
STATE_IT = 'write decimal = "," or "." under [dialect] in session.toml'
"""What to do where a decimal comma may be a thousands mark."""


@dataclass(frozen=True, slots=True)
class Column:
    """Numbers of a table under one name."""

    own: str
    theirs: str
    cells: Sequence[str]


@dataclass(frozen=True, slots=True)
class Marks:
    """What stands in the numbers of a table besides digits."""

    decimal: str
    """"." or ","."""
    thousands: str = ""
    """What groups of three digits are parted by; empty where nothing does."""


def marks_of(
    where: str,
    lines: Sequence[int],
    columns: Sequence[Column],
    *,
    grouped: bool = True,
    in_doubt: str = STATE_IT,
) -> Marks:
    """The marks of some columns of numbers.

    Thousands marks are taken for such where nothing else can be meant: groups of three digits end
    at a decimal mark, or are several, and no number of the column has four digits without them.

    Parameters
    ----------
    where : str
        File, for messages.
    lines : (m,) sequence of int
        Line of each row.
    columns : sequence of Column
        (m,) cells of each.
    grouped : bool
        Whether thousands marks are read, instead of refused.
    in_doubt : str
        What to do where the decimal mark stays in doubt.

    Raises
    ------
    InputError
        M35: thousands marks that are odd, both decimal marks, or one that may be either.
    """
    comma = point = thousands = None
    sure = False
    for column in columns:
        text, of_turns = "\n".join(column.cells), unit_of(column.own) in TURNS
        if not any(odd.search(text) for odd in ODD):
            first = next((row for row, cell in enumerate(column.cells) if "." in cell), None)
            point = point or (None if first is None else (column.cells[first], first))
            continue
        whole = None
        for row, cell in enumerate(column.cells):
            if ":" in cell:  # a moment, of which is said elsewhere that it is no number
                continue
            mark, end = _parted(cell) if grouped and not of_turns else ("", "")
            if mark and thousands in (None, mark) and end != mark:
                thousands, whole = mark, whole or (cell, row)
            elif mark or _is_odd(cell):
                raise _refused(where, lines[row], column, cell)
            if (end or cell.count(",")) and end != ".":
                comma = comma or (cell, row)
                sure = sure or bool(end) or of_turns or not THREE.fullmatch(cell)
            elif end or "." in cell:
                point = point or (cell, row)
        if whole is not None and any(map(LONG.match, column.cells)):
            raise _refused(where, lines[whole[1]], column, whole[0])
    if comma and point:
        message = (
            f'numbers have a decimal comma ("{comma[0][:20]}", line {lines[comma[1]]}) '
            f'and a point ("{point[0][:20]}", line {lines[point[1]]})'
        )
        raise refusal(where, "decimal", message, fix="save all of them in one form")
    if comma and not sure:
        message = f'numbers such as "{comma[0]}" may have a decimal comma or thousands marks'
        raise refusal(f"{where}:{lines[comma[1]]}", "decimal", message, fix=in_doubt)
    return Marks("," if comma else ".", thousands or "")


def _parted(cell: str) -> tuple[str, str]:
    """The thousands mark of a cell and its decimal mark; both empty where it has none for sure.

    Of two groups that a point or comma parts, the other one of these is the decimal mark.
    """
    found = GROUPED.fullmatch(cell)
    if found is None:
        return "", ""
    mark, end = found[1], found[2] or ""
    if mark in ".,":
        sure = bool(end) or cell.count(mark) > 1
        end = end or ("," if mark == "." else ".")
    else:
        sure = bool(end) or mark != " "
    return (mark, end) if sure else ("", "")


def _is_odd(cell: str) -> bool:
    """Whether a cell has more marks than a number has; degrees and minutes are named elsewhere."""
    return cell.count(",") + cell.count(".") > 1 or (
        "°" not in cell and bool(TOUCHING.search(cell))
    )


def _refused(where: str, line: int, column: Column, cell: str) -> InputError:
    """The error of a number whose thousands marks may mean something else."""
    return refusal(
        f"{where}:{line}", column.own,
        f'{column.theirs} is "{cell[:40]}", which has thousands marks', value=cell[:40],
        allowed="a number has one decimal mark and no other", fix="save it without thousands marks",
    )  # fmt: skip


def either_mark(cell: str) -> float:
    """A number whatever its marks are, to see its size; nan where it is none."""
    return number_of(with_point(cell))


def with_point(cell: str) -> str:
    """A number with a decimal point and no thousands marks, as far as it shows what they are."""
    found = GROUPED.fullmatch(cell)
    if found is not None and (found[2] or found[1] not in ".,"):
        cell = cell.replace(found[1], "")
    return cell.replace(",", ".")


def without_thousands(cell: str, mark: str) -> str:
    """A number without the thousands marks that its table has, if it is in groups of three."""
    found = GROUPED.fullmatch(cell)
    return cell.replace(mark, "") if found is not None and found[1] == mark else cell
