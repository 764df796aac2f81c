"""Bytes of a text file into lines and cells; sizes are bounded and nothing is ever unpacked."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from calib.errors import InputError

MAX_MB = 100.0
MAX_ROWS = 1_000_000
MAX_LINE = 65_536
"""Bytes."""
SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}
"""In the order in which they are looked for."""
FOREIGN = (
    (b"PK\x03\x04", "an archive or a workbook (zip, npz, xlsx)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"\x80\x02", "a Python pickle"),
    (b"\x80\x03", "a Python pickle"),
    (b"\x80\x04", "a Python pickle"),
    (b"\x80\x05", "a Python pickle"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"MATLAB", "a MATLAB file"),
    (b"\x89HDF", "an HDF5 or MATLAB file"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"%PDF", "a PDF"),
)
"""First bytes of what is no text, and what to call it."""
ARCHIVES = ("archive",)


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file that was read, and its hash."""

    path: Path
    sha256: str


@dataclass(frozen=True, slots=True)
class Text:
    """The lines of a text file."""

    where: str
    """Name for messages."""
    lines: tuple[str, ...]
    encoding: str
    """UTF-8, UTF-8 with BOM, or Latin-1."""
    source: SourceFile


@dataclass(frozen=True, slots=True)
class Sheet:
    """Rows of cells, all as long as the head."""

    where: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    """(m,) line of the file each row stands in, from 1."""
    separator: str
    """One of `SEPARATORS`."""
    encoding: str


def read_text(path: Path, where: str, *, max_mb: float = MAX_MB) -> Text:
    """Lines of a text file, refused unread if it is too large or no text.

    Raises
    ------
    InputError
        M35 it cannot be read, M36 it is too large or packed, S39 it is another program's format.
    """
    data = _bytes(path, where, max_mb)
    for first, name in FOREIGN:
        if data.startswith(first):
            packed = any(word in name for word in ARCHIVES)
            raise InputError(
                f"is {name}",
                code="M36" if packed else "S39",
                where=where,
                field="file",
                value=name,
                allowed="measurements are read from text only, and nothing is unpacked",
                fix="save the table as CSV",
            )
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(
            "is UTF-16 text", code="M35", where=where, field="file", fix="save it as UTF-8"
        )
    if b"\0" in data:
        raise InputError(
            f"is not text: byte {data.index(0)} is zero",
            code="S39",
            where=where,
            field="file",
            fix="save the table as CSV",
        )
    digest = sha256(data).hexdigest()
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    count = data.count(b"\n")
    if count > MAX_ROWS:
        raise InputError(
            f"has {count} lines",
            code="M36",
            where=where,
            field="file",
            allowed=f"at most {MAX_ROWS} rows",
            fix="split it",
        )
    raw = data.split(b"\n")
    longest = max(range(len(raw)), key=lambda k: len(raw[k]))
    if len(raw[longest]) > MAX_LINE:
        raise InputError(
            f"line {longest + 1} has {len(raw[longest])} bytes",
            code="M36",
            where=where,
            field="file",
            allowed=f"at most {MAX_LINE} bytes a line",
            fix="save one measurement a line",
        )
    try:
        text = data.decode("utf-8-sig")
        encoding = "UTF-8 with BOM" if data.startswith(b"\xef\xbb\xbf") else "UTF-8"
    except UnicodeDecodeError:
        text, encoding = data.decode("latin-1"), "Latin-1"
    if not text.strip():
        raise InputError("is empty", code="M35", where=where, field="file", fix="measure something")
    return Text(where, tuple(text.split("\n")), encoding, SourceFile(path, digest))


def _bytes(path: Path, where: str, max_mb: float) -> bytes:
    """Content of an ordinary file that is not too large."""
    try:
        is_file = path.is_file()
        size = path.stat().st_size if is_file else 0
        data = path.read_bytes() if is_file and size <= max_mb * 1e6 else b""
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or "its name is not a path"
        raise InputError(
            f"cannot be read: {reason}", code="M35", where=where, field="file"
        ) from error
    if not is_file:
        told = "is not a file" if path.exists() else "does not exist"
        raise InputError(told, code="M35", where=where, field="file", fix="check the path")
    if size > max_mb * 1e6:
        raise InputError(
            f"is {size / 1e6:.3g} MB",
            code="M36",
            where=where,
            field="file",
            value=size,
            allowed=f"at most {max_mb:g} MB",
            fix="split it, or allow more with --max-mb",
        )
    return data


def read_sheet(text: Text, *, separator: str = "") -> Sheet:
    """Cells of a table whose first line names the columns; lines that begin with # do not count.

    Parameters
    ----------
    text : Text
        From `read_text`.
    separator : str
        One of `SEPARATORS`; found in the first line if empty.

    Raises
    ------
    InputError
        M35: a row is longer or shorter than the head, a name comes twice, a quote stays open.
    """
    kept = [
        (number, line)
        for number, line in enumerate(text.lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not kept:
        raise InputError("has no table", code="M35", where=text.where, field="file")
    found = separator or separator_of(kept[0][1])
    numbers = [number for number, _ in kept]
    cells = split_cells([line for _, line in kept], numbers, found, text.where)
    head = _trimmed(cells[0])
    _check_head(head, text.where)
    rows = [_row(row, len(head)) for row in cells[1:]]
    _check_lengths(rows, numbers[1:], head, found, text.where)
    return Sheet(
        text.where, head, tuple(map(tuple, rows)), tuple(numbers[1:]), found, text.encoding
    )


def separator_of(line: str) -> str:
    """What separates the cells of a line: the first of tab, semicolon and comma it holds."""
    outside = re.sub(r'"[^"]*"', "", line)
    return next((name for name, mark in SEPARATORS.items() if mark in outside), "comma")


def split_cells(
    lines: Sequence[str], numbers: Sequence[int], separator: str, where: str
) -> list[list[str]]:
    """Cells of each line, stripped; quotes as in CSV."""
    if separator == "space":
        return [line.split() for line in lines]
    mark = SEPARATORS[separator]
    if not any('"' in line for line in lines):
        return [[cell.strip() for cell in line.split(mark)] for line in lines]
    for line, number in zip(lines, numbers, strict=True):
        if line.count('"') % 2:
            raise InputError(
                "a quote is not closed in its line",
                code="M35",
                where=f"{where}:{number}",
                field="file",
                fix="close or remove it",
            )
    reader = csv.reader(lines, delimiter=mark, skipinitialspace=True)
    return [[cell.strip() for cell in row] for row in reader]


def _trimmed(cells: Sequence[str]) -> tuple[str, ...]:
    """Cells without the empty ones that a separator at the end of the line leaves."""
    out = list(cells)
    while out and not out[-1]:
        out.pop()
    return tuple(out)


def _row(cells: list[str], width: int) -> list[str]:
    """The row without empty cells beyond the head."""
    return cells[:width] if len(cells) > width and not any(cells[width:]) else cells


def _check_head(head: tuple[str, ...], where: str) -> None:
    """Every column has a name, once."""
    for k, name in enumerate(head):
        if not name or name in head[:k]:
            told = (
                f'two columns are called "{name[:40]}"' if name else f"column {k + 1} has no name"
            )
            raise InputError(told, code="M35", where=where, field="file", fix="name each once")


def _check_lengths(
    rows: Sequence[Sequence[str]],
    numbers: Sequence[int],
    head: Sequence[str],
    separator: str,
    where: str,
) -> None:
    """Every row is as long as the head; a comma that is separator and decimal mark is told."""
    wrong = [k for k, row in enumerate(rows) if len(row) != len(head)]
    if not wrong:
        return
    first = wrong[0]
    told = f"has {len(rows[first])} cells; the first line names {len(head)} columns"
    fix = "mend it"
    if separator == "comma" and len(rows[first]) > len(head):
        told += " (is the comma separator and decimal mark in one?)"
        fix = "save it with ; between the cells, or with a decimal point"
    if len(wrong) > 1:
        told += f", and {len(wrong) - 1} more lines do not fit either"
    raise InputError(
        told,
        code="M35",
        where=f"{where}:{numbers[first]}",
        field="file",
        value=len(rows[first]),
        allowed=f"found: {separator} between cells",
        fix=fix,
    )
