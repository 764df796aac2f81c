"""What names and expressions of a Python program are worth, where its text alone shows it."""

import ast
from dataclasses import dataclass, field
from math import degrees, radians
from typing import TypeAlias

from testbed.files.dialects.controllers.targets import FEWEST

Value: TypeAlias = "float | bool | tuple[Value, ...] | None"
"""A number, a list of such, or None where it is not known before the program runs."""
IN_RADIANS, IN_DEGREES = {"radians", "deg2rad"}, {"degrees", "rad2deg"}
LISTS = {"array", "asarray", "list", "tuple"}
HARMLESS = {"print", "len", "enumerate", "range", *LISTS, *IN_RADIANS, *IN_DEGREES}
"""Functions that leave a list as it is."""
LONGEST, GROWN = 100_000, 5000
"""Most numbers of a range, and most parts of a list that grows one by one."""


@dataclass(slots=True)
class Names:
    """Names of a program and what they are worth, as far as it has been followed."""

    known: dict[str, Value] = field(default_factory=dict)

    def forget(self, *parts: ast.AST) -> None:
        """What is assigned anywhere in some parts of the program is not known."""
        for part in parts:
            for one in ast.walk(part):
                if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store | ast.Del):
                    self.known[one.id] = None
                elif isinstance(one, ast.Subscript) and isinstance(one.ctx, ast.Store | ast.Del):
                    self.known |= dict.fromkeys(names_in(one.value))
                elif isinstance(one, ast.Call) and isinstance(one.func, ast.Attribute):
                    self.known |= dict.fromkeys(names_in(one.func.value))

    def changed_by(self, call: ast.Call) -> None:
        """Follow a list that grows; forget one that any other call may change."""
        match call:
            case ast.Call(
                func=ast.Attribute(value=ast.Name(id=name), attr="append" | "extend" as how),
                args=[one],
            ) if isinstance(old := self.known.get(name), tuple) and len(old) < GROWN:
                more = self.of(one) if how == "extend" else (self.of(one),)
                self.known[name] = (*old, *more) if isinstance(more, tuple) else None
                return
            case ast.Call(func=ast.Attribute(value=ast.Name(id=name))) if name in self.known:
                self.known[name] = None
        if called(call) not in HARMLESS:
            for part in call.args:
                # numbers cannot be changed by a call that they are given to
                for name in names_in(part):
                    if isinstance(self.known.get(name), tuple) and not _joints_only(self, name):
                        self.known[name] = None

    def of(self, node: ast.expr) -> Value:
        """What an expression is worth."""
        match node:
            case ast.Constant(value=bool() as said):
                return said
            case ast.Constant(value=int() | float() as written):
                return float(written)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                number = self.of(inner)
                return -number if isinstance(number, float) else None
            case ast.List(elts=several) | ast.Tuple(elts=several):
                return tuple(self.of(one) for one in several)
            case ast.Name(id=name):
                return self.known.get(name)
            case ast.Subscript(value=inner, slice=place):
                whole, at = self.of(inner), self.of(place)
                found = whole if isinstance(whole, tuple) else ()
                if isinstance(at, float) and -len(found) <= at < len(found):
                    return found[int(at)]
            case ast.Call(args=[inner], keywords=[]):
                return _made(called(node), self.of(inner))
        return None


def _joints_only(names: Names, name: str) -> bool:
    """Whether a name is one list of numbers, which no call of a library changes."""
    return bool(joints_of(names.known[name]))


def names_in(node: ast.AST) -> list[str]:
    """Names in a part of a program."""
    return [one.id for one in ast.walk(node) if isinstance(one, ast.Name)]


def called(call: ast.Call) -> str:
    """The last name of what is called."""
    func = call.func
    return func.attr if isinstance(func, ast.Attribute) else getattr(func, "id", "")


def joints_of(value: Value) -> tuple[float, ...]:
    """Numbers of a list as long as an arm has joints; else none."""
    if not isinstance(value, tuple) or len(value) < FEWEST:
        return ()
    numbers = tuple(one for one in value if isinstance(one, float))
    return numbers if len(numbers) == len(value) else ()


def _made(name: str, value: Value) -> Value:
    """What a function makes of a value; None of an unknown one."""
    if name == "len" and isinstance(value, tuple):
        return float(len(value))
    if name == "range" and isinstance(value, float) and value <= LONGEST:
        return tuple(map(float, range(int(value))))
    if name in LISTS:
        return value
    turn = radians if name in IN_RADIANS else degrees if name in IN_DEGREES else None
    if turn is None or value is None or isinstance(value, bool):
        return None
    return turn(value) if isinstance(value, float) else tuple(_made(name, one) for one in value)
