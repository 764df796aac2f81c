"""Kinds of arguments: checked where a call enters, refused in a sentence, shown as written."""

import inspect
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache, wraps
from types import UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin
from typing import get_type_hints as hints_of

import numpy as np
from numpy.typing import ArrayLike

from calib.errors import InputError, refuse

P = ParamSpec("P")
T = TypeVar("T")

SEVERAL = (Sequence, Iterable, Collection, list, tuple)
WORDS: Mapping[str, str] = {
    "bool": "True or False",
    "int": "a whole number",
    "float": "a number",
    "str": "a text",
    "Callable": "a function",
    "Chain": "a calib.Chain of the links",
    "Fixtures": "calib.Fixtures",
    "Generator": "a numpy.random.Generator, as numpy.random.default_rng(0) makes one",
    "Identification": "what calib.identify gave; calib.calibrate has it as .identification",
    "Measurements": "calib.Measurements, as calib.poses, calib.points and calib.distances make "
    "them",
    "OperatingConditions": "calib.OperatingConditions",
    "Parameters": "what calib.parameters_of gave",
    "Prior": "a calib.Prior",
    "Problem": "a calib.design.Problem, as its of_poses and of_blocks make one",
    "RobotModel": "a calib.RobotModel; a robot of truebed has it as robot.model",
}
"""What is wanted, by the name of its type; of others the type itself."""


def checked_kinds(function: Callable[P, T]) -> Callable[P, T]:
    """A function that refuses arguments of other kinds than it is annotated with.

    Types, numbers, flags, texts, functions, choices and several of these; `None` where it is one of
    the choices. A whole number may be given as a float, several as any iterable. Arrays are not
    looked at: `calib.arrays.check` knows more of them.

    Examples
    --------
    >>> @checked_kinds
    ... def half(count: int) -> int:
    ...     return count // 2
    >>> half(6.0)
    3
    """
    signature = inspect.signature(function)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        given = signature.bind(*args, **kwargs)
        hints = _hints(function)
        for name, value in given.arguments.items():
            if name in hints:
                given.arguments[name] = of_kind(name, value, hints[name])
        return function(*given.args, **given.kwargs)

    return in_short(checked)


def in_short(function: Callable[P, T]) -> Callable[P, T]:
    """The same function; help() and notebooks show its annotations as they are written here."""
    signature = inspect.signature(function)
    parts = [
        part if part.annotation is part.empty else part.replace(annotation=_Short(part.annotation))
        for part in signature.parameters.values()
    ]
    shown = signature.replace(
        parameters=parts, return_annotation=_Short(signature.return_annotation)
    )
    function.__dict__["__signature__"] = shown
    return function


class _Short:
    """An annotation that is shown as it is written: `ArrayLike | None`, not all that it is."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind

    def __repr__(self) -> str:
        kinds = _written_out(self.kind)
        several = ["ArrayLike"] * ({*kinds} >= ARRAYS)
        several += [_name(kind) for kind in kinds if not several or kind not in ARRAYS]
        return " | ".join(several)


def _name(kind: Any) -> str:
    """One annotation without the rooms where its parts live."""
    if get_origin(kind) is np.ndarray:
        return "ndarray"
    if get_origin(kind) in SEVERAL:
        of = ("..." if part is Ellipsis else repr(_Short(part)) for part in get_args(kind))
        return f"{get_origin(kind).__name__}[{', '.join(of)}]"
    text = kind if isinstance(kind, str) else inspect.formatannotation(kind)
    return "None" if kind is type(None) else re.sub(r"(?:\w+\.)+", "", text)


def check_fields(record: Any) -> None:
    """The same of the fields of a frozen dataclass, where it is made."""
    record_kind: Any = type(record)
    for name, kind in _hints(record_kind).items():
        value = getattr(record, name)
        meant = of_kind(name, value, kind)
        if meant is not value:
            object.__setattr__(record, name, meant)


@cache
def _hints(function: Any) -> dict[str, Any]:
    """Annotations of arguments or fields; not before the first call, when all names are defined."""
    return hints_of(function)


def of_kind(name: str, value: object, kind: Any) -> Any:
    """A value of the annotated kind: as it is, or as it is meant.

    Raises
    ------
    InputError
        A3: it is of another kind.
    """
    several = _written_out(kind)
    if len(several) > 1:
        return value if {*several} >= ARRAYS else _of_one(name, value, several)
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Literal:
        if not any(type(value) is type(one) and value == one for one in parts):
            said = f'"{value}"' if isinstance(value, str) else repr(value)
            raise refuse(name, value, f"one of {', '.join(map(str, parts))}", code="A3",
                         message=f"{name} is {said}")  # fmt: skip
        return value
    if kind is Callable or origin is Callable:
        kind = Callable
        if not callable(value):
            raise _wrong(name, value, WORDS["Callable"])
        return value
    if origin in SEVERAL and parts:
        found = _several(name, value, parts[0])
        exact = origin is tuple and Ellipsis not in parts
        if exact and len(found) != len(parts):
            raise refuse(name, value, f"{len(parts)}", code="A1",
                         message=f"{name} has {len(found)} entries")  # fmt: skip
        return found
    if kind is bool:
        if not isinstance(value, bool | np.bool_):
            raise _wrong(name, value, WORDS["bool"])
    elif kind in (int, float):
        return _number(name, value, whole=kind is int)
    elif isinstance(kind, type) and not isinstance(value, kind):
        raise _wrong(name, value, _words(kind))
    return value


def _written_out(kind: Any) -> tuple[Any, ...]:
    """The kinds that one kind allows; a union with a name is what it stands for."""
    meant = getattr(kind, "__value__", kind) if not isinstance(kind, type) else kind
    if get_origin(meant) not in (Union, UnionType):
        return (kind,)
    return tuple(one for part in get_args(meant) for one in _written_out(part))


ARRAYS = frozenset(_written_out(ArrayLike))


def _of_one(name: str, value: object, kinds: tuple[Any, ...]) -> Any:
    """A value of one of several kinds."""
    if value is None and type(None) in kinds:
        return None
    if isinstance(value, np.ndarray) and any(get_origin(kind) is np.ndarray for kind in kinds):
        return value
    kinds = tuple(kind for kind in kinds if kind is not type(None))
    errors = []
    for kind in kinds:
        try:
            return of_kind(name, value, kind)
        except InputError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    raise _wrong(name, value, ", or ".join(error.allowed for error in errors))


def _several(name: str, value: object, kind: Any) -> tuple[Any, ...]:
    """Several values of a kind; a text is one, not its letters."""
    what = _words(kind) if isinstance(kind, type) else "each of one kind"
    if type(value) is tuple and kind is str and all(type(each) is str for each in value):
        return value  # names of all numbers of a robot pass here several times a fit
    lone = isinstance(value, str) or (isinstance(value, np.ndarray) and value.ndim == 0)
    if lone or not isinstance(value, Iterable):
        fix = f"[{value!r}]" if isinstance(value, str) else ""
        raise _wrong(name, value, f"several, each {what}", fix and f"give a list: {fix}")
    return tuple(of_kind(f"{name}[{k}]", each, kind) for k, each in enumerate(value))


def _number(name: str, value: object, *, whole: bool) -> Any:
    """A real number that is one."""
    wanted = WORDS["int" if whole else "float"]
    array = isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf"
    sound = isinstance(value, int | float | np.integer | np.floating) or array
    if not sound or isinstance(value, bool):
        raise _wrong(name, value, wanted)
    try:
        number = float(value)  # type: ignore[arg-type]  # one of the kinds above
    except OverflowError:
        raise refuse(name, allowed=wanted, code="A3", message=f"{name} is too large") from None
    if np.isnan(number) or (whole and not number.is_integer()):
        raise refuse(name, value, wanted, code="A3")
    return int(value) if whole else value  # type: ignore[call-overload]  # likewise


def _words(kind: type) -> str:
    """What is wanted, in words."""
    return WORDS.get(kind.__name__, f"a {kind.__module__}.{kind.__name__}")


def _wrong(name: str, value: object, allowed: str, fix: str = "") -> InputError:
    """The error for a value of another kind."""
    message = f"{name} is of the type {type(value).__name__}"
    return refuse(name, value, allowed, code="A3", message=message, fix=fix)
