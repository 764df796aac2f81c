"""Joint targets of an AS program (Kawasaki): ``JMOVE #p1``, and ``#p1 0 -10 ...`` below .JOINTS."""

import re

from testbed.files.dialects.controllers.targets import NUMBER, JointList, Program, Target, axes_of
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

NAME = r"[A-Za-z]\w*(?:\[[^\]]{0,20}\])?"
NAMED = re.compile(rf"#({NAME})\s*(?:,.*)?")
LISTED = re.compile(rf"\s*#({NAME})((?:\s+{NUMBER}){{4,20}})\s*$")
PLACE = re.compile(rf"\s*({NAME})(?:\s+{NUMBER}){{6,20}}\s*$")
SECTION = re.compile(r"\s*\.([A-Z]+)\b", re.IGNORECASE)
PARTS = ("PROGRAM", "JOINTS", "TRANS")
POINT = re.compile(rf"\s*(?:POINT|HERE)\s+#({NAME})\s*(?:=\s*(.*))?$", re.IGNORECASE)
JOINTS = re.compile(r"\s*#PPOINT\s*\(([^()]*)\)\s*(?:,.*)?$", re.IGNORECASE)
MOVED = re.compile(
    r"\s*(?:\d{1,6}\s+)?([JLHX]MOVE|C[12]MOVE|[JL]APPRO|[JL]DEPART|T?DRAW|DRIVE|HOME2?)\b(.*)",
    re.IGNORECASE,
)
TO_JOINTS = ("JMOVE", "LMOVE", "HMOVE")
TAUGHT = "#p1 0 -10 80 0 90 0 below .JOINTS"


def is_kawasaki(text: FileText) -> bool:
    """Whether a text has parts that this language names, or lists joints in each of its lines."""
    lines = [line for _, line in text.content(";")]
    named = any((part := SECTION.match(line)) and part[1].upper() in PARTS for line in lines)
    return named or (bool(lines) and all(map(LISTED.match, lines)))


def read_kawasaki(text: FileText) -> JointList:
    """Joints of the moves of a program, or of all that it lists.

    Raises
    ------
    InputError
        M35: joints are computed; what `Program.joints` refuses.
    """
    program, moves, section = Program(text, TAUGHT), list[tuple[int, str, str]](), ""
    for number, line in program.statements(";"):
        if (listed := LISTED.match(line)) is not None:
            program.declare(Target(number, listed[1], tuple(re.findall(NUMBER, listed[2]))))
        elif (begun := SECTION.match(line)) is not None:
            section = begun[1].upper()
        elif (own := POINT.match(line)) is not None:
            program.assign(number, own[1], _axes(own[2] or ""))
        elif (move := MOVED.match(line)) is not None:
            if move[1].upper() in TO_JOINTS and move[2].lstrip().startswith("#"):
                moves.append((number, move[1].upper(), move[2].strip()))
            else:
                program.aside.append(number)
        elif section == "JOINTS" and line.lstrip().startswith("#"):
            raise refusal(
                program.place(number), "joints",
                f"{line.split()[0][:40]} is not followed by numbers with spaces between them",
                allowed=TAUGHT, fix="write the joints so, with decimal points",
            )  # fmt: skip
        elif section == "TRANS" and (place := PLACE.match(line)) is not None:
            program.tool.setdefault(place[1].lower(), number)
    for number, verb, to in moves:  # joints are listed behind the program
        name = NAMED.fullmatch(to)
        program.move(number, verb, name[1] if name else "", _axes(to))
    return program.joints()


def _axes(value: str) -> tuple[str, ...]:
    """Joints [deg] of #PPOINT(...); empty where it is another, or not all are numbers."""
    found = JOINTS.match(value)
    return axes_of(found[1]) if found is not None else ()
