"""Frozen dataclasses to flat arrays and JSON values and back, bit for bit."""

import dataclasses
import math
import types
import typing
from collections.abc import Iterator, Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar

import numpy as np

from calib.errors import CalibError

T = TypeVar("T")
Packed = dict[str, Any]
"""Dotted path of a field -> array, or a JSON value (text, number, true/false, null, list)."""
LENGTH = "#"
"""``path.#`` holds the length of a tuple whose entries have their own paths."""
SCALARS = (str, bool, int, float)


def pack(record: object) -> Packed:
    """Flat content of a frozen dataclass; nested fields get dotted names.

    Raises
    ------
    CalibError
        A number is infinite, or an array holds a nan: no invented numbers reach the disk. A single
        nan, "does not apply", is kept as null.
    """
    return dict(_pairs(record, ""))


def unpack(cls: type[T], packed: Mapping[str, Any]) -> T:
    """The dataclass `cls` from its flat content; arrays come back read-only.

    Raises
    ------
    ValueError
        The content does not fit the class.
    """
    left = dict(packed)
    record = _build(cls, "", left)
    if left:
        raise ValueError(f"{min(left)} is not a field of {cls.__name__}")
    return typing.cast(T, record)


def _pairs(value: object, path: str) -> Iterator[tuple[str, Any]]:
    """(path, array or JSON value) of everything below `value`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from _pairs(getattr(value, field.name), _join(path, field.name))
    elif isinstance(value, Enum):
        yield path, value.name
    elif isinstance(value, tuple):
        yield _join(path, LENGTH), len(value)
        for i, item in enumerate(value):
            yield from _pairs(item, _join(path, str(i)))
    elif isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufU":
            raise TypeError(f"{path} has dtype {value.dtype}, which has no place on disk")
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            place = np.argwhere(~np.isfinite(value))[0]
            raise _not_finite(f"{path}{place.tolist()}", value[tuple(place)])
        yield path, value
    else:
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, float) and math.isinf(value):
            raise _not_finite(path, value)
        if value is not None and not isinstance(value, SCALARS):
            raise TypeError(f"{path} is a {type(value).__name__}, which has no place on disk")
        # a single number that does not apply; JSON has no nan
        yield path, None if isinstance(value, float) and math.isnan(value) else value


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
    hints = typing.get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def _build(hint: Any, path: str, left: dict[str, Any]) -> Any:
    """The value of type `hint` whose content starts with `path`, taken out of what is left."""
    origin, choices = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if path in left and left[path] is None:
            return left.pop(path)
        (hint,) = [choice for choice in choices if choice is not type(None)]
        return _build(hint, path, left)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        kinds = _hints(hint)
        return hint(**{name: _build(kinds[name], _join(path, name), left) for name in kinds})
    if origin is tuple:
        length = left.pop(_join(path, LENGTH), None)
        if choices[1:] == (Ellipsis,):
            choices = (choices[0],) * _scalar(int, length, f"the length of {path}")
        if length != len(choices):
            raise ValueError(f"{path} has {length} entries instead of {len(choices)}")
        return tuple(_build(kind, _join(path, str(i)), left) for i, kind in enumerate(choices))
    if path not in left:
        raise ValueError(f"{path} is missing")
    value = left.pop(path)
    if np.ndarray in (hint, origin):
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{path} is not an array")
        value.setflags(write=False)
        return value
    if isinstance(hint, type) and issubclass(hint, Enum):
        if not isinstance(value, str) or value not in hint.__members__:
            raise ValueError(f"{path} is {value!r}, not a {hint.__name__}")
        return hint[value]
    return _scalar(str if origin is typing.Literal else hint, value, path)


def _scalar(hint: Any, value: object, path: str) -> Any:
    """A number or text of exactly the type `hint`."""
    if hint not in SCALARS:
        raise TypeError(f"{path} has type {hint}, which has no place on disk")
    if hint is float and value is None:
        return math.nan
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not hint:
        raise ValueError(f"{path} is {value!r}, not {hint.__name__}")
    return value
