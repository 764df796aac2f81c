"""Joint positions of FANUC: of a TP program as ASCII, and of registers (posreg.va).

``P[1]{ GP1: J1= 0.000 deg, ... };`` in the one, ``[1,2] = 'HOME' Group: 1  J1 = 0.000 deg`` in the
other, whose first number is the group and the second that of the register.
"""

import re

from testbed.files.dialects.controllers.targets import CELL, JointList, Program, Target
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

POSITION = re.compile(r"\s*P\[(\d{1,6})[^\]]{0,99}\]\s*\{(.*)")
GROUP = re.compile(r"GP(\d)\s*:")
ENTRY = re.compile(
    r"\b([JE])(\d)\s*=\s*((?:[^\s,;}]|,(?=\d))*?)\s*(deg|mm)?(?=[\s;}]|,(?!\d)|$)", re.IGNORECASE
)
PLACE = re.compile(r"\bX\s*[=:]")
REGISTERS = re.compile(r"\s*\[\*\w{1,20}\*\]\s*\$POSREG\b")
REGISTER = re.compile(r"\s*\[(\d{1,3}),(\d{1,6})\]\s*=(.*)")
UNTAUGHT = re.compile(r"'\s*Uninitialized|\*{4}")
FIRST = 20
"""Lines among which a file of registers says what it is."""
MOVED = re.compile(r"\s*(?:\d+\s*)?:\s*([JLCA])\s+(PR?)\[([^\]:]{1,20})")
"""``1:J P[1:above] 20% FINE``; comments after // or ! do not match."""


def read_fanuc(text: FileText) -> JointList:
    """Joints of the moves of a program, or of all its positions.

    Raises
    ------
    InputError
        M35: a move goes to a register, a position was never taught; or as `Program.joints`.
    """
    if any(map(REGISTERS.match, text.lines[:FIRST])):
        return _registers(text)
    program = Program(text, "P[1]{ GP1: J1= ... deg, ... }")
    moves, name, block, first = list[tuple[int, str, str, str]](), "", list[str](), 0
    for number, line in text.content():
        if (begun := POSITION.match(line)) is not None:
            name, block, first = begun[1], [begun[2]], number
        elif name:
            block.append(line)
        elif (move := MOVED.match(line)) is not None:
            moves.append((number, move[1], move[2], move[3]))
        if name and "}" in line:
            _position(program, first, f"P{int(name)}", " ".join(block))
            name = ""
    for number, how, kind, own in moves:
        if kind == "PR" or not own.strip().isdigit():
            raise refusal(
                program.place(number), "joints",
                f"moves to {kind}[{own.strip()}]: only the controller knows values of registers",
                fix="teach the position as P[...], or write the joints at each stop in a table",
            )  # fmt: skip
        if how in "JL":
            program.move_to(number, f"P{int(own)}")
        else:
            program.aside.append(number)  # an arc goes through one position to another
    return program.joints()


def _registers(text: FileText) -> JointList:
    """Joints of the position registers that hold such, in their order."""
    taught = "J1 = ... deg in each register, as it is saved once the pendant shows it as joints"
    program = Program(text, taught)
    blocks = list[tuple[int, str, str, list[str]]]()
    for number, line in text.content():
        if (begun := REGISTER.match(line)) is not None:
            blocks.append((number, begun[1], begun[2], [begun[3]]))
        elif blocks:
            blocks[-1][3].append(line)
    for number, group, own, lines in blocks:
        block = " ".join(lines)
        if group == "1" and not UNTAUGHT.search(block):
            _position(program, number, f"PR{int(own)}", block)
    program.aside += program.tool.values()
    return program.joints()


def _position(program: Program, number: int, name: str, block: str) -> None:
    """Read one position, whose first group is the robot."""
    parts = GROUP.split(block.partition("}")[0])
    group = parts[2] if len(parts) > 2 else parts[0]
    found = ENTRY.findall(group)
    joints = [(cell, unit.lower() or "deg") for letter, _, cell, unit in found if letter in "Jj"]
    if untaught := [f"{letter}{k} = {cell}" for letter, k, cell, _ in found if cell[:1] == "*"]:
        message = f"{name} was never taught: it has {untaught[0]}"
        fix = "teach it, or remove it and its moves"
        raise refusal(program.place(number), "joints", message, fix=fix)
    for letter, k, cell, _ in found:
        if letter in "Jj" and not CELL.fullmatch(cell):
            message, fix = f'{name} has J{k} = "{cell}"', "write a number, with a decimal point"
            raise refusal(program.place(number), "joints", message, fix=fix)
    if joints:
        beside = [(f"E{k}", cell) for letter, k, cell, _ in found if letter in "Ee"]
        beside += [
            (f"GP{parts[g]} {letter}{k}", cell)
            for g in range(3, len(parts) - 1, 2)
            for letter, k, cell, _ in ENTRY.findall(parts[g + 1])
        ]
        axes, units = zip(*joints, strict=True)
        program.declare(Target(number, name, axes, units, tuple(beside)))
    elif PLACE.search(group):
        program.tool.setdefault(name.lower(), number)
