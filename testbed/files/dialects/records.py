"""Records of JSON as a table: an object for each row, or a list for each column."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from testbed.files.dialects.numbers import NUMBER
from testbed.files.refusal import refusal
from testbed.gates.text import MAX_ROWS, FileText, SourceFile, bytes_of
from testbed.units import counted, listed

Rows = list[dict[str, Any]]
ENDINGS = (".json", ".jsonl", ".ndjson")
ALLOWED = "one object for each measurement, or a list for each column, all as long"
MOST_COLUMNS = 1000
DEEPEST = 8
"""Levels of objects in objects."""
SHOWN = 4
"""Largest number of lists that are named."""


class _SeveralError(Exception):
    """There are several tables, or values of one name, and nothing says which one is meant.

    Its arguments are the message and the fix.
    """


def read_records(path: Path, where: str, *, max_mb: float) -> FileText:
    """Lines of a table: the names, then one line a record; line k + 2 is record k, from 0.

    Objects in a record become columns called by both names; lists of numbers are cells. A list of
    objects in each record, as of the readings at a pose, has a line for each of them.

    Raises
    ------
    InputError
        M35: it cannot be read, or is no table; M36: it is too large; S39: it is no JSON.
    """
    data = bytes_of(path, where, max_mb)
    try:
        rows = _opened(_rows(_parsed(data.decode("utf-8-sig"))))
    except _SeveralError as error:
        message, fix = error.args
        raise refusal(where, "file", message, fix=fix) from error
    except (ValueError, RecursionError) as error:
        reason = str(error)[:80] if isinstance(error, json.JSONDecodeError) else "it is damaged"
        message = f"is no JSON: {reason}"
        raise refusal(where, "file", message, code="S39", fix="write it again") from error
    if not rows:
        raise refusal(where, "file", "holds no records that make a table", allowed=ALLOWED,
                      fix="write one such list, or give a CSV")  # fmt: skip
    try:
        flat = [dict(_flat(row, "")) for row in rows]
    except ValueError as error:
        raise refusal(where, "file", str(error), allowed=ALLOWED, fix="give a CSV") from error
    head = list(dict.fromkeys(name for row in flat for name in row))
    if len(head) > MOST_COLUMNS or len(flat) > MAX_ROWS:
        message = f"has {counted(len(flat), 'record')} of {counted(len(head), 'column')}"
        allowed = f"at most {MAX_ROWS} of {MOST_COLUMNS}"
        raise refusal(where, "file", message, code="M36", allowed=allowed, fix="split it")
    lines = [] if all(name.isdigit() for name in head) else [_line(head)]
    lines += [_line([row.get(name, "") for name in head]) for row in flat]
    return FileText(where, tuple(lines), "JSON", SourceFile(path, sha256(data).hexdigest()))


def _parsed(text: str) -> Any:
    """The document, or the list of those that stand one a line."""
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) > 1 and all(line.lstrip()[0] + line.rstrip()[-1] == "{}" for line in lines):
        return [json.loads(line, object_pairs_hook=_object) for line in lines]
    return json.loads(text, object_pairs_hook=_object)


def _object(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """An object of JSON whose names differ."""
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        message = f'holds two values called "{twice[:40]}" in one object'
        raise _SeveralError(message, "name each once")
    return found


def _rows(found: Any) -> Rows:
    """Records of a document: of the tables in it, that with most numbers; none if there is none."""
    tables = _tables(found, "")
    rows = max((one for _, one in tables), key=_numbers_in, default=[])
    alike = [name for name, one in tables if one[0].keys() == rows[0].keys()]
    if len(alike) > 1:
        message = f"holds several tables with the same names: {listed(alike[:SHOWN])}"
        fix = "give each a file of its own, or join those of one session to one list"
        raise _SeveralError(message, fix)
    return rows


def _is_place(row: Mapping[str, Any]) -> bool:
    """Whether a record has three coordinates, by their names or as a list of three numbers."""
    if {name.casefold()[:1] for name in row if not isinstance(row[name], (dict, list))} >= {*"xyz"}:
        return True
    return any(_is_place(one) if isinstance(one, dict) else _is_three(one) for one in row.values())


def _is_three(value: object) -> bool:
    """Whether a value is a list of three numbers."""
    return (
        isinstance(value, list) and len(value) == 3
        and all(isinstance(one, (int, float)) for one in value)
    )  # fmt: skip


def _opened(rows: Rows) -> Rows:
    """The same with a record for each reading in the only list of objects that all records have.

    Not where a record has a place of its own: what is listed beside it tells something else.
    """
    inside = [
        name for name in (rows[0] if rows else ())
        if all(isinstance(row.get(name), list) and row[name]
               and all(isinstance(one, dict) for one in row[name]) for row in rows)
    ]  # fmt: skip
    if len(inside) != 1:
        return rows
    name = inside[0]
    if any(map(_is_place, rows)) or not all(_is_place(one) for row in rows for one in row[name]):
        return rows
    return [row | {name: one} for row in rows for one in row[name]]


def _tables(found: Any, name: str) -> list[tuple[str, Rows]]:
    """All tables in a document, by the name of each."""
    if isinstance(found, list):
        if found and all(isinstance(one, dict) for one in found):
            return [(name, found)]
        if found and all(isinstance(one, list) for one in found):
            return [(name, [{str(k + 1): value for k, value in enumerate(one)} for one in found])]
        return []
    if not isinstance(found, dict):
        return []
    columns = {own: one for own, one in found.items() if isinstance(one, list)}
    records = [(own, one) for own, one in columns.items()
               if one and all(isinstance(r, dict) for r in one)]  # fmt: skip
    if records:
        return records
    if len(found) > 1 and all(isinstance(one, dict) for one in found.values()):
        if all(map(_holds_tables, found.values())):
            return [(f"{own} {inner}".strip(), one) for own, each in found.items()
                    for inner, one in _tables(each, "")]  # fmt: skip
        if len({frozenset(one) for one in found.values()}) == 1:
            return [(name, [{"pose_id": own} | one for own, one in found.items()])]
    elif len(columns) > 1 and len(counts := {len(one) for one in columns.values()}) == 1:
        rows = [{own: one[k] for own, one in columns.items()} for k in range(counts.pop())]
        return [(name, rows)] if rows else []
    return [table for own, one in found.items() if isinstance(one, dict)
            for table in _tables(one, own)]  # fmt: skip


def _holds_tables(found: Any) -> bool:
    """Whether part of a document has lists of objects somewhere, and no number beside them."""
    if isinstance(found, dict):
        return bool(found) and all(map(_holds_tables, found.values()))
    return isinstance(found, list) and bool(found) and all(isinstance(one, dict) for one in found)


def _numbers_in(value: Any) -> int:
    """How many numbers a part of a document holds."""
    if isinstance(value, dict | list):
        return sum(map(_numbers_in, value.values() if isinstance(value, dict) else value))
    return int(isinstance(value, int | float))


def _flat(value: Any, name: str, depth: int = 0) -> Sequence[tuple[str, str]]:
    """Cells of a record, by the names on the way to them."""
    if isinstance(value, Mapping):
        if depth > DEEPEST:
            raise ValueError(f"has objects in more than {DEEPEST} others")
        inner = {f"{name}.{key}" if name else str(key): one for key, one in value.items()}
        return [cell for key, one in inner.items() for cell in _flat(one, key, depth + 1)]
    if isinstance(value, list):
        return [(name, json.dumps(value))]
    return [(name, "" if value is None else str(value))]


def _line(cells: Sequence[str]) -> str:
    """A line of CSV, with quotes around all but numbers: it may begin as a comment does."""
    plain = (" ".join(cell.split()).replace('"', '""') for cell in cells)
    return ",".join(
        cell if NUMBER.fullmatch(cell) and "," not in cell else f'"{cell}"' for cell in plain
    )


def is_records(path: Path) -> bool:
    """Whether a file is JSON, by the ending of its name."""
    return path.suffix.lower() in ENDINGS
