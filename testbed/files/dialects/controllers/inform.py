"""Joint targets of an INFORM job (Yaskawa) whose positions are angles: ``C00000=0,-10,...``."""

import re
from dataclasses import replace

from testbed.files.dialects.controllers.targets import CELL, JointList, Program, Target
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

KIND = re.compile(r"\s*///POSTYPE\s+(\w+)", re.IGNORECASE)
POSITION = re.compile(r"\s*(C|P|BC|BP|EC|EX)(\d{1,6})\s*=([^=]*)$", re.IGNORECASE)
MOVED = re.compile(r"\s*(MOV[JLCS]|IMOV)\s+(.*)", re.IGNORECASE)
TO = re.compile(r"\s*([CP])(\d{1,6})\b", re.IGNORECASE)
ANGLES, PULSES = ("ANGLE", "JOINT", "DEGREE", "DEG"), "PULSE"
MOST = 6
"""Axes whose order in a job is that of the arm: a seventh turns between two of the others."""
TAUGHT = "///POSTYPE ANGLE and C00000=0,-10,80,0,90,0"
STOPS = "write the joints at each stop, in degrees, in a table"


def read_inform(text: FileText) -> JointList:
    """Joints of the moves of a job, or of all its positions.

    Raises
    ------
    InputError
        M35: positions are pulses, or the job does not say what they are; an axis is no number; what
        `Program.joints` refuses.
    """
    program, moves, kind = Program(text, TAUGHT), list[tuple[int, str, str]](), ""
    beside: dict[int, list[tuple[str, str]]] = {}
    for number, line in text.content("'"):
        if (said := KIND.match(line)) is not None:
            kind = said[1].upper()
        elif (own := POSITION.match(line)) is not None:
            letters, cells = own[1].upper(), [cell.strip() for cell in own[3].split(",")]
            if letters in ("C", "P"):
                _position(program, number, f"{letters}{int(own[2])}", cells, kind)
            else:
                more = [(f"{letters} {k + 1}", cell) for k, cell in enumerate(cells)]
                beside.setdefault(int(own[2]), []).extend(more)
        elif (move := MOVED.match(line)) is not None:
            moves.append((number, move[1].upper(), move[2]))
    for name, target in program.declared.items():
        more = beside.get(int(name[1:]), [])
        program.declared[name] = replace(target, beside=tuple(more))
    for number, verb, to in moves:
        _move(program, number, verb, to)
    return program.joints()


def _position(program: Program, number: int, name: str, cells: list[str], kind: str) -> None:
    """One position, of the kind that stands above it."""
    if kind == PULSES:
        raise refusal(
            program.place(number), "joints",
            f"{name} is in pulses: only parameters of the controller state the pulses per degree "
            "of an axis, and its zero",
            fix=f"{STOPS}, or export the job with its positions as angles",
        )  # fmt: skip
    if not kind:
        raise refusal(
            program.place(number), "joints",
            f"no line ///POSTYPE states whether {name} has pulses, angles or a Cartesian position",
            fix=f"export the whole job, or {STOPS}",
        )  # fmt: skip
    if kind not in ANGLES:
        program.tool.setdefault(name.lower(), number)
    elif len(cells) > MOST or not all(map(CELL.fullmatch, cells)):
        why = f"{name} has {len(cells)} axes" if len(cells) > MOST else f"{name} is no list of axes"
        raise refusal(
            program.place(number), "joints", why,
            allowed=f"at most {MOST}: a job does not state the place of a further axis", fix=STOPS,
        )  # fmt: skip
    else:
        program.declare(Target(number, name, tuple(cells)))


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """A move to a position; an arc goes through one."""
    if verb == "IMOV":
        raise program.relative(number, verb)
    target = TO.match(to)
    if verb in ("MOVJ", "MOVL") and target is not None:
        program.move_to(number, f"{target[1].upper()}{int(target[2])}")
    else:
        program.aside.append(number)
