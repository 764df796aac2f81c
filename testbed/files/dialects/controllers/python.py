"""Joint targets of a Python program that moves an arm: calls whose unit is that of their library.

``arm.set_servo_angle(angle=[...])`` of xArm is in degrees unless is_radian is True,
``moveJ([...])`` of ur_rtde in radians, ``movej([...])`` of Doosan in degrees. The program is
parsed, never run: lists, loops over them and functions are followed, what else is computed is
refused.
"""

import ast
import re
from dataclasses import dataclass, field

from testbed.files.dialects.controllers.python_values import (
    Names,
    Value,
    called,
    joints_of,
    names_in,
)
from testbed.files.dialects.controllers.targets import JointList, Program, Target
from testbed.files.refusal import refusal
from testbed.gates.kinds import PROGRAMS
from testbed.gates.text import FileText

LIBRARY = re.compile(r"\s*(?:from|import)\s+(\w+)")
XARM, UR, URX, PANDA = ("xarm",), ("rtde_control", "ur_rtde"), ("urx",), ("panda_py",)
DOOSAN = ("DSR_ROBOT", "DSR_ROBOT2", "DRFC", "DRCF", "dsr_msgs", "dsr_msgs2")
OF_DOOSAN = ("pos", "vel", "acc", "time", "radius", "mod")
CALLS = (
    ("set_servo_angle", XARM, "deg",
     ("servo_id", "angle", "speed", "mvacc", "mvtime", "relative", "is_radian")),
    ("set_servo_angle_j", XARM, "deg", ("angles", "speed", "mvacc", "mvtime", "is_radian")),
    ("moveJ", UR, "rad", ("q",)),
    ("movej", URX, "rad", ("joints", "acc", "vel", "wait", "relative")),
    ("move_to_joint_position", PANDA, "rad", ("positions",)),
    ("movej", DOOSAN, "deg", OF_DOOSAN),
    ("amovej", DOOSAN, "deg", OF_DOOSAN),
)  # fmt: skip
"""Calls that go to joints, the libraries that have them, their unit, and their arguments."""
TARGETS = ("angle", "angles", "q", "joints", "positions", "pos")
CARTESIAN = {"set_position", "set_tool_position", "move_circle", "moveL", "moveP", "moveC", "movel",
             "movec", "movep", "movejx", "moveJ_IK", "moveL_FK", "move_to_pose"}  # fmt: skip
STREAMED = {"servoJ", "speedJ", "servoj", "speedj", "movesj", "set_servo_cartesian"}
TAUGHT = "arm.set_servo_angle(angle=[...]), rtde_c.moveJ([...]), or movej([...]) of Doosan"
SOME = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.Lambda, ast.IfExp)
"""Expressions whose parts come once, several times or not at all."""
PLACES, RADIAN = (ast.Name, ast.Subscript, ast.Attribute), "default_is_radian"
FIRST = 40
MOST_MB, MOST_STEPS, DEEPEST = 0.3, 50_000, 20
"""Of a program that is parsed: its size, the statements that are followed, calls in calls."""


def is_python(text: FileText) -> bool:
    """Whether some of the first lines are Python's alone, and of no table."""
    return any(map(PROGRAMS["python"][1].match, text.lines[:FIRST]))


def read_python(text: FileText) -> JointList:
    """Joints of the calls that move an arm.

    Raises
    ------
    InputError
        M35: it is no Python 3, no call of a known library is in it, or joints are computed; M36: it
        is too large.
    """
    if sum(map(len, text.lines)) > MOST_MB * 1e6:
        raise _too_large(text, f"is a program of more than {MOST_MB:g} MB")
    try:
        tree = ast.parse("\n".join(text.lines))
        reader = _Reader(Program(text, TAUGHT), _libraries(text))
        reader.block(tree.body)
        if not reader.program.moves and not reader.program.aside:
            for body in list(reader.functions.values()):  # of a file that only offers them
                reader.block(body.body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = getattr(error, "lineno", None) or 1
        raise refusal(
            f"{text.where}:{line}", "joints", "is no Python 3 that can be followed",
            fix="correct it, or write its joint targets into a table",
        ) from error  # fmt: skip
    if not reader.program.moves and not reader.program.aside:
        raise reader.none()
    return reader.program.joints()


def _libraries(text: FileText) -> set[str]:
    """Names of the modules that a program imports."""
    return {found[1] for line in text.lines if (found := LIBRARY.match(line)) is not None}


def _too_large(text: FileText, message: str) -> Exception:
    """The error of a program that is not followed to its end."""
    fix = "write its joint targets into a table"
    return refusal(text.where, "joints", message, code="M36", fix=fix)


@dataclass(slots=True)
class _Reader:
    """Statements of a program in their order, with the values of names that are known."""

    program: Program
    libraries: set[str]
    names: Names = field(default_factory=Names)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    lists: int = 0
    """Line of the first list that may be of joints."""
    radian: Value = False
    """Whether the arm was opened with is_radian = True."""
    steps: int = 0
    depth: int = 0

    def block(self, body: list[ast.stmt]) -> None:
        """Follow statements."""
        for one in body:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise _too_large(self.program.text, f"takes more than {MOST_STEPS} steps")
            self._statement(one)

    def _statement(self, one: ast.stmt) -> None:
        """One statement; a loop over a list that is known is run through."""
        match one:
            case ast.FunctionDef(name=name):
                self.functions[name] = one
            case ast.With(body=inner):
                self.block(inner)
            case ast.Try(body=inner, handlers=handlers, orelse=other, finalbody=last):
                self.block([*inner, *other])
                self.names.forget(*handlers)
                self.block(last)
            case ast.For():
                self._loop(one)
            case ast.If(test=test, body=inner, orelse=other) if "__name__" in names_in(test):
                self.block([*inner, *other])
            case ast.If() | ast.While() | ast.Match():
                if moves := self._moves_in(one):
                    raise self.program.computed(moves[0].lineno, "a move on a condition")
                self.names.forget(one)
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=value)
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
            ):
                self._calls(value)
                self.names.known[name] = worth = self.names.of(value)
                several = worth if isinstance(worth, tuple) else ()
                if joints_of(worth) or any(map(joints_of, several)):
                    self.lists = self.lists or one.lineno
            case _:
                self._calls(one)
                given = [part for part in ast.walk(one) if isinstance(part, PLACES)
                         and not isinstance(part.ctx, ast.Load)]  # fmt: skip
                self.names.forget(*given)
                if any(isinstance(part, ast.Attribute) and part.attr == RADIAN for part in given):
                    self.radian = None

    def _loop(self, loop: ast.For) -> None:
        """A loop over a list of known values; of another one, the names in it are not known."""
        over, moves = loop.iter, self._moves_in(loop)
        counted = isinstance(over, ast.Call) and called(over) == "enumerate" and len(over.args) == 1
        inner = over.args[0] if counted and isinstance(over, ast.Call) else over
        values, names = self.names.of(inner), names_in(loop.target)
        skips = any(isinstance(one, ast.Continue) for one in ast.walk(loop))
        if moves and (skips or not isinstance(values, tuple)):
            raise self.program.computed(moves[0].lineno, "a move in a loop")
        for k, value in enumerate(values if isinstance(values, tuple) else ()):
            self.names.known |= dict.fromkeys(names)
            if len(names) == 1 + counted:
                self.names.known |= {names[0]: float(k)} if counted else {}
                self.names.known[names[-1]] = value
            self.block(loop.body)
        if not isinstance(values, tuple):
            self.names.forget(loop)
        self.block(loop.orelse)

    def _moves_in(self, part: ast.AST) -> list[ast.Call]:
        """Calls in a part of the program that go to joints, or that run functions with such."""
        calls = [one for one in ast.walk(part) if isinstance(one, ast.Call)]
        return [
            one for one in calls
            if self._known(one) is not None or called(one) in self.functions
            or (called(one) in CARTESIAN | STREAMED and self._has_library())
        ]  # fmt: skip

    def _has_library(self) -> bool:
        """Whether any of the known libraries is imported."""
        return any(self.libraries & set(own) for _, own, _, _ in CALLS) or bool(self.program.moves)

    def _known(self, call: ast.Call) -> tuple[str, tuple[str, ...]] | None:
        """Unit and arguments of a call that goes to joints; None for another one."""
        for name, own, unit, arguments in CALLS:
            # no other library has calls of the names of xArm's
            if name == called(call) and (own == XARM or self.libraries & set(own)):
                return unit, arguments
        return None

    def _calls(self, part: ast.AST) -> None:
        """All calls of a statement."""
        parts = [one for one in ast.walk(part) if isinstance(one, (ast.Call, *SOME))]
        for some in parts:
            if isinstance(some, SOME) and (moves := self._moves_in(some)):
                raise self.program.computed(moves[0].lineno, "a move within an expression")
        for call in [one for one in parts if isinstance(one, ast.Call)]:
            name, words = called(call), {one.arg: one.value for one in call.keywords}
            own = self.functions.get(name)
            if name == "XArmAPI" and "is_radian" in words:
                self.radian = self.names.of(words["is_radian"])
            if (known := self._known(call)) is not None:
                self._move(call, *known)
            elif name in STREAMED and self._has_library():
                raise self.program.computed(call.lineno, name)
            elif name in CARTESIAN and self._has_library():
                self.program.aside.append(call.lineno)
            elif own is not None and isinstance(call.func, ast.Name):
                self._run(own, call)
            else:
                self.names.changed_by(call)

    def _run(self, function: ast.FunctionDef, call: ast.Call) -> None:
        """The body of a function, with the values that it is given."""
        before, self.depth = dict(self.names.known), self.depth + 1
        if self.depth > DEEPEST:
            raise RecursionError
        given = dict(zip([one.arg for one in function.args.args], call.args, strict=False))
        given |= {one.arg: one.value for one in call.keywords if one.arg is not None}
        own = dict.fromkeys(one.arg for one in function.args.args)
        self.names.known |= own | {name: self.names.of(value) for name, value in given.items()}
        self.block(function.body)
        # what it changed of names outside is not followed
        after = self.names.known
        before |= {name: None for name in before if name not in own and after[name] != before[name]}
        self.names.known, self.depth = before, self.depth - 1

    def _move(self, call: ast.Call, unit: str, arguments: tuple[str, ...]) -> None:
        """A call that goes to joints."""
        name, line = called(call), call.lineno
        words: dict[str | None, ast.expr] = dict(zip(arguments, call.args, strict=False))
        words |= {one.arg: one.value for one in call.keywords}
        target = next((words[own] for own in TARGETS if own in words), None)
        worth: Value = self.names.of(target) if target is not None else None
        relative = self.names.of(words["relative"]) if "relative" in words else False
        mode = words.get("mod")
        if relative is not False or (
            mode is not None and names_in(mode)[-1:] != ["DR_MV_MOD_ABS"] and self.names.of(mode)
        ):
            raise self.program.relative(line, name)
        if isinstance(worth, float):
            raise refusal(
                self.program.place(line), "joints", f"{name} moves one joint alone",
                fix=f"write the joints that all of them have then: {TAUGHT}",
            )  # fmt: skip
        if not (joints := joints_of(worth)):
            raise self.program.computed(line, name)
        if "is_radian" in arguments:
            said = self.names.of(words["is_radian"]) if "is_radian" in words else self.radian
            if not isinstance(said, bool):
                raise self.program.computed(line, f"is_radian of {name}")
            unit = "rad" if said else "deg"
        axes = tuple(map(repr, joints))
        self.program.moves.append(Target(line, "", axes, (unit,) * len(axes)))

    def none(self) -> Exception:
        """The error of a program without such a call."""
        if self.lists:
            return refusal(
                self.program.place(self.lists), "joints",
                "has a list of numbers, and nothing says whether they are joints in deg or in rad",
                fix="write them into a table below a line q1_deg, q2_deg ... or q1_rad ...",
            )  # fmt: skip
        return refusal(
            self.program.text.where, "joints", "has no joint target in a call of a known library",
            fix=f"give one that calls {TAUGHT}, or write its joints into a table",
        )  # fmt: skip
