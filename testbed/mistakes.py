"""Faults of a scenario document, and the one error that tells them all."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from calib.errors import InputError

MOST = 20
"""Faults of one file that are told at once."""
Path = tuple[str | int, ...]
"""Keys and list positions that lead to a value of the document."""
NESTED = (
    ("identification", "prior", "sd_deg"),
    ("identification", "prior", "sd_mm"),
    ("identification", "prior"),
    ("plan", "stations", "grid"),
    ("plan", "stations"),
    ("plan", "goal"),
)
"""Tables inside tables, inner ones first."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: the thing and its value, what was allowed, the likely fix."""

    path: Path
    message: str
    code: str = "S37"
    allowed: str = ""
    fix: str = ""
    value: object = None


class SeveralInputError(InputError):
    """Several faults of one file, a line each; the fields are those of the first."""

    def __init__(self, told: str, first: InputError) -> None:
        self.told = told
        super().__init__(
            first.message,
            code=first.code,
            where=first.where,
            field=first.field,
            value=first.value,
            allowed=first.allowed,
            fix=first.fix,
        )

    def __str__(self) -> str:
        return self.told


def one_error(faults: Sequence[Fault], where: str) -> InputError:
    """One error that tells all faults, each on its own line."""
    errors = [
        InputError(
            fault.message,
            code=fault.code,
            where=where,
            field=".".join(str(part) for part in fault.path),
            value=fault.value,
            allowed=fault.allowed,
            fix=fault.fix,
        )
        for fault in faults
    ]
    if len(errors) == 1:
        return errors[0]
    lines = [str(error) for error in errors[:MOST]]
    if len(errors) > MOST:
        lines.append(f"{where}: and {len(errors) - MOST} more faults")
    return SeveralInputError("\n".join(lines), errors[0])


def did_you_mean(word: str, known: Collection[str]) -> str:
    """``did you mean "x"?`` or an empty text."""
    close = get_close_matches(word, list(known), 1)
    return f'did you mean "{close[0]}"?' if close else ""


def place(path: Path, document: Mapping[str, Any], tables: Collection[str]) -> str:
    """Where a value stands, in the words of the file: ``[tracker] position_um``."""
    parts, words = list(path), ""
    if parts[0] == "trial" and len(parts) > 1:
        try:
            name = document["trial"][parts[1]]["name"]
        except (KeyError, TypeError, IndexError):
            name = None
        words = f'[[trial]] "{name}"' if isinstance(name, str) else f"[[trial]] {_count(parts[1])}"
        parts = parts[2:]
    elif tuple(parts[:2]) == ("cell", "obstacle") and len(parts) > 2:
        words, parts = f"[[cell.obstacle]] {_count(parts[2])}", parts[3:]
    elif nested := next((name for name in NESTED if tuple(parts[: len(name)]) == name), ()):
        words, parts = f"[{'.'.join(nested)}]", parts[len(nested) :]
    elif parts[0] in tables:
        words, parts = f"[{parts[0]}]", parts[1:]
    key = ""
    for part in parts:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else part
    return f"{words} {key}".strip()


def _count(position: str | int) -> str | int:
    """A list position as people count."""
    return position + 1 if isinstance(position, int) else position


def foreign_values(
    document: Mapping[str, Any], tables: Collection[str]
) -> tuple[list[Fault], dict[str, Any]]:
    """Faults of values that JSON does not have (nan, inf, times), and the document without them."""
    faults: list[Fault] = []

    def refuse(path: Path, value: object, wanted: str, fix: str) -> None:
        message = f"{place(path, document, tables)} is {value}"
        faults.append(Fault(path, message, "S38", f"it must be {wanted}", fix, value))

    def clean(value: Any, path: Path) -> Any:
        if isinstance(value, Mapping):
            return {str(key): clean(item, (*path, str(key))) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [clean(item, (*path, i)) for i, item in enumerate(value)]
        if isinstance(value, float) and not math.isfinite(value):
            refuse(path, value, "a finite number", "write an ordinary number")
            return None
        if not isinstance(value, str | bool | int | float | None):
            refuse(path, value, "a number, text in quotes, true or false", "it reads as a date")
            return None
        return value

    return faults, clean(document, ())
