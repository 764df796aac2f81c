"""Joints of VAL3 (Stäubli): ``movej({0, -10, ...}, ...)``, or the Data of an application (.dtx)."""

import re

from testbed.files.dialects.controllers.targets import (
    CELL,
    FEWEST,
    JointList,
    Program,
    Target,
    axes_of,
)
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

NAME = r"\w+(?::\w+)?(?:\[[^\]]{0,20}\])?"
LIST = re.compile(r"\s*\{([^{}]*)\}")
GIVEN = re.compile(rf"\s*({NAME})(\.\w+)?\s*=(?!=)\s*(.*)")
MOVED = re.compile(r"(?:^|[\s;:])(movej|movel|movec)\s*\(\s*(.*)")
TAG = re.compile(r"<(/?\w+)([^<>]*)(>?)")
ENTRY = re.compile(r'([\w:]{1,40})="([^"]{0,200})"')
TAUGHT = "movej({0, -10, 80, 0, 90, 0}, tTool, mNom)"


def is_val3_data(text: FileText) -> bool:
    """Whether a text is the Data of an application."""
    return any("<Data " in line for line in text.lines)


def read_val3(text: FileText) -> JointList:
    """Joints of the calls of movej, or of what gets a name, or of all joints that Data hold.

    Raises
    ------
    InputError
        M35: joints are computed, or some of them left out; what `Program.joints` refuses.
    """
    program = Program(text, TAUGHT)
    if is_val3_data(text):
        _data(program, text)
        return program.joints()
    for number, line in program.statements("//"):
        if (move := MOVED.search(line)) is not None:
            _move(program, number, move[1], move[2])
        elif (own := GIVEN.match(line)) is not None:
            program.assign(number, own[1], _axes(own[3]) if own[2] is None else ())
    return program.joints()


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """A call of movej; the other ones go to a position of the tool."""
    if verb != "movej":
        program.aside.append(number)
    else:
        name = re.match(rf"({NAME})\s*,", to)
        program.move(number, verb, name[1] if name else "", _axes(to))


def _axes(value: str) -> tuple[str, ...]:
    """Joints [deg] of a list in braces; empty where it is another."""
    found = LIST.match(value)
    return axes_of(found[1]) if found is not None else ()


def _data(program: Program, text: FileText) -> None:
    """Joints of each Data of a type of joints, each with the key of its array."""
    name = kind = ""
    for number, line in _without_comments(text):
        for tag, inside, end in TAG.findall(line):
            if tag in ("Data", "Value") and not end:
                message = f"<{tag} goes over several lines"
                raise refusal(program.place(number), "joints", message, fix="write it in one line")
            entries = dict(ENTRY.findall(inside))
            if tag.endswith("Data"):
                name, kind = entries.get("name", ""), entries.get("type", "")
            elif tag == "Value" and kind.startswith(("joint", "point", "trsf")):
                own = f"{name}[{entries.get('key', '0')}]"
                if kind.startswith("joint"):
                    program.declare(Target(number, own, _joints(program, number, own, entries)))
                else:
                    program.tool.setdefault(own.lower(), number)


def _joints(program: Program, number: int, name: str, entries: dict[str, str]) -> tuple[str, ...]:
    """All joints of one value [deg]."""
    there = {key for key in entries if re.fullmatch(r"j\d{1,2}", key)}
    wanted = [f"j{k + 1}" for k in range(len(there))]
    axes = [entries[key] for key in wanted if key in there]
    if len(axes) < max(FEWEST, len(there)) or not all(map(CELL.fullmatch, axes)):
        raise refusal(
            program.place(number), "joints", f"{name} does not give all its joints as numbers",
            allowed='j1="0" j2="-10" j3="80" j4="0" j5="90" j6="0"', fix="write all of them",
        )  # fmt: skip
    return tuple(map(str.strip, axes))


def _without_comments(text: FileText) -> list[tuple[int, str]]:
    """Numbered lines without what stands in comments of XML."""
    lines, inside = list[tuple[int, str]](), False
    for number, line in enumerate(text.lines, start=1):
        kept = ""
        for part in re.split(r"(<!--|-->)", line):
            if part in ("<!--", "-->"):
                inside = part == "<!--"
            elif not inside:
                kept += part
        lines.append((number, kept))
    return lines
