"""Axis targets of a KRL program (KUKA): ``PTP {A1 0, A2 -90 ...}``, ``E6AXIS XP1={...}``."""

import re

from testbed.files.dialects.controllers.targets import FEWEST, NUMBER, JointList, Program, Target
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

ENTRY = re.compile(rf"\s*([A-Z]\w*)\s+({NUMBER})\s*", re.IGNORECASE)
AGGREGATE = re.compile(r"\{(?:\s*\w+\s*:)?([^{}]*)\}")
DECLARED = re.compile(
    r"\s*(?:GLOBAL\s+|DECL\s+|CONST\s+){0,3}(?:(E6AXIS|AXIS|E6POS|POS|FRAME)\s+)?"
    r"(\w+(?:\[[^\]]{0,20}\])?)\s*(?:=\s*(\{.*))?$",
    re.IGNORECASE,
)
CHANGED = re.compile(r"\s*(\w+(?:\[[^\]]{0,20}\])?)(?:\.\w+)?\s*=(?!=)", re.IGNORECASE)
MOVED = re.compile(
    r"\s*(S?(?:PTP|LIN|CIRC)(?:_REL)?)(?:\s+|(?=\{))(\{[^{}]*\}|\w+(?:\[[^\]]{0,20}\])?)",
    re.IGNORECASE,
)
LIST = (
    "give its data list, the .dat of the same name, in place of the program: the E6AXIS in it have "
    "the joints; or declare it in the same file before the move"
)
"""Where the targets of inline forms stand."""
OF_TOOL = ("E6POS", "POS", "FRAME")
ROBOT = ("A1", "A2", "A3", "A4", "A5", "A6", "A7")


def read_krl(text: FileText) -> JointList:
    """Axes of the moves of a program, or of the targets in a data list.

    Raises
    ------
    InputError
        M35: a move names only some of the axes, or a target that this file does not declare; or
        as `Program.joints`.
    """
    program = Program(text, "E6AXIS P1={A1 ..., A2 ...}", LIST)
    for number, line in program.statements(";", "&"):
        if (move := MOVED.match(line)) is not None:
            _move(program, number, move[1].upper(), move[2])
        elif line.lstrip().startswith("{"):  # as copied from a display: the verb is not there
            _move(program, number, "PTP", line.strip())
        elif (own := DECLARED.match(line)) is not None and (own[1] or own[3]):
            _declare(program, number, (own[1] or "").upper(), own[2], own[3] or "")
        elif (changed := CHANGED.match(line)) is not None:
            program.again.setdefault(changed[1].lower(), number)
    return program.joints()


def _declare(program: Program, number: int, kind: str, name: str, value: str) -> None:
    """Read a declaration, or an assignment of an aggregate."""
    axes = _axes(program, number, value) if value else None
    if axes is not None and axes[0]:
        program.declare(Target(number, name, axes[0], (), axes[1]))
    elif kind in OF_TOOL or (axes is not None and axes == ((), ()) and _is_place(value)):
        program.tool.setdefault(name.lower(), number)


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """Read a move to an aggregate, or to a named target."""
    if not verb.endswith("PTP"):
        if "PTP" in verb:
            raise program.relative(number, verb)
        program.aside.append(number)
    elif to[0] != "{":
        program.move_to(number, to)
    else:
        axes, beside = _axes(program, number, to)
        if axes:
            program.moves.append(Target(number, "", axes, (), beside))
        else:
            program.aside.append(number)


def _axes(
    program: Program, number: int, value: str
) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Axes of the robot in an aggregate, and external ones; none for a Cartesian position."""
    found = AGGREGATE.search(value)
    entries = [ENTRY.fullmatch(part) for part in found[1].split(",")] if found else []
    there = {one[1].upper(): one[2] for one in entries if one is not None}
    own = [name for name in ROBOT if name in there]
    if not own:
        return (), ()
    if None in entries or own != [*ROBOT[: len(own)]] or len(own) < FEWEST:
        raise refusal(
            program.place(number), "joints",
            f"names only {', '.join(own)}: other axis values are known only while the program runs",
            fix="write all axes: {A1 ..., A2 ..., A3 ..., A4 ..., A5 ..., A6 ...}",
        )  # fmt: skip
    others = tuple((name, cell) for name, cell in there.items() if name[0] == "E")
    return tuple(there[name] for name in own), others


def _is_place(value: str) -> bool:
    """Whether an aggregate is a Cartesian position."""
    return bool(re.search(r"\{(?:\s*\w+\s*:)?\s*X\s", value, re.IGNORECASE))
