"""Frozen dataclasses to flat arrays and JSON values and back, bit for bit."""

import dataclasses
import math
import types
import typing
from collections.abc import Iterator, Mapping
from enum import Enum
from functools import cache
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from calib.arrays import LATER, MAY_BE_NAN
from calib.errors import CalibError
from testbed.store.left import Left

T = TypeVar("T")
Packed = dict[str, Any]
"""Dotted path of a field -> array, or a JSON value (text, number, true/false, null, list)."""
ROBOTS = "R"
"""Letter of the axis that counts robots, of which there may be a million."""
LENGTH = "#"
"""``path.#`` holds the length of a tuple whose entries have their own paths."""
SCALARS = (str, bool, int, float)
KINDS = "biufU"
"""Kinds of arrays that have a place on disk: no objects, which would have to be unpickled."""


class Header(NamedTuple):
    """What a file says of an array before it is read."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


def pack(record: object, *, single: bool = False) -> Packed:
    """Flat content of a frozen dataclass; nested fields get dotted names.

    With `single`, figures of each robot (arrays with an axis `ROBOTS`) are rounded to float32.

    Raises
    ------
    CalibError
        A number is not finite: no invented numbers reach the disk. A nan of a field that says so,
        `calib.arrays.FloatOrNan`, is kept as null.
    """
    packed, kind = dict(_pairs(record, "", None)), cast(Any, type(record))
    for path in _of_robots(kind) if single else ():
        packed[path] = _narrow(packed[path])
    return packed


def narrowed(record: T) -> T:
    """The same record, figures of each robot rounded to float32."""
    found = {name: _narrow(getattr(record, name)) for name in _of_robots(cast(Any, type(record)))}
    return cast(T, dataclasses.replace(cast(Any, record), **found)) if found else record


def unpack(cls: type[T], packed: Mapping[str, Any]) -> T:
    """The dataclass `cls` from its flat content; arrays come back read-only.

    Raises
    ------
    ValueError, CalibError
        The content does not fit the class, or a number is not finite; sizes of arrays contradict
        each other or what their fields say (``Annotated[Array, "t", 3]``: a letter is one size in
        all fields of a class).
    """
    return cast(T, _whole(cls, packed, make=True))


def require_fit(cls: type, packed: Mapping[str, Any]) -> None:
    """Refuse content, of which arrays are known by their `Header` only, as `unpack` would.

    Raises
    ------
    ValueError
        It does not fit the class.
    """
    _whole(cls, packed, make=False)


def _whole(cls: type, packed: Mapping[str, Any], *, make: bool) -> object:
    """The record of which nothing is left over; None where it is not made."""
    left = Left(packed)
    record = _build(cls, "", left, make=make)
    if left:
        raise ValueError(f"{min(left)} is not a field of {cls.__name__}")
    return record


def _pairs(value: object, path: str, hint: Any) -> Iterator[tuple[str, Any]]:
    """(path, array or JSON value) of everything below `value`, whose field has the type `hint`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        usual = _usual(type(value))
        for name, kind in _hints(type(value)).items():
            one = getattr(value, name)
            if name not in usual or one is not usual[name]:
                yield from _pairs(one, _join(path, name), kind)
    elif isinstance(value, Enum):
        yield path, value.name
    elif isinstance(value, tuple):
        yield _join(path, LENGTH), len(value)
        for i, item in enumerate(value):
            yield from _pairs(item, _join(path, str(i)), None)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind not in KINDS:
            raise TypeError(f"{path} has dtype {value.dtype}, which has no place on disk")
        _check_finite(value, path)
        yield path, value
    else:
        if isinstance(value, np.generic):
            value = value.item()
        nan = isinstance(value, float) and math.isnan(value)
        if isinstance(value, float) and not (math.isfinite(value) or (nan and _may_be_nan(hint))):
            raise _not_finite(path, value)
        if value is not None and not isinstance(value, SCALARS):
            raise TypeError(f"{path} is a {type(value).__name__}, which has no place on disk")
        yield path, None if nan else value  # JSON has no nan


@cache
def _of_robots(cls: Any) -> tuple[str, ...]:
    """Fields of a record that hold float64 figures of each robot."""
    floats = (np.dtype[np.float64], np.dtype[np.floating])
    return tuple(
        name
        for name, hint in _hints(cls).items()
        if ROBOTS in getattr(hint, "__metadata__", ())
        and any(one in typing.get_args(hint.__origin__) for one in floats)
    )


def _narrow(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Rounded to float32; what is beyond its largest number becomes that one."""
    if array.dtype == np.float32:
        return array
    most = np.finfo(np.float32).max
    narrow: np.ndarray[Any, Any] = np.clip(array, -most, most).astype(np.float32)
    return narrow


def _check_finite(array: np.ndarray[Any, Any], path: str) -> None:
    """Refuse an array that holds a nan or an infinite number."""
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0]
        raise _not_finite(f"{path}{place.tolist()}", array[tuple(place)])


def _may_be_nan(hint: Any) -> bool:
    """Whether the type of a field says that its number may be nan."""
    return MAY_BE_NAN in getattr(hint, "__metadata__", ())


def _not_finite(path: str, value: object) -> CalibError:
    """The error for a number that no record may hold."""
    allowed, fix = "a record holds finite numbers only", "this trial has no usable result"
    message = f"{path} is {value}"
    return CalibError(message, code="D42", field=path, value=value, allowed=allowed, fix=fix)


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


@cache
def _hints(cls: type) -> dict[str, Any]:
    """Resolved types of a dataclass's fields."""
    hints = typing.get_type_hints(cls, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def _build(hint: Any, path: str, left: Left, *, make: bool) -> Any:
    """The value of type `hint` whose content starts with `path`, taken out of what is left.

    Unless it is to be made, a dataclass is None and an array what is known of it.
    """
    may_be_nan, notes = _may_be_nan(hint), getattr(hint, "__metadata__", ())
    if typing.get_origin(hint) is typing.Annotated:
        hint = hint.__origin__
    origin, choices = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if path in left and left[path] is None:
            return left.pop(path)
        (hint,) = [choice for choice in choices if choice is not type(None)]
        return _build(hint, path, left, make=make)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        kinds = _hints(hint)
        later = _later(hint, path, left)
        values = {
            n: later[n] if n in later else _build(kinds[n], _join(path, n), left, make=make)
            for n in kinds
        }
        _check_sizes(hint, values, path)
        return hint(**values) if make else None
    if origin is tuple:
        length = left.pop(_join(path, LENGTH), None)
        if choices[1:] == (Ellipsis,):
            count = _scalar(int, length, f"the length of {path}")
            choices = (choices[0],) * min(count, len(left) + 1)  # no more than there is to take
        if length != len(choices):
            raise ValueError(f"{path} has {length} entries instead of {len(choices)}")
        return tuple(
            _build(kind, _join(path, str(i)), left, make=make) for i, kind in enumerate(choices)
        )
    if path not in left:
        raise ValueError(f"{path} is missing")
    value = left.pop(path)
    if np.ndarray in (hint, origin):
        if not isinstance(value, np.ndarray | Header):
            raise ValueError(f"{path} is not an array")
        wanted, found = np.dtype(typing.get_args(choices[1])[0]), value.dtype
        sizes = (wanted.itemsize, found.itemsize) if wanted.kind != "U" else (0, 0)
        rounded = ROBOTS in notes and found.kind == "f" and sizes == (8, 4)
        if found.kind != wanted.kind or not (sizes[0] == sizes[1] or rounded) or not found.isnative:
            raise ValueError(f"{path} holds {found}, not {wanted}")
        if isinstance(value, np.ndarray) and rounded:
            value = value.astype(wanted)
        if isinstance(value, np.ndarray):
            _check_finite(value, path)
            value.setflags(write=False)
        return value
    if isinstance(hint, type) and issubclass(hint, Enum):
        if not isinstance(value, str) or value not in hint.__members__:
            raise ValueError(f"{path} is {value!r}, not a {hint.__name__}")
        return hint[value]
    if may_be_nan and value is None:
        return math.nan
    return _scalar(str if origin is typing.Literal else hint, value, path)


def _later(cls: type, path: str, left: Left) -> dict[str, Any]:
    """Defaults of the fields that are newer than the record."""
    out = {}
    for name, default in _usual(cls).items():
        start = _join(path, name)
        if start not in left and not left.had(start):
            out[name] = default
    return out


@cache
def _usual(cls: type) -> dict[str, Any]:
    """Defaults of the fields that records need not hold."""
    return {
        field.name: field.default
        for field in dataclasses.fields(cls)
        if LATER in _notes(_hints(cls)[field.name])
    }


def _check_sizes(cls: type, values: Mapping[str, Any], path: str) -> None:
    """Refuse arrays and tuples that contradict their fields or each other."""
    known: dict[str, tuple[int, str]] = {}
    for name, wanted in _sizes(cls).items():
        value = values[name]
        if value is None:
            continue
        shape = (len(value),) if type(value) is tuple else value.shape
        place = _join(path, name)
        if len(shape) != len(wanted):
            raise ValueError(f"{place} has {len(shape)} axes instead of {len(wanted)}")
        for size, one in zip(shape, wanted, strict=True):
            most, where = (one, "its field") if isinstance(one, int) else known.setdefault(
                one, (size, name)
            )  # fmt: skip
            if size != most:
                raise ValueError(f"{place} has shape {shape}; {one} is {most} by {where}")


@cache
def _sizes(cls: type) -> dict[str, tuple[int | str, ...]]:
    """Sizes of the axes of those fields of a dataclass that state them; letters are shared."""
    out = {}
    for name, hint in _hints(cls).items():
        stated = tuple(note for note in _notes(hint) if note is not LATER)
        if stated and MAY_BE_NAN not in stated:
            out[name] = stated
    return out


def _notes(hint: Any) -> tuple[Any, ...]:
    """What the type of a field says besides, of itself or of what it is if it is not None."""
    both = (hint, *(typing.get_args(hint) if not hasattr(hint, "__metadata__") else ()))
    return tuple(note for one in both for note in getattr(one, "__metadata__", ()))


def _scalar(hint: Any, value: object, path: str) -> Any:
    """A number or text of exactly the type `hint`."""
    if hint not in SCALARS:
        raise TypeError(f"{path} has type {hint}, which has no place on disk")
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not hint:
        raise ValueError(f"{path} is {value!r}, not {hint.__name__}")
    if isinstance(value, float) and not math.isfinite(value):
        raise _not_finite(path, value)
    return value
