"""Joint targets of a URScript program: ``movej([0.1, -1.57, ...], a=1.2)``, in radians."""

import re
from math import radians

from testbed.files.dialects.controllers.targets import FEWEST, NUMBER, JointList, Program
from testbed.gates.text import FileText

CELL = re.compile(rf"\s*(?:({NUMBER})|d2r\s*\(\s*({NUMBER})\s*\))\s*")
LIST = re.compile(r"\[([^\[\]]*)\]")
GIVEN = re.compile(r"\s*(?:global\s+|local\s+)?(\w+)(\[[^\]]{0,20}\])?\s*=(?!=)\s*(.*)")
MOVED = re.compile(r"(?:^|[\s;:])(move[jlpc]|servoj|servoc)\s*\((?:\s*(?:q|pose)\s*=)?\s*(.*)")
POSES = re.compile(r"p\s*\[|get_|pose_")


def read_urscript(text: FileText) -> JointList:
    """Joints of the calls of movej, or of the lists that get a name.

    Raises
    ------
    InputError
        M35: a list is computed; what `Program.joints` refuses.
    """
    program = Program(text, "movej([0.1, -1.57, ...])")
    for number, line in program.statements("#"):
        if (move := MOVED.search(line)) is not None:
            _move(program, number, move[1], move[2])
        elif (own := GIVEN.match(line)) is not None:
            name, part, value = own.groups()
            if part is None and value.startswith("["):
                program.assign(number, name, _axes(value), "rad")
            elif part is None and POSES.match(value):
                program.tool.setdefault(name.lower(), number)
            else:
                program.again.setdefault(name.lower(), number)
    return program.joints()


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """A call of movej; the other ones go to a position of the tool."""
    if verb != "movej" or POSES.match(to):
        program.aside.append(number)
    else:
        name = re.match(r"(\w+)\s*[,)]", to)
        program.move(number, verb, name[1] if name else "", _axes(to), "rad")


def _axes(value: str) -> tuple[str, ...]:
    """Joints [rad] of a list of numbers, or of numbers in d2r(); empty where it is another."""
    found = LIST.match(value)
    cells = [CELL.fullmatch(cell) for cell in found[1].split(",")] if found else []
    there = [one for one in cells if one is not None]
    if len(there) < max(FEWEST, len(cells)):
        return ()
    return tuple(one[1] or repr(radians(float(one[2]))) for one in there)
