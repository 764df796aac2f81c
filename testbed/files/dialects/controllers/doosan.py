"""Joint targets of a DRL program (Doosan): ``movej(posj(0, -10, ...), v=30, a=30)``, in degrees."""

import re
from dataclasses import replace

from testbed.files.dialects.controllers.targets import JointList, Program, axes_of
from testbed.files.refusal import refusal
from testbed.gates.text import FileText

JOINTS = re.compile(r"(?:posj\s*\(\s*)?\[([^\[\]()]*)\]\s*\)?|posj\s*\(([^\[\]()]*)\)")
GIVEN = re.compile(r"\s*(?:global\s+)?(\w+)(\[[^\]]{0,20}\])?\s*=(?!=)\s*(.*)")
MOVED = re.compile(r"(?:^|[\s;:])(a?move\w{1,2}|servo[jl])\s*\((?:\s*pos\s*=)?\s*(.*)")
TO_JOINTS = ("movej", "amovej")
POSES = re.compile(r"posx\s*\(|get_|trans\s*\(|fkin\s*\(")
BY_DIFFERENCE = re.compile(r"DR_MV_MOD_REL|\bmod\s*=\s*1\b")
QUOTED = re.compile(r"""('''|\"{3}).*?(\1|\Z)|'[^'\n]*'|"[^"\n]*"|#[^\n]*""", re.DOTALL)
"""Text between quotes, over several lines where these are three, and comments."""
MODE = 4
"""Position after the target of the argument for the mode, in a call without argument names."""
TAUGHT = "movej(posj(0, -10, 80, 0, 90, 0), v=30, a=30)"


def is_doosan(text: FileText) -> bool:
    """Whether some line of a text has joints in the notation of this language alone."""
    return any(re.search(r"\bposj\s*\(", line) for line in text.lines)


def read_doosan(text: FileText) -> JointList:
    """Joints of the calls of movej, or of named targets.

    Raises
    ------
    InputError
        M35: joints are computed, a move is relative, or a block of comment has no end; or as
        `Program.joints`.
    """
    program = Program(_unquoted(text), TAUGHT)
    for number, line in program.statements("#"):
        if (move := MOVED.search(line)) is not None:
            _move(program, number, move[1], move[2])
        elif (own := GIVEN.match(line)) is not None:
            name, part, value = own.groups()
            if part is None and POSES.match(value):
                program.tool.setdefault(name.lower(), number)
            else:
                program.assign(number, name, _axes(value) if part is None else ())
    return program.joints()


def _unquoted(text: FileText) -> FileText:
    """A program on the same lines, without comments and what it has between quotes."""
    whole = "\n".join(text.lines)
    for block in QUOTED.finditer(whole):
        if block[1] and not block[2]:
            line = whole.count("\n", 0, block.start()) + 1
            raise refusal(
                f"{text.where}:{line}", "joints",
                f"a block that begins with {block[1]} has no end",
                fix=f"close it with {block[1]}",
            )  # fmt: skip
    bare = QUOTED.sub(lambda quoted: "\n" * quoted[0].count("\n"), whole)
    return replace(text, lines=tuple(bare.split("\n")))


def _move(program: Program, number: int, verb: str, to: str) -> None:
    """A call of movej; the other ones go to a position of the tool, or through several joints."""
    name, listed = re.match(r"(\w+)\s*(?=[,)])", to), JOINTS.match(to)
    target = name or listed
    beside = to[target.end() :].strip(" ,)").split(",") if target is not None else []
    if verb not in TO_JOINTS or POSES.match(to):
        program.aside.append(number)
    elif BY_DIFFERENCE.search(to) or [one.strip() for one in beside[MODE : MODE + 1]] == ["1"]:
        raise program.relative(number, verb)
    else:
        program.move(number, verb, name[1] if name else "", _axes(to))


def _axes(value: str) -> tuple[str, ...]:
    """Joints [deg] of posj(...), or of a list of numbers; empty where it is another."""
    found = JOINTS.match(value)
    if found is None or re.match(r"\s*[-+*/]", value[found.end() :]):
        return ()
    return axes_of(found[1] or found[2])
