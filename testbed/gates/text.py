"""Bytes of a text file into lines and cells; sizes are bounded and nothing is ever unpacked."""

import csv
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.disk import read_bounded
from testbed.gates.paths import near

MAX_MB = 100.0
LARGER = "split it, or allow more with --max-mb"
MAX_ROWS = 1_000_000
MAX_LINE = 65_536
"""Bytes."""
SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "space": " "}
"""In the order in which they are looked for."""
ENCODINGS = {
    "UTF-8": "utf-8",
    "UTF-8 with BOM": "utf-8-sig",
    "Windows-1252": "cp1252",
    "Latin-1": "latin-1",
    "UTF-16 LE": "utf-16-le",
    "UTF-16 BE": "utf-16-be",
}
"""Names for people to those of Python."""
MARKS = {"UTF-16 LE": b"\xff\xfe", "UTF-16 BE": b"\xfe\xff"}
"""What a file in an encoding begins with, where Python neither reads nor writes it itself."""
EMPTY = " \t\r\f\v,;"
"""What a line without content may hold."""
ERROR = re.compile(r'\s*"?#(N/A|NV|[A-Z]+/0!|[A-Z]+!|NAME\?)"?\s*([,;\t]|$)')
"""A first cell in which a spreadsheet could compute nothing: that line is no comment."""
XML = b"<?"
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
    (b"#ROSBAG", "a bag of ROS"),
    (b"SQLite format 3", "an SQLite file, as a bag of ROS 2"),
    (b"\x89MCAP", "a bag of ROS 2 (MCAP)"),
    (b"PAR1", "a Parquet file"),
    (b"ARROW1", "an Arrow file"),
    (b"%PDF", "a PDF"),
    *((first, "a page of HTML or XML") for first in (b"<!", XML, b"<html", b"<HTML")),
)
"""First bytes of what is no text, and what to call it."""
TOPICS = "export its topics as CSV: with PlotJuggler, or by rostopic echo -p"


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file that was read, and its hash."""

    path: Path
    sha256: str

    def __repr__(self) -> str:
        return f"SourceFile({self.path.name!r}, sha256 {self.sha256[:8]})"


@dataclass(frozen=True, slots=True)
class FileText:
    """The lines of a text file."""

    where: str
    """Name for messages."""
    lines: tuple[str, ...]
    encoding: str
    """One of `ENCODINGS`, or the sheet of a workbook."""
    source: SourceFile
    ends: tuple[str, ...] = ()
    """How each line but the last one ends, where that is not a line feed everywhere."""
    first: int = 1
    """Number of the first line: 0 where a line of names was put above those of the file."""
    tables: dict[object, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Tables of these lines that were read before, by how they were."""

    def content(self, *comments: str) -> list[tuple[int, str]]:
        """Number, from `first`, and text of each line that is neither empty nor a comment.

        A line of nothing but separators is an empty row.
        """
        numbered = enumerate(self.lines, start=self.first)
        return [
            (k, line)
            for k, line in numbered
            if line.strip(EMPTY).strip()  # of Unicode, too
            and not (line.lstrip().startswith(comments) and not ERROR.match(line))
        ]


def read_text(
    path: Path, where: str, *, max_mb: float = MAX_MB, larger: str = LARGER, markup: bool = False
) -> FileText:
    """Lines of a text file, refused unread if it is too large or no text.

    `larger` is what to do with a file of more than `max_mb`; `markup` is whether XML is taken as
    the text that it is.

    Raises
    ------
    InputError
        M35 it cannot be read, M36 it is too large or packed, S39 it is another program's format.
    """
    data = bytes_of(path, where, max_mb, larger)
    digest = sha256(data).hexdigest()
    wide = next((name for name, mark in MARKS.items() if data.startswith(mark)), "")
    if wide:
        data = _narrow(data, wide, where)
    for first, name in FOREIGN:
        if data.startswith(first) and not (markup and first == XML):
            raise _refused(
                where, f"is {name}", code="M36" if "archive" in name else "S39", value=name,
                allowed="measurements are read from text only, and nothing is unpacked",
                fix=TOPICS if "a bag" in name else "save the table as CSV",
            )  # fmt: skip
    if b"\0" in data:
        raise _no_text(data, where)
    whole = data
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    count = data.count(b"\n")
    if count > MAX_ROWS:
        most = f"at most {MAX_ROWS} rows"
        raise _refused(where, f"has {count} lines", code="M36", allowed=most, fix="split it")
    raw = data.split(b"\n")
    longest = max(range(len(raw)), key=lambda k: len(raw[k]))
    if len(raw[longest]) > MAX_LINE:
        line = raw[longest]
        mark = SEPARATORS[separator_of(raw[0][:MAX_LINE].decode("latin-1"))].encode()
        column = line.count(mark, 0, MAX_LINE) + 1  # where it is too long already
        raise _refused(
            f"{where}:{longest + 1}", f"has {len(line)} bytes, and too many in column {column}",
            code="M36", value=len(line), allowed=f"at most {MAX_LINE} bytes a line",
            fix="save one measurement a line, a number or a name in each column",
        )  # fmt: skip
    encoding = wide or _encoding(data)
    text = data.decode("utf-8" if wide else ENCODINGS[encoding])
    if not text.strip():
        raise _refused(where, "is empty", fix="give a file with rows")
    lines, source = tuple(text.split("\n")), SourceFile(path, digest)
    return FileText(where, lines, encoding, source, _ends(whole))


def _narrow(data: bytes, encoding: str, where: str) -> bytes:
    """Bytes of UTF-16 as UTF-8, without the mark of their order."""
    try:
        return data[len(MARKS[encoding]) :].decode(ENCODINGS[encoding]).encode()
    except UnicodeDecodeError as error:
        byte = error.start + len(MARKS[encoding])
        message = f"begins as UTF-16 text, and byte {byte} is part of no letter"
        raise _refused(where, message, fix="save it as UTF-8") from error


def _no_text(data: bytes, where: str) -> InputError:
    """The error of bytes with a zero among them, as all two-byte letters without a mark have."""
    first = data[:MAX_LINE]
    if any(4 * first[k::2].count(0) > len(first) for k in (0, 1)):
        message = "is UTF-16 text without the mark that says in which order its bytes are"
        return _refused(where, message, code="S39", fix="save it as UTF-8")
    message = f"is not text: byte {data.index(0)} is zero"
    return _refused(where, message, code="S39", fix="save the table as CSV")


def _encoding(data: bytes) -> str:
    """Which of `ENCODINGS` some bytes are in."""
    if _decodes(data, "utf-8"):
        return "UTF-8 with BOM" if data.startswith(b"\xef\xbb\xbf") else "UTF-8"
    # between 80 and 9f Latin-1 has no letters; Windows has, but for five of these bytes
    windows = re.search(rb"[\x80-\x9f]", data) and _decodes(data, "cp1252")
    return "Windows-1252" if windows else "Latin-1"


def _decodes(data: bytes, codec: str) -> bool:
    """Whether some bytes are text in a codec."""
    try:
        data.decode(codec)
    except UnicodeDecodeError:
        return False
    return True


def _ends(data: bytes) -> tuple[str, ...]:
    """How each line but the last one ends; nothing where all do by a line feed."""
    if b"\r" not in data:
        return ()
    names = {b"\r\n": "\r\n", b"\r": "\r", b"\n": "\n"}
    return tuple(names[end] for end in re.findall(rb"\r\n?|\n", data))


def bytes_of(path: Path, where: str, max_mb: float, larger: str = LARGER) -> bytes:
    """Content of an ordinary file that is not too large."""
    try:
        is_file = path.is_file()
        size = path.stat().st_size if is_file else 0
        data = read_bounded(path, size) if is_file and size <= max_mb * 1e6 else b""
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or "its name is not a path"
        raise _refused(where, f"cannot be read: {reason}") from error
    if not is_file:
        if path.exists():
            raise _refused(where, "is not a file", fix="check the path")
        fix = near(path)
        if where == path.name:  # as a session names it, beside itself
            fix = fix.replace(f'"{path.parent}{os.sep}', '"')
        raise _refused(where, "does not exist", fix=fix)
    if size > max_mb * 1e6:
        raise _refused(
            where, f"is {size / 1e6:.3g} MB", code="M36", value=size,
            allowed=f"at most {max_mb:g} MB", fix=larger,
        )  # fmt: skip
    return data


def separator_of(line: str) -> str:
    """What separates the cells of a line: the first of `SEPARATORS` it holds."""
    outside = re.sub(r'"[^"]*"', "", line)
    return next((name for name, mark in SEPARATORS.items() if mark in outside), "comma")


def split(content: Sequence[tuple[int, str]], separator: str, where: str) -> list[list[str]]:
    """Cells of each numbered line, stripped; quotes as in CSV, but each is closed in its line."""
    lines = [line for _, line in content]
    if separator == "space":
        return [line.split() for line in lines]
    mark = SEPARATORS[separator]
    if not any('"' in line for line in lines):
        return [[cell.strip() for cell in line.split(mark)] for line in lines]
    # an open quote takes in the next line: the last one has an empty line after it
    reader = csv.reader([*lines, ""], delimiter=mark, skipinitialspace=True)
    rows: list[list[str]] = []
    for number, line in content:
        try:
            row = next(reader)
        except csv.Error:  # a cell over many lines is longer than it may be
            row = []
        if reader.line_num != len(rows) + 1 or line.count('"') % 2:
            message = "a quote is not closed in its line"
            raise _refused(f"{where}:{number}", message, fix="close or remove it")
        rows.append([cell.strip() for cell in row])
    return rows


def _refused(
    where: str,
    message: str,
    *,
    code: str = "M35",
    value: object = None,
    allowed: str = "",
    fix: str = "",
) -> InputError:
    """The error of a file, or of one of its lines."""
    return refuse("file", value, allowed, code=code, message=message, fix=fix, where=where)
