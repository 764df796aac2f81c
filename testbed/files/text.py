"""Bytes of a text file into lines and cells; sizes are bounded and nothing is ever unpacked."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from testbed.files.refusal import refusal
from testbed.report.text import unguarded

MAX_MB = 100.0
MAX_ROWS = 1_000_000
MAX_LINE = 65_536
"""Bytes."""
NUMBER = re.compile(r"[+-]?\d[\d.,]*([eE][+-]?\d+)?")
SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}
"""In the order in which they are looked for."""
FOREIGN = (
    (b"PK\x03\x04", "an archive or a workbook (zip, npz, xlsx)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    *((bytes((0x80, protocol)), "a Python pickle") for protocol in (2, 3, 4, 5)),
    (b"\x93NUMPY", "a NumPy array"),
    (b"MATLAB", "a MATLAB file"),
    (b"\x89HDF", "an HDF5 or MATLAB file"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"%PDF", "a PDF"),
)
"""First bytes of what is no text, and what to call it."""


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file that was read, and its hash."""

    path: Path
    sha256: str


@dataclass(frozen=True, slots=True)
class FileText:
    """The lines of a text file."""

    where: str
    """Name for messages."""
    lines: tuple[str, ...]
    encoding: str
    """UTF-8, UTF-8 with BOM, or Latin-1."""
    source: SourceFile

    def content(self, *comments: str) -> list[tuple[int, str]]:
        """Number, from 1, and text of each line that is neither empty nor a comment."""
        numbered = enumerate(self.lines, start=1)
        return [
            (k, line)
            for k, line in numbered
            if line.strip() and not line.lstrip().startswith(comments)
        ]


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


def read_text(path: Path, where: str, *, max_mb: float = MAX_MB) -> FileText:
    """Lines of a text file, refused unread if it is too large or no text.

    Raises
    ------
    InputError
        M35 it cannot be read, M36 it is too large or packed, S39 it is another program's format.
    """
    data = _bytes(path, where, max_mb)
    for first, name in FOREIGN:
        if data.startswith(first):
            raise refusal(
                where, "file", f"is {name}", code="M36" if "archive" in name else "S39", value=name,
                allowed="measurements are read from text only, and nothing is unpacked",
                fix="save the table as CSV",
            )  # fmt: skip
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise refusal(where, "file", "is UTF-16 text", fix="save it as UTF-8")
    if b"\0" in data:
        message = f"is not text: byte {data.index(0)} is zero"
        raise refusal(where, "file", message, code="S39", fix="save the table as CSV")
    digest = sha256(data).hexdigest()
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    count = data.count(b"\n")
    if count > MAX_ROWS:
        most = f"at most {MAX_ROWS} rows"
        raise refusal(where, "file", f"has {count} lines", code="M36", allowed=most, fix="split it")
    raw = data.split(b"\n")
    longest = max(range(len(raw)), key=lambda k: len(raw[k]))
    if len(raw[longest]) > MAX_LINE:
        raise refusal(
            where, "file", f"line {longest + 1} has {len(raw[longest])} bytes", code="M36",
            allowed=f"at most {MAX_LINE} bytes a line", fix="save one measurement a line",
        )  # fmt: skip
    try:
        text = data.decode("utf-8-sig")
        encoding = "UTF-8 with BOM" if data.startswith(b"\xef\xbb\xbf") else "UTF-8"
    except UnicodeDecodeError:
        text, encoding = data.decode("latin-1"), "Latin-1"
    if not text.strip():
        raise refusal(where, "file", "is empty", fix="measure something")
    return FileText(where, tuple(text.split("\n")), encoding, SourceFile(path, digest))


def _bytes(path: Path, where: str, max_mb: float) -> bytes:
    """Content of an ordinary file that is not too large."""
    try:
        is_file = path.is_file()
        size = path.stat().st_size if is_file else 0
        data = path.read_bytes() if is_file and size <= max_mb * 1e6 else b""
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or "its name is not a path"
        raise refusal(where, "file", f"cannot be read: {reason}") from error
    if not is_file:
        message = "is not a file" if path.exists() else "does not exist"
        raise refusal(where, "file", message, fix="check the path")
    if size > max_mb * 1e6:
        raise refusal(
            where, "file", f"is {size / 1e6:.3g} MB", code="M36", value=size,
            allowed=f"at most {max_mb:g} MB", fix="split it, or allow more with --max-mb",
        )  # fmt: skip
    return data


def read_sheet(text: FileText, *, separator: str = "", header: bool | None = None) -> Sheet:
    """Cells of a table whose first line names the columns; lines that begin with # do not count.

    Parameters
    ----------
    text : FileText
        From `read_text`.
    separator : str
        One of `SEPARATORS`; found in the first line if empty.
    header : bool, optional
        Whether the first line names the columns; without it they are called by their numbers, from
        "1". None: it does, and most of it is no numbers.

    Raises
    ------
    InputError
        M35: the first line holds numbers, a row is longer or shorter than the head, a name comes
        twice, a quote stays open.
    """
    content = text.content("#")
    if not content:
        raise refusal(text.where, "file", "has no table")
    separator = separator or separator_of(content[0][1])
    cells = split_cells(content, separator, text.where)
    head, first = _trimmed(cells[0]), 1
    if header is False:
        head, first = tuple(str(k + 1) for k in range(len(head))), 0
    elif header is None:
        _require_names(head, f"{text.where}:{content[0][0]}")
    _check_head(head, text.where)
    width = len(head)
    rows = tuple(tuple(row if any(row[width:]) else row[:width]) for row in cells[first:])
    lines = tuple(number for number, _ in content[first:])
    sheet = Sheet(text.where, head, rows, lines, separator, text.encoding)
    _check_lengths(sheet)
    return sheet


def separator_of(line: str) -> str:
    """What separates the cells of a line: the first of tab, semicolon and comma it holds."""
    outside = re.sub(r'"[^"]*"', "", line)
    return next((name for name, mark in SEPARATORS.items() if mark in outside), "comma")


def split_cells(content: Sequence[tuple[int, str]], separator: str, where: str) -> list[list[str]]:
    """Cells of each numbered line, stripped; quotes as in CSV, and `guarded` ones as they were."""
    rows = _split(content, separator, where)
    quoted = any("'" in line for _, line in content)
    return [list(map(unguarded, row)) for row in rows] if quoted else rows


def _split(content: Sequence[tuple[int, str]], separator: str, where: str) -> list[list[str]]:
    """The same with the apostrophe of cells that a spreadsheet must not run."""
    lines = [line for _, line in content]
    if separator == "space":
        return [line.split() for line in lines]
    mark = SEPARATORS[separator]
    if not any('"' in line for line in lines):
        return [[cell.strip() for cell in line.split(mark)] for line in lines]
    for number, line in content:
        if line.count('"') % 2:
            message = "a quote is not closed in its line"
            raise refusal(f"{where}:{number}", "file", message, fix="close or remove it")
    reader = csv.reader(lines, delimiter=mark, skipinitialspace=True)
    return [[cell.strip() for cell in row] for row in reader]


def _trimmed(cells: Sequence[str]) -> tuple[str, ...]:
    """Cells without the empty ones that separators at the end of a line leave."""
    return tuple(cells[: max((k + 1 for k, cell in enumerate(cells) if cell), default=0)])


def _require_names(head: Sequence[str], where: str) -> None:
    """Refuse a first line that holds data."""
    numbers = [cell[:20] for cell in head if NUMBER.fullmatch(cell)]
    if 2 * len(numbers) >= len(head) > 0:
        line = where.rpartition(":")[2]
        raise refusal(
            where, "file", f'line {line} holds numbers ("{numbers[0]}")', value=numbers[0],
            allowed="the first line names the columns: pose_id, q1_deg ..., x_mm ...",
            fix="name the columns, or say header = false under [dialect] in session.toml",
        )  # fmt: skip


def _check_head(head: tuple[str, ...], where: str) -> None:
    """Every column has a name, once."""
    for k, name in enumerate(head):
        if not name or name in head[:k]:
            twice = f'two columns are called "{name[:40]}"'
            message = twice if name else f"column {k + 1} has no name"
            raise refusal(where, "file", message, fix="name each once")


def _check_lengths(sheet: Sheet) -> None:
    """Every row is as long as the head; a comma that is separator and decimal mark is named."""
    width = len(sheet.head)
    wrong = [k for k, row in enumerate(sheet.rows) if len(row) != width]
    if not wrong:
        return
    count = len(sheet.rows[wrong[0]])
    message, fix = f"has {count} cells; the first line names {width} columns", "mend it"
    if sheet.separator == "comma" and count > width:
        message += " (is the comma separator and decimal mark in one?)"
        fix = "save it with ; between the cells, or with a decimal point"
    if len(wrong) > 1:
        message += f", and {len(wrong) - 1} more lines do not fit either"
    where, found = f"{sheet.where}:{sheet.lines[wrong[0]]}", f"{sheet.separator} between cells"
    raise refusal(where, "file", message, value=count, allowed=f"found: {found}", fix=fix)
