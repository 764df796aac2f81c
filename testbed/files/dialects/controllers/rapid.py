"""Joint targets of a RAPID program as a sheet: those of its moves, or else those it declares."""

import re
from collections.abc import Iterator
from dataclasses import replace

from testbed.files.dialects.controllers.targets import ANOTHER, JointList, Target, sheet_of
from testbed.files.refusal import refusal
from testbed.gates.text import FileText
from testbed.units import counted

TARGET = re.compile(r"\[\s*\[([^\[\]]*)\]\s*,\s*\[([^\[\]]*)\]\s*\]")
"""``[[10,20,30,40,50,60],[9E9,9E9,9E9,9E9,9E9,9E9]]``: robot axes, external axes."""
INDEX = r"\s*(?:\{([^{}]{0,99})\}\s*)?"
"""Index or size of an array; of bounded length, since it is tried at each word."""
DECLARED = re.compile(rf"\bjointtarget\s+(\w+){INDEX}(:=|;|$)", re.IGNORECASE)
"""``CONST jointtarget p1 :=`` or, of an array, ``PERS jointtarget p{3} :=``."""
MOVED = re.compile(rf"\bMoveAbsJ\b\s*(?:\\Conc\s*,\s*)?(\w*){INDEX}", re.IGNORECASE)
ASSIGNED = re.compile(r"\b(\w+)(?:\s?(?:\{[^{}]{0,99}\}|\.\w{1,99})){0,4}\s{0,99}:=")
"""A target, or a part of one, that gets another value."""
TOKEN = re.compile(r'"[^"]*"?|!.*|;|[^"!;]+')
"""A text, a comment, the end of a statement, or code."""
ABSENT = 9e8
"""Value from which an external axis does not exist; RAPID writes 9E9."""
OF_TOOL = re.compile(r"\b(?:Move|Trigg)[JLC]\b", re.IGNORECASE)
"""Moves to Cartesian positions."""
Axes = tuple[tuple[str, ...], tuple[tuple[str, str], ...]]
"""Axes of the robot, then names and values of external ones."""
ONE_EACH = "write each position as its own jointtarget, or its numbers in the move"


def is_rapid(text: FileText) -> bool:
    """Whether a text declares joint targets of RAPID, or moves to them."""
    return any(DECLARED.search(line) or MOVED.search(line) for line in text.lines)


def read_rapid(text: FileText) -> JointList:
    """Joints of a program, one row for each move, or else for each target.

    Raises
    ------
    InputError
        M35: there is no joint target, a move names one that is not declared, one is assigned a
        value in the program, or the axes differ.
    """
    declared: dict[str, Target] = {}
    coded: dict[str, tuple[str, str]] = {}
    listed, moves, unread, aside = list[Target](), list[Target](), set[str](), 0
    for lines, code in _statements(text):
        wanted = [*DECLARED.finditer(code), *MOVED.finditer(code)]
        number = lines[code.count("\n", 0, wanted[0].start() if wanted else 0)]
        where = f"{text.where}:{number}"
        found = [_axes(target) for target in TARGET.finditer(code)]
        name, move = DECLARED.search(code), MOVED.search(code)
        array = name[2] if name else None
        if len(wanted) > 1 or (wanted and len(found) > 1 and array is None):
            raise refusal(
                where, "joints", "has two targets in one statement",
                fix="end each statement with a semicolon",
            )  # fmt: skip
        if name:
            own = [Target(number, name[1], axes, (), more) for axes, more in found]
            if array is not None:
                _require_all(name[1], array, len(found), where)
                own = [replace(row, name=f"{name[1]}{{{k}}}") for k, row in enumerate(own, 1)]
            listed += own
            declared |= {row.name.lower(): row for row in own}
            if name[3] == ":=" and not own:
                coded[name[1].lower()] = where, "is not given by numbers"
                unread.add(name[1].lower())
        elif move:
            named = _moved(move, declared, where) if not found else None
            own_axes = named or Target(number, "", found[0][0], (), found[0][1])
            moves.append(replace(own_axes, line=number))
        else:
            aside += bool(OF_TOOL.search(code))
            for one in ASSIGNED.finditer(code):
                line = lines[code.count("\n", 0, one.start())]
                coded.setdefault(one[1].lower(), (f"{text.where}:{line}", ANOTHER))
    rows = moves or listed
    used = {row.name.partition("{")[0].lower() for row in rows} | (set() if moves else unread)
    for target in filter(used.__contains__, coded):
        where, why = coded[target]
        raise refusal(where, "joints", f"{target[:40]} {why}", fix=ONE_EACH)
    if not rows:
        fix = "give a program with jointtarget or MoveAbsJ"
        raise refusal(text.where, "joints", "has no joint target", fix=fix)
    return JointList(sheet_of(text, rows), aside)


def _require_all(name: str, array: str, count: int, where: str) -> None:
    """Refuse an array of several dimensions, or with another number of targets than declared."""
    size = array.strip()
    if count and ("," in size or (size.isdigit() and int(size) != count)):
        raise refusal(
            where, "joints", f"{name[:40]}{{{size[:20]}}} has {counted(count, 'target')}",
            allowed="an array has one dimension and the declared number of targets", fix=ONE_EACH,
        )  # fmt: skip


def _moved(move: re.Match[str], declared: dict[str, Target], where: str) -> Target:
    """The target that a move names."""
    index = None if move[2] is None else move[2].strip()
    if index is not None and not index.isdigit():
        raise refusal(
            where, "joints",
            f"moves to {move[1][:40]}{{{index[:20]}}}, whose index is known only while the program "
            "runs", fix=ONE_EACH + ", or give the declarations alone",
        )  # fmt: skip
    name = move[1] if index is None else f"{move[1]}{{{int(index)}}}"
    if name.lower() not in declared:
        raise refusal(
            where, "joints", f'moves to "{name[:40]}", which is no jointtarget declared before',
            fix="declare it in the same file before the move",
        )  # fmt: skip
    return declared[name.lower()]


def _statements(text: FileText) -> Iterator[tuple[list[int], str]]:
    """Code of each statement, without texts and comments, and the numbers of its lines."""
    lines, code = list[int](), list[str]()
    # all lines: one that holds nothing but ";" ends a statement
    for number, line in enumerate(text.lines, start=1):
        lines.append(number)
        code.append("")
        for token in TOKEN.findall(line):
            if token == ";":
                yield lines, "\n".join(code)
                lines, code = [number], [""]
            elif token[0] not in '"!':
                code[-1] += token
    if lines:
        yield lines, "\n".join(code)


def _axes(found: re.Match[str]) -> Axes:
    """Axes of a target as written, and the external ones that exist."""
    own, others = ([cell.strip() for cell in found[k].split(",")] for k in (1, 2))
    beside = [(f"eax_{'abcdef'[k % 6]}", cell) for k, cell in enumerate(others)]
    return tuple(own), tuple((name, cell) for name, cell in beside if not _absent(cell))


def _absent(cell: str) -> bool:
    """Whether an external axis does not exist."""
    try:
        return abs(float(cell)) > ABSENT
    except ValueError:
        return False
