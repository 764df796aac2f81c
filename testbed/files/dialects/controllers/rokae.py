"""Joint targets of an RL program (ROKAE): ``VAR jointtarget j1 = j:{0, -10, ...}{EJ 0, ...}``."""

import re
from dataclasses import replace

from testbed.files.dialects.controllers.targets import JointList, Program, Target, axes_of
from testbed.gates.text import FileText

RL = re.compile(
    r"\b(?:jointtarget|robtarget)\s+\w+\s*=\s*[jp]:\s*\{|\bMoveAbsJ\s+j:\s*\{", re.IGNORECASE
)
DECLARED = re.compile(r"\bjointtarget\s+(\w+)(.*)", re.IGNORECASE)
PLACED = re.compile(r"\brobtarget\s+(\w+)", re.IGNORECASE)
MOVED = re.compile(r"(?:^|[\s;])(MoveAbsJ|Move[JLCT]\w{0,9}|Search[LC])\b(.*)", re.IGNORECASE)
VALUE = re.compile(r"\s*j:\s*\{([^{}]*)\}\s*(?:\{\s*EJ([^{}]*)\})?", re.IGNORECASE)
ASSIGNED = re.compile(r"\s*(\w+)[^=]*=")
QUOTED = re.compile(r'"[^"]*"?')
ARM = 6
"""Joints of an arm whose targets may state a seventh, which is 0 in each of them."""
TAUGHT = "VAR jointtarget j1 = j:{0, -10, 80, 0, 90, 0}{EJ 0, 0, 0, 0, 0, 0}"


def is_rokae(text: FileText) -> bool:
    """Whether some line of a text has a target in the notation of this language alone."""
    return any(RL.search(line) for line in text.lines)


def read_rokae(text: FileText) -> JointList:
    """Joints of the moves by MoveAbsJ, or if there are none, of what is declared.

    A seventh joint that is 0 in all targets is none of the arm.

    Raises
    ------
    InputError
        M35: joints are computed; or as `Program.joints`.
    """
    program = Program(text, TAUGHT)
    for number, line in program.statements("//"):
        code = QUOTED.sub("", line)
        if (own := DECLARED.search(code)) is not None:
            found = _target(number, own[1], own[2].strip().removeprefix("="))
            if found is not None:
                program.declare(found)
            else:
                program.again.setdefault(own[1].lower(), number)
        elif (place := PLACED.search(code)) is not None:
            program.tool.setdefault(place[1].lower(), number)
        elif (move := MOVED.search(code)) is not None:
            _move(program, number, move[1], move[2])
        elif (changed := ASSIGNED.match(code)) is not None:
            program.again.setdefault(changed[1].lower(), number)
    return _of_the_arm(program).joints()


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """A move; those other than MoveAbsJ go to a position of the tool."""
    name = re.match(r"\s*(\w+)\s*,", to)
    if verb.lower() != "moveabsj":
        program.aside.append(number)
    elif name is not None:
        program.move_to(number, name[1])
    elif (found := _target(number, "", to)) is not None:
        program.moves.append(found)
    else:
        raise program.computed(number, verb)


def _target(number: int, name: str, value: str) -> Target | None:
    """Joints [deg] and external ones of a target; None where they are not numbers."""
    found = VALUE.match(value)
    axes = axes_of(found[1]) if found is not None else ()
    if found is None or not axes:
        return None
    others = axes_of(found[2])
    beside = tuple((f"eax_{'abcdef'[k % 6]}", cell) for k, cell in enumerate(others))
    return Target(number, name, axes, (), beside)


def _of_the_arm(program: Program) -> Program:
    """The same targets without a seventh joint that is 0 in all of them."""
    rows = [*program.declared.values(), *program.moves]
    if rows and all(len(row.axes) == ARM + 1 and not row.axes[ARM].strip("0.+-") for row in rows):
        for name, row in program.declared.items():
            program.declared[name] = replace(row, axes=row.axes[:ARM])
        program.moves = [replace(row, axes=row.axes[:ARM]) for row in program.moves]
    return program
