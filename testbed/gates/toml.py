"""TOML into tables and schemas: size, text and depth are seen before anything walks a file."""

import re
import tomllib
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.disk import read_bounded
from testbed.gates.kinds import Kind, require_kind
from testbed.gates.mistakes import Schema, validated
from testbed.gates.paths import near

MOST_BYTES = 1_000_000
MOST_LEVELS = 16
"""Tables in tables and lists in lists; the deepest file that ships has five."""
TOKEN = re.compile(
    # strings and comments are passed over as wholes; an open string ends where tomllib stops
    r'"""(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5}|\Z)'
    r"|'''(?:[^']|'(?!''))*+(?:'{3,5}|\Z)"
    r'|"(?:[^"\\\n]|\\.)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+"
    r"|[\n\[\]{}.,=]",
    re.DOTALL,
)


def read_toml(path: Path, schema: type[Schema], kind: Kind) -> Schema:
    """Read and validate a TOML file.

    Raises
    ------
    InputError
        Says what the file is if it is of another kind, or lists every mistake by table and key; the
        file is named in `where`.
    """
    where = str(path)
    document = toml_document(read_toml_bytes(path, where), where)
    require_kind(document, kind, where)
    return validated(document, schema, where)


def read_toml_bytes(path: Path, where: str) -> bytes:
    """The content of a TOML file, whose size is seen first.

    Raises
    ------
    InputError
        S38: it cannot be read, or is larger than `MOST_BYTES`.
    """
    try:
        return read_bounded(path, MOST_BYTES)
    except FileNotFoundError as error:
        raise _refused(where, "does not exist", fix=near(path)) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        message = f"cannot be read: {getattr(error, 'strerror', None) or 'its name is no path'}"
        raise _refused(where, message, fix="give a TOML file") from error


def toml_document(data: bytes, where: str) -> dict[str, Any]:
    """The tables of a TOML file, which `where` names in errors.

    Raises
    ------
    InputError
        S38: it is too large, no UTF-8, nested too deeply, or no TOML.
    """
    if len(data) > MOST_BYTES:
        allowed = f"a TOML file has at most {MOST_BYTES / 1e6:g} MB"
        raise _refused(where, f"is {len(data) / 1e6:.1f} MB", allowed)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"byte {error.start} is not UTF-8"
        raise _refused(where, message, "TOML is UTF-8 text", "save the file as UTF-8") from error
    levels, line = deepest(text)
    if levels > MOST_LEVELS:
        allowed = f"at most {MOST_LEVELS} levels are allowed"
        fix = "write tables in tables only where a key asks for it"
        raise _refused(f"{where}:{line}", f"is nested {levels} deep", allowed, fix)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        fix = "correct that line; strings need quotes, numbers and true/false do not"
        raise _refused(where, f"is not TOML: {error}", fix=fix) from error
    except ValueError as error:  # int() refuses numbers of thousands of digits
        fix = "write ordinary numbers"
        raise _refused(where, "is not TOML: it holds an endless number", fix=fix) from error


def deepest(text: str) -> tuple[int, int]:
    r"""Levels of the most deeply nested value of a TOML text, and its line, from 1.

    A level is a table or a list, however written: each name of a dotted key or of a [header], each
    opened bracket. No recursion and no parser: tomllib and all that walks its result need memory
    with the square of the depth, or the stack.

    Examples
    --------
    >>> deepest("[a.b]\nc.d = 1")
    (4, 2)
    >>> deepest("a = [[{b = 1.5}]]  # [[[")
    (4, 1)
    """
    most = place = 0
    table = level = names = 0  # levels of the last header, of what stands around, names of the key
    in_key, in_header = True, False
    around: list[tuple[int, bool]] = []  # open brackets: the levels outside, whether it is a table
    for token in TOKEN.finditer(text):
        mark = token[0]
        if mark == "." and in_key:
            names += 1
        elif mark == "=" and in_key:
            level, names, in_key = level + names + 1, 0, False
        elif mark == "[" and in_key:
            level, in_header = (level, in_header) if around else (0, True)
        elif mark == "[":
            around.append((level, False))
            level += 1
        elif mark == "{" and not in_key:
            around.append((level, True))
            in_key = True
        elif mark in ("]", "}") and around:
            (level, _), names, in_key = around.pop(), 0, False
        elif mark == "," and around and around[-1][1]:
            level, names, in_key = around[-1][0], 0, True
        elif mark == "\n" and not around:
            table = names + 1 if in_header else table
            level, names, in_key, in_header = table, 0, True, False
            continue
        if (depth := level + names + in_key) > most:
            most, place = depth, token.start()
    return most, text.count("\n", 0, place) + 1


def _refused(where: str, message: str, allowed: str = "", fix: str = "") -> InputError:
    """The error for a file that does not pass."""
    return refuse("file", None, allowed, code="S38", message=message, fix=fix, where=where)
