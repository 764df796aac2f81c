"""Cells that hold several numbers, and points of which each coordinate has a row of its own."""

import re
from collections.abc import Sequence
from dataclasses import replace

from testbed.files.dialects.numbers import NUMBER, number_of
from testbed.files.rows.planned import of_stops
from testbed.files.text import Sheet, read_sheet
from testbed.gates.text import FileText

OPEN, CLOSED = ("[", "(", "{"), ("]", ")", "}")
BETWEEN = re.compile(r"[\s,;\[\](){}]+")
INNER = re.compile(r"[\[({]([^\[\](){}]+)[\])}]")
"""Numbers of a list that holds no other one."""
SCALAR = re.compile(r"\b(?:np\.|numpy\.)?float(?:32|64)?\(([^()]*+)\)")
"""A number as newer numpy prints it in a list."""
ARRAY = re.compile(
    r"(?:[a-z]{1,20}\.)?(?:array|tensor|Array|deque|list|tuple)\(([\[(].*?[\])])"
    r"(?:,\s*(?:dtype|device)\s*=[^\[\](){}]*+)*+\)"
)
"""Numbers as Python prints an array, or one of another package."""
PLACES = {"position", "pos", "xyz", "point", "translation", "place", "p", "tcp", "coordinates",
          "measured", "tvec", "t", "tracker", "smr", "marker"}  # fmt: skip
"""Words of a list of three that is a place."""
AXES = ("x", "y", "z")
POSE = (*AXES, "rx", "ry", "rz")
OF_AXIS = {"x": "X", "y": "Y", "z": "Z", "x-axis": "X", "y-axis": "Y", "z-axis": "Z"}
"""What is said of a coordinate that has a row of its own."""
ENDS = {3: 0.0, 7: 0.0, 11: 0.0, 15: 1.0}
"""Numbers of a transform that is written by columns."""
PLACE = (12, 13, 14)
"""Where its translation is then."""
MOST = 64
"""Largest number of numbers in a cell."""


def sheet_in(text: FileText, *, separator: str = "", header: bool | None = None) -> Sheet:
    """The table of a session's file, as of `read_sheet` and `of_rows`; each is made once.

    Joints and readings share a file, and interpretations that are tried share all of them.
    """
    how = separator, header
    if how not in text.tables:
        sheet = read_sheet(text, separator=separator, header=header, below=True)
        text.tables[how] = of_rows(sheet)
    made: Sheet = text.tables[how]
    return made


def of_rows(sheet: Sheet) -> Sheet:
    """A table with one number a cell and one reading a row; most are so as they stand."""
    return of_stops(_of_coordinates(_of_lists(sheet)))


def _of_lists(sheet: Sheet) -> Sheet:
    """The same with a column for each number of the cells that are lists, as in "[1, 2, 3]"."""
    columns = list(zip(*sheet.rows, strict=True))
    inside = [_lists(column) for column in columns]
    if not any(inside):
        return sheet
    head: list[str] = []
    cells: list[Sequence[str]] = []
    for name, column, lists in zip(sheet.head, columns, inside, strict=True):
        head += _names(name, lists, _places_in(column)) if lists else [name]
        cells += list(zip(*lists, strict=True)) if lists else [column]
    if len(set(head)) < len(head):
        return sheet
    units = ()  # those of a list are not said
    rows = tuple(zip(*cells, strict=True))
    return replace(sheet, head=tuple(head), rows=rows, units=units)


def _lists(column: Sequence[str]) -> list[list[str]]:
    """Numbers of each cell where all of them are lists of as many; else none."""
    found = []
    for cell in column:
        text = _plain(cell.strip())
        inside = BETWEEN.split(text) if text.startswith(OPEN) and text.endswith(CLOSED) else []
        numbers = [one for one in inside if one]
        if not 2 <= len(numbers) <= MOST or not all(map(NUMBER.fullmatch, numbers)):
            return []
        found.append(numbers)
    return found if found and len({len(one) for one in found}) == 1 else []


def _plain(text: str) -> str:
    """A list as it stands in what Python prints, np.array([...]) or [np.float64(...) ...]."""
    if "(" not in text:
        return text
    text = SCALAR.sub(r"\1", text)
    array = ARRAY.fullmatch(text)
    return text if array is None else array[1]


def _places_in(column: Sequence[str]) -> int:
    """How many lists of three stand in the list of each cell, as of several markers; 0 if none."""
    counts = set()
    for cell in column:
        inner = [BETWEEN.split(one.strip()) for one in INNER.findall(_plain(cell.strip()))]
        counts.add(len(inner) if all(len(one) == len(AXES) for one in inner) else 0)
    return counts.pop() if len(counts) == 1 else 0


def _names(name: str, lists: Sequence[Sequence[str]], places: int) -> list[str]:
    """Names of the numbers of a list: places, a transform and a rotation have their own.

    A transform is written by rows, or by columns where that alone makes it one.
    """
    count = len(lists[0])
    words = set(re.split(r"[\W_]+", name.lower()))
    if count == 3 and words & PLACES:
        return [f"{name} {axis}" for axis in AXES]
    if places > 1 and count == 3 * places and {word.removesuffix("s") for word in words} & PLACES:
        return [f"{name}{k + 1} {axis}" for k in range(places) for axis in AXES]
    if count == 6 and "pose" in words:
        return [f"{name} {axis}" for axis in POSE]
    if count == 16 and _are_columns(lists):
        return [f"T{k % 4 + 1}{k // 4 + 1}" for k in range(count)]
    if count in (12, 16):
        return [f"T{k // 4 + 1}{k % 4 + 1}" for k in range(count)]
    if count == 9:
        return [f"r{k // 3 + 1}{k % 3 + 1}" for k in range(count)]
    return [f"{name}[{k}]" for k in range(count)]


def _are_columns(lists: Sequence[Sequence[str]]) -> bool:
    """Whether transforms (16 numbers) are written by columns, and by rows would be none."""
    ends = all(number_of(one[k]) == end for one in lists for k, end in ENDS.items())
    return ends and any(number_of(one[k]) for one in lists for k in PLACE)


def _of_coordinates(sheet: Sheet) -> Sheet:
    """The same with one row a point where X, Y and Z of each have rows of their own.

    Reports of coordinate measuring machines are so: the name, the axis, nominal and measured.
    """
    for at in range(len(sheet.head)):
        axes = [OF_AXIS.get(row[at].lower(), "") for row in sheet.rows]
        if not axes or len(axes) % 3 or set(zip(*[iter(axes)] * 3, strict=True)) != {(*"XYZ",)}:
            continue
        groups = [sheet.rows[k : k + 3] for k in range(0, len(axes), 3)]
        numbers = [k for k in range(len(sheet.head)) if k != at
                   and all(NUMBER.fullmatch(row[k]) for row in sheet.rows)
                   and any(len({row[k] for row in group}) > 1 for group in groups)]  # fmt: skip
        others = [k for k in range(len(sheet.head)) if k != at and k not in numbers]
        same = [all(len({row[k] for row in group if row[k]}) < 2 for group in groups)
                for k in others]  # fmt: skip
        alike = [k for k, one in zip(others, same, strict=True) if one]
        head = [sheet.head[k] for k in alike]
        head += [f"{sheet.head[k]} {axis}" for k in numbers for axis in "XYZ"]
        rows = [
            (*(max(row[k] for row in group) for k in alike),
             *(row[k] for k in numbers for row in group))
            for group in groups
        ]  # fmt: skip
        return replace(sheet, head=tuple(head), rows=tuple(rows), lines=sheet.lines[::3], units=())
    return sheet
