"""Joint targets of a RAPID program as a sheet: those of its moves, or else those it declares."""

import re
from collections.abc import Iterator

from testbed.files.refusal import refusal
from testbed.files.text import Sheet
from testbed.gates.text import FileText

TARGET = re.compile(r"\[\s*\[([^\[\]]*)\]\s*,\s*\[([^\[\]]*)\]\s*\]")
"""``[[10,20,30,40,50,60],[9E9,9E9,9E9,9E9,9E9,9E9]]``: robot axes, external axes."""
DECLARED = re.compile(r"\bjointtarget\s+(\w+)\s*:=", re.IGNORECASE)
MOVED = re.compile(r"\bMoveAbsJ\b\s*(\w*)", re.IGNORECASE)
TOKEN = re.compile(r'"[^"]*"?|!.*|;|[^"!;]+')
"""A text, a comment, the end of a statement, or code."""
ABSENT = 9e8
"""An external axis of 9E9 is not there."""
Row = tuple[int, str, tuple[str, ...]]
"""Line, name or nothing, and the axes."""


def is_rapid(text: FileText) -> bool:
    """Whether a text declares joint targets of RAPID, or moves to them."""
    return any(DECLARED.search(line) or MOVED.search(line) for line in text.lines)


def read_rapid(text: FileText) -> Sheet:
    """Rows ``pose_id, q1_deg ...`` of a program, one for each target or move.

    Without a name for each there is no ``pose_id``. External axes that are there become columns
    ``eax_a ...``, of which nothing is read.

    Raises
    ------
    InputError
        M35: there is no joint target, a move names one that is not declared, or the axes differ.
    """
    declared: dict[str, Row] = {}
    moves: list[Row] = []
    for lines, code in _statements(text):
        wanted = [*DECLARED.finditer(code), *MOVED.finditer(code)]
        if not wanted:
            continue
        name, move = DECLARED.search(code), MOVED.search(code)
        number = lines[code.count("\n", 0, wanted[0].start())]
        found = list(TARGET.finditer(code))
        if len(wanted) > 1 or len(found) > 1:
            raise refusal(
                f"{text.where}:{number}", "joints", "has two targets in one statement",
                fix="end each statement with a semicolon",
            )  # fmt: skip
        axes = _axes(found[0]) if found else ()
        if name and axes:
            declared[name[1].lower()] = (number, name[1], axes)
        elif move and axes:
            moves.append((number, "", axes))
        elif move and move[1].lower() in declared:
            moves.append((number, *declared[move[1].lower()][1:]))
        elif move:
            raise refusal(
                f"{text.where}:{number}", "joints",
                f'moves to "{move[1][:40]}", of which there is no jointtarget before',
                fix="put its declaration into the same file, before the move",
            )  # fmt: skip
    rows = moves or list(declared.values())
    if not rows:
        fix = "give a program with jointtarget or MoveAbsJ"
        raise refusal(text.where, "joints", "has no joint target", fix=fix)
    widths = {len(axes) for _, _, axes in rows}
    if len(widths) > 1:
        fix = "split the file"
        raise refusal(text.where, "joints", "has targets of different robots", fix=fix)
    return _sheet(text, rows)


def _statements(text: FileText) -> Iterator[tuple[list[int], str]]:
    """Code of each statement, without texts and comments, and the numbers of its lines."""
    lines, code = list[int](), list[str]()
    for number, line in text.content("!"):
        lines.append(number)
        code.append("")
        for token in TOKEN.findall(line):
            if token == ";":
                yield lines, "\n".join(code)
                lines, code = [number], [""]
            elif token[0] not in '"!':
                code[-1] += token
    yield lines, "\n".join(code)


def _axes(found: re.Match[str]) -> tuple[str, ...]:
    """Axes of a target as they are written, the external ones that are there behind a bar."""
    own = [cell.strip() for cell in found[1].split(",")]
    return (*own, *(f"|{cell.strip()}" for cell in found[2].split(",") if not _absent(cell)))


def _absent(cell: str) -> bool:
    """Whether an external axis is none."""
    try:
        return abs(float(cell)) > ABSENT
    except ValueError:
        return False


def _sheet(text: FileText, rows: list[Row]) -> Sheet:
    """The rows as a table."""
    axes = rows[0][2]
    joints = sum(not cell.startswith("|") for cell in axes)
    head = [f"q{k + 1}_deg" for k in range(joints)]
    head += [f"eax_{'abcdef'[k]}" for k in range(len(axes) - joints)]
    names = [name for _, name, _ in rows]
    named = all(names) and len(set(names)) == len(names)
    cells = [tuple(cell.lstrip("|") for cell in axes) for _, _, axes in rows]
    return Sheet(
        text.where,
        ("pose_id", *head) if named else tuple(head),
        tuple((name, *row) if named else row for name, row in zip(names, cells, strict=True)),
        tuple(number for number, _, _ in rows),
        "comma",
        text.encoding,
    )
