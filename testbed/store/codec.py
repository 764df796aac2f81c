"""Frozen dataclasses to flat arrays and JSON values and back, bit for bit."""

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    used: set[str] = set()

    def take(path: str) -> Any:
        if path not in packed:
            raise ValueError(f"{path} is missing")
        used.add(path)
        return packed[path]

    record = _build(cls, "", take, packed)
    extra = set(packed) - used
    if extra:
        raise ValueError(f"{min(extra)} is not a field of {cls.__name__}")
    return typing.cast(T, record)


def _pairs(value: object, path: str) -> Iterator[tuple[str, Any]]:
    """(path, array or JSON value) of everything below `value`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from _pairs(getattr(value, field.name), _join(path, field.name))
    elif isinstance(value, Enum):
        yield path, value.name
    elif isinstance(value, np.ndarray):
        yield path, _sound_array(value, path)
    elif isinstance(value, tuple):
        yield _join(path, LENGTH), len(value)
        for i, item in enumerate(value):
            yield from _pairs(item, _join(path, str(i)))
    else:
        yield path, _sound_scalar(value, path)


def _sound_array(array: np.ndarray[Any, Any], path: str) -> np.ndarray[Any, Any]:
    """The array, if it holds numbers, truth values or text, all finite."""
    if array.dtype.kind not in "biufU":
        raise TypeError(f"{path} has dtype {array.dtype}, which has no place on disk")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        where = [int(i) for i in np.argwhere(~np.isfinite(array))[0]]
        raise _not_finite(f"{path}{where}", array[tuple(where)])
    return array


def _sound_scalar(value: object, path: str) -> object:
    """A JSON value; numpy scalars become plain numbers, nan becomes null."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        if math.isnan(value):
            return None  # a single number that does not apply; JSON has no nan
        raise _not_finite(path, value)
    if value is None or isinstance(value, SCALARS):
        return value
    raise TypeError(f"{path} is a {type(value).__name__}, which has no place on disk")


def _not_finite(path: str, value: object) -> CalibError:
    return CalibError(
        f"{path} is {value}",
        code="D42",
        field=path,
        value=value,
        allowed="a record holds finite numbers only",
        fix="this trial has no usable result",
    )


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


@cache
def _hints(cls: type) -> dict[str, Any]:
    """Resolved types of a dataclass's fields."""
    hints = typing.get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def _build(hint: Any, path: str, take: Callable[[str], Any], packed: Mapping[str, Any]) -> Any:
    """The value of type `hint` whose content starts with `path`."""
    origin, choices = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if path in packed and packed[path] is None:
            return take(path)
        (hint,) = [choice for choice in choices if choice is not type(None)]
        return _build(hint, path, take, packed)
    if origin is tuple:
        length = _int(take(_join(path, LENGTH)), path)
        kinds = _entry_types(choices, length, path)
        return tuple(
            _build(kind, _join(path, str(i)), take, packed) for i, kind in enumerate(kinds)
        )
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        fields = {
            name: _build(kind, _join(path, name), take, packed)
            for name, kind in _hints(hint).items()
        }
        return hint(**fields)
    value = take(path)
    if hint is np.ndarray or origin is np.ndarray:
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{path} is not an array")
        value.setflags(write=False)
        return value
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _member(hint, value, path)
    if origin is typing.Literal:
        hint = str
    return _scalar(hint, value, path)


def _entry_types(choices: Sequence[Any], length: int, path: str) -> Sequence[Any]:
    """Type of each entry of a tuple of `length`."""
    if len(choices) == 2 and choices[1] is Ellipsis:
        return [choices[0]] * length
    if len(choices) != length:
        raise ValueError(f"{path} has {length} entries instead of {len(choices)}")
    return choices


def _int(value: object, path: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"the length of {path} is {value!r}")
    return value


def _member(hint: type[Enum], value: object, path: str) -> Enum:
    if not isinstance(value, str) or value not in hint.__members__:
        raise ValueError(f"{path} is {value!r}, not a {hint.__name__}")
    return hint[value]


def _scalar(hint: Any, value: object, path: str) -> object:
    """A number or text of exactly the type `hint`."""
    if hint not in SCALARS:
        raise TypeError(f"{path} has type {hint}, which has no place on disk")
    if hint is float and value is None:
        return math.nan
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not hint:
        raise ValueError(f"{path} is {value!r}, not {hint.__name__}")
    return value
