"""Strict TOML: the base of schemas, all faults of a file in one error; and tables as TOML."""

import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from difflib import get_close_matches
from os import PathLike
from typing import Annotated, Any, Protocol, get_args, runtime_checkable
from unicodedata import normalize

from pydantic import BaseModel, ConfigDict, Field

from calib.errors import InputError

MOST = 20
"""Faults of one file that are told at once; those after them are counted, not put into words."""
PlainText = Annotated[
    str,
    Field(pattern=r"^[^\x00-\x1f\x7f-\x9f\u{2028}-\u{202e}\u{2066}-\u{2069}\u{fffe}\u{ffff}]*$"),
]
"""One line without control characters, of terminals (C0, C1), lines and the direction of writing:
they never reach a terminal, and XML cannot hold them all."""
LONG = 100
"""Letters of a name beyond which no other one is taken for it: comparing takes their square."""
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


def did_you_mean(word: str, known: Collection[str]) -> str:
    """``did you mean "x"?`` or an empty text; names of hundreds of letters are not compared."""
    near = [name for name in known if max(len(name), len(word)) <= LONG]
    close = get_close_matches(word, near, 1)
    return f'did you mean "{close[0]}"?' if close else ""


def name_meant(word: str, known: Collection[str]) -> str:
    """As `did_you_mean`, also where a name was cut short or written in other letters.

    Examples
    --------
    >>> name_meant("UR10", ["staubli_tx60", "universal_ur10"])
    'did you mean "universal_ur10"?'
    """
    letters = {name: _letters(name) for name in sorted(known) if len(name) <= LONG}
    wanted = _letters(word[: LONG + 1])
    if 2 <= len(wanted) <= LONG:
        for fits in (str.__eq__, str.startswith, str.__contains__):
            for name, own in letters.items():
                if fits(own, wanted):
                    return f'did you mean "{name}"?'
    if hint := did_you_mean(word, known):
        return hint
    parts = {part.lower(): name for name in letters for part in name.split("_") if len(part) > 2}
    close = get_close_matches(word.lower()[:LONG], parts, 1)
    return f'did you mean "{parts[close[0]]}"?' if close else ""


def _letters(name: str) -> str:
    """Letters and digits of a name, small and without marks above them."""
    plain = normalize("NFKD", name).encode("ascii", "ignore").decode()
    return "".join(filter(str.isalnum, plain.lower()))


def choice_of(word: str, known: Collection[str]) -> str:
    """``did you mean "x"?``, or what there is to choose from."""
    return did_you_mean(word, known) or f"there is {some(sorted(known), 60) or 'nothing'}"


def some(names: Sequence[str], most: int = 12) -> str:
    """Names for people: the first ones, and how many more there are."""
    return ", ".join(names[:most]) + f" and {len(names) - most} more" * (len(names) > most)


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


class Strict(BaseModel):
    """Base of file schemas: no unknown keys, no conversions, no nan."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def models_in(annotation: Any) -> list[type[Strict]]:
    """Schemas inside an annotation such as ``tuple[A | B, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, Strict):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models_in(inner)]


def toml_lines(table: Mapping[str, Any], name: str = "") -> list[str]:
    """A table as TOML: its own keys, then the tables in it, then its lists of tables."""
    inner = {k: v for k, v in table.items() if isinstance(v, dict)}
    rows = {k: v for k, v in table.items() if isinstance(v, list) and v and isinstance(v[0], dict)}
    plain = {k: v for k, v in table.items() if k not in inner and k not in rows and v is not None}
    lines = [f"{toml_key(k)} = {toml_value(v)}" for k, v in plain.items()]
    dot = f"{name}." if name else ""
    for key, value in inner.items():
        lines += ["", f"[{dot}{key}]", *toml_lines(value, f"{dot}{key}")]
    for key, values in rows.items():
        for value in values:
            lines += ["", f"[[{dot}{key}]]", *toml_lines(value, f"{dot}{key}")]
    return lines


def toml_key(name: str) -> str:
    """A key as TOML: in quotes where it is not one bare word."""
    bare = name.replace("_", "").replace("-", "").isalnum() and name.isascii()
    return name if bare else toml_value(name)


def toml_value(value: object) -> str:
    """One value as TOML; the strings and numbers of JSON are also TOML's."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
