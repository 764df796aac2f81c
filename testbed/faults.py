"""Documents and their faults: where a value stands, and all faults of a file in one error."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from os import PathLike
from typing import Any, Protocol, runtime_checkable

from calib.errors import InputError

MOST = 20
"""Faults of one file that are told at once; those after them are counted, not put into words."""

MOST_SHOWN = 1000
"""Characters of the message of one fault."""

KeyPath = tuple[str | int, ...]
"""Keys and list positions that lead to a value of the document."""

Values = dict[KeyPath, Any]
"""The values of a document by where they stand; an empty table is a value too."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: the thing and its value, what was allowed, the likely fix."""

    path: KeyPath
    message: str
    code: str = "S37"
    allowed: str = ""
    fix: str = ""
    value: object = None


class SeveralInputError(InputError):
    """Several faults of one file, a line each; the fields are those of the first."""

    def __init__(self, lines: Sequence[str], first: InputError) -> None:
        self.lines = lines
        super().__init__(**vars(first))

    def __str__(self) -> str:
        return "\n".join(self.lines)


def one_error(faults: Sequence[Fault], where: str) -> InputError:
    """One error that tells all faults, each on its own line."""
    errors = [
        InputError(
            shortened(fault.message), code=fault.code, where=where, value=fault.value,
            field=".".join(map(str, fault.path)), allowed=fault.allowed, fix=fault.fix,
        )
        for fault in faults[:MOST]
    ]  # fmt: skip
    if len(faults) == 1:
        return errors[0]
    lines = [str(error) for error in errors]
    if len(faults) > MOST:
        lines.append(f"{where}: and {len(faults) - MOST} more faults")
    return SeveralInputError(lines, errors[0])


def shortened(text: str) -> str:
    """A text without the middle of what is far too long for a line, such as an endless key."""
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN // 2]} ... {text[-80:]}"


def place(path: KeyPath, document: Mapping[str, Any], tables: Collection[str]) -> str:
    """Where a value stands, in the words of the file: ``[tracker] position_um``.

    `tables` are the names of all tables: ``plan.goal`` is inside another, ``trial[]`` a list whose
    entries are called by their name, or else by their number.
    """
    table: KeyPath = ()
    for name in tables:
        above = path[: name.count(".") + 1 + name.endswith("[]")]
        text = "".join("[]" if isinstance(part, int) else f".{part}" for part in above)
        if text == f".{name}" and len(above) > len(table):
            table = above
    words = f"[{'.'.join(map(str, table))}]" if table else ""
    if table and isinstance(table[-1], int):
        entry: Any = document
        for part in table:
            entry = entry[part]
        title = entry.get("name") if isinstance(entry, Mapping) else None
        shown = f'"{title}"' if isinstance(title, str) else table[-1] + 1  # people count from one
        words = f"[[{'.'.join(map(str, table[:-1]))}]] {shown}"
    key = ""
    for part in path[len(table) :]:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else part
    return f"{words} {key}".strip()


def flat(document: Mapping[str, Any]) -> Values:
    """The values of a document by where they stand."""
    return {
        path: value
        for path, value in nodes(document)
        if not isinstance(value, Mapping) or not value
    }


def nodes(document: Mapping[str, Any], above: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Every value and table of a document."""
    for key, value in document.items():
        yield (*above, key), value
        if isinstance(value, Mapping):
            yield from nodes(value, (*above, key))


def nested(values: Values) -> dict[str, Any]:
    """The document that has these values."""
    document: dict[str, Any] = {}
    for path, value in values.items():
        *tables, key = path
        table = document
        for name in tables:
            table = table.setdefault(str(name), {})
        if value == {}:
            table.setdefault(str(key), {})
        else:
            table[str(key)] = value
    return document


def foreign_values(
    document: Mapping[str, Any], tables: Collection[str]
) -> tuple[list[Fault], dict[str, Any]]:
    """Faults of values that JSON does not have (nan, inf, times), and the document without them.

    Numbers and arrays of numpy, and paths, which scripts hand in, become plain values.
    """
    faults: list[Fault] = []

    def refuse(path: KeyPath, value: object, wanted: str, fix: str) -> None:
        at = place(path, document, tables) if len(faults) < MOST else ""
        message = f"{at} is {value}"
        faults.append(Fault(path, message, "S38", f"it must be {wanted}", fix, value))

    def clean(value: Any, path: KeyPath) -> Any:
        if isinstance(value, Mapping):
            return {str(key): clean(item, (*path, str(key))) for key, item in value.items()}
        if isinstance(value, OfArrays):
            value = value.tolist()
        if isinstance(value, list | tuple):
            return [clean(item, (*path, i)) for i, item in enumerate(value)]
        if isinstance(value, PathLike):
            return str(value)
        if isinstance(value, float) and not math.isfinite(value):
            refuse(path, value, "a finite number", "write an ordinary number")
            return None
        if not isinstance(value, str | bool | int | float | None):
            what = "a date" if isinstance(value, date | time) else type(value).__name__
            refuse(path, value, "a number, text in quotes, true or false", f"it reads as {what}")
            return None
        return value

    return faults, clean(document, ())


@runtime_checkable
class OfArrays(Protocol):
    """An array of numpy, or one of its numbers."""

    def tolist(self) -> object:
        """The same as plain values."""
