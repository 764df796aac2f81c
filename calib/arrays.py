"""Border checks: shape and finiteness, once, where arrays enter; inside they are trusted."""

from functools import lru_cache
from numbers import Real
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from calib.errors import InputError, refuse

# written out: numpy.typing.NDArray hides its parts from whoever reads a hint, from numpy 2.5 on
Array = np.ndarray[tuple[Any, ...], np.dtype[np.float64]]
Bool = np.ndarray[tuple[Any, ...], np.dtype[np.bool_]]
Index = np.ndarray[tuple[Any, ...], np.dtype[np.int64]]
Labels = np.ndarray[tuple[Any, ...], np.dtype[np.str_]]
AnyArray = np.ndarray[tuple[Any, ...], np.dtype[Any]]
LARGEST = 2.0**53
"""Up to here every whole number is a float64."""
MAY_BE_NAN = "nan where it does not apply"
LATER = "newer than some records, where its default stands for it"
"""Said of a field that records written before it existed do not hold."""
FloatOrNan = Annotated[float, MAY_BE_NAN]
"""Type of the field of a result that may be nan; all others are finite, or no result."""


def frozen(values: ArrayLike, dtype: Any = np.float64) -> AnyArray:
    """Read-only C-ordered copy, or the same array if it is one whose memory nobody can write."""
    _require_whole("values", values)
    array = np.asarray(values, dtype=dtype)
    if not array.flags.c_contiguous or _writable(array):
        array = np.array(array, dtype=dtype, order="C")
        array.setflags(write=False)
    return array


def _require_whole(name: str, values: object) -> None:
    """Refuse arrays of which numpy would silently take a part: behind a mask, or the real one."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise refuse(
            name, code="A1", message=f"{name} has masked entries",
            allowed="every entry must be a number", fix="leave these rows out",
        )  # fmt: skip
    if isinstance(values, np.ndarray) and values.dtype.kind == "c":
        message, allowed = f"{name} is complex", "every entry must be a real number"
        raise refuse(name, code="A1", message=message, allowed=allowed, fix="take its real part")


def _writable(array: AnyArray) -> bool:
    """Whether an array, or the memory of another one that it shows, can be written."""
    shown: Any = array
    while isinstance(shown, np.ndarray):
        if shown.flags.writeable:
            return True
        shown = shown.base
    if shown is None:
        return False
    try:
        return not memoryview(shown).readonly
    except TypeError:
        return True


def check(spec: str, **arrays: ArrayLike) -> tuple[Array, ...]:
    """Turn inputs into read-only float64 arrays of the shapes named in `spec`.

    Parameters
    ----------
    spec : str
        One shape per keyword, in order, separated by commas; letters bind across arrays, digits are
        literal: ``"m n, m 3"``.
    **arrays : array_like
        The arrays under their public names.

    Raises
    ------
    InputError
        Names the array, the place of the first offending element and what was expected.

    Examples
    --------
    >>> q, p = check("m n, m 3", q=[[0, 1]], p=[[1, 2, 3]])
    >>> q.shape, p.flags.writeable
    ((1, 2), False)
    """
    sizes: dict[str, int] = {}
    checked = []
    for wanted, (name, value) in zip(_shapes(spec), arrays.items(), strict=True):
        array = require_numbers(name, value)
        if array.ndim != len(wanted):
            raise wrong_shape(name, array.shape, f"expected ({', '.join(wanted)})")
        for axis, (size, letter) in enumerate(zip(array.shape, wanted, strict=True)):
            expected = int(letter) if letter.isdigit() else sizes.setdefault(letter, size)
            if size != expected:
                which = f"axis {axis}" if letter.isdigit() else f"axis {axis} ({letter})"
                allowed = f"{which} should be {expected}"
                raise wrong_shape(name, array.shape, allowed)
        require_finite(name, array)
        checked.append(array)
    return tuple(checked)


def whole_numbers(name: str, values: ArrayLike) -> Index:
    """Read-only array of whole numbers; 1.5, nan and words are refused, never cut off.

    Raises
    ------
    InputError
        A1: not all are numbers; A3: one is not whole.
    """
    _require_whole(name, values)
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.empty(1, dtype=object)
    if array.dtype.kind not in "biuf" and array.size:
        message, allowed = f"{name} is not an array of whole numbers", "whole numbers, from 0"
        raise refuse(name, code="A1", message=message, allowed=allowed, fix="number them")
    if array.dtype.kind == "f":
        whole = np.isfinite(array) & (np.floor(array) == array) & (np.abs(array) < LARGEST)
        if not whole.all():
            where = tuple(int(i) for i in np.argwhere(~whole)[0])
            message = f"{name}{list(where) if where else ''} is {array[where]}"
            raise refuse(
                name, float(array[where]), "every value must be a whole number", code="A3",
                message=message,
            )  # fmt: skip
    return frozen(values, np.int64)


def require_numbers(name: str, value: ArrayLike) -> Array:
    """A read-only float64 array of any shape, after refusing what holds no numbers."""
    _require_whole(name, value)
    try:
        return frozen(value)
    except (TypeError, ValueError, OverflowError) as error:
        message = f"{name} is not an array of numbers"
        raise refuse(name, code="A1", message=message) from error


@lru_cache(maxsize=1024)
def _shapes(spec: str) -> tuple[tuple[str, ...], ...]:
    """Sizes and letters of each shape in a specification."""
    return tuple(tuple(shape.split()) for shape in spec.split(","))


def require_finite(name: str, array: Array) -> None:
    """Refuse nan and inf, by the place of the first."""
    finite = np.isfinite(array)
    if not np.logical_and.reduce(finite, axis=None):
        where = tuple(int(i) for i in np.argwhere(~finite)[0])
        message = f"{name}{list(where) if where else ''} is {array[where]}"
        value, allowed = float(array[where]), "every value must be finite"
        raise refuse(name, value, allowed, code="A2", message=message)


def wrong_shape(name: str, shape: tuple[int, ...], allowed: str) -> InputError:
    """The error for an array of another shape than allowed."""
    return refuse(name, shape, allowed, code="A1", message=f"{name} has shape {shape}")


def require_kind(name: str, value: object, kind: type, allowed: str, fix: str = "") -> None:
    """Refuse a value of another type than wanted, where Python would only miss an attribute."""
    if not isinstance(value, kind):
        message = f"{name} is of the type {type(value).__name__}"
        raise refuse(name, value, allowed, code="A3", message=message, fix=fix)


def require_count(name: str, value: Any, least: int = 1, *, code: str = "A3") -> int:
    """The value as an int, if it is a whole number and no smaller than `least`."""
    if not is_whole(value) or value < least:
        raise refuse(name, value, f"a whole number, at least {least}", code=code)
    return int(value)


def evenly(places: Index, most: int) -> Index:
    """At most `most` of these places, evenly spread, the first and the last among them."""
    return places[np.linspace(0, len(places) - 1, min(len(places), most)).round().astype(np.int64)]


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number: 3 and 3.0 are; true, "3" and [3] are not."""
    return isinstance(value, Real) and not isinstance(value, bool) and bool(value % 1 == 0)


def require_probability(probability: float, code: str = "A3") -> float:
    """The probability, if it lies strictly between 0 and 1."""
    if not 0 < probability < 1:
        raise refuse("probability", probability, "between 0 and 1, e.g. 0.95", code=code)
    return probability
