"""Sheets of a workbook (.xlsx) into lines of text: values only, macros refused, sizes bounded.

A workbook is a zip archive of XML. What its parts claim to hold is added up before one is unpacked,
none may carry a document type, and openpyxl then reads one sheet, row by row, as it was saved last.
"""

import re
import warnings
import zipfile
import zlib
from datetime import date, datetime
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.disk import read_bounded
from testbed.gates.paths import is_there
from testbed.gates.text import LARGER, MAX_MB, MAX_ROWS, FileText, SourceFile
from testbed.names import choice_of

MOST_PARTS, MOST_COLUMNS = 1000, 1000
LARGEST_RATIO = 200
"""Bytes that one packed byte of a part may become; a sheet of equal rows has about 100."""
SMALL = 1_000_000
"""Bytes of a part whose ratio is not asked for."""
MACROS = ("vbaproject.bin", "xl/macrosheets/", "workbook.bin")
ENCODINGS = (b"utf-8", b"utf-16", b"us-ascii", b"iso-8859-1")
FORMULA, VALUE = re.compile(rb"<f[ />]"), re.compile(rb"<v[^>/]*>[^<]")
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, OSError)
"""What zipfile raises on a damaged or a locked archive."""


def is_workbook(path: Path) -> bool:
    """Whether a file is a zip archive that has a workbook in it."""
    if not is_there(path, Path.is_file):  # to open a pipe would wait for ever
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except DAMAGED:
        return False
    return any(name.lower().endswith(("workbook.xml", "workbook.bin")) for name in names)


def sheet_names(path: Path, where: str) -> tuple[str, ...]:
    """Names of the sheets of a workbook.

    Raises
    ------
    InputError
        As `read_workbook`.
    """
    book = _opened(_packed(path, where, MAX_MB), where)
    return tuple(sheet.title for sheet in book.worksheets)


def read_workbook(path: Path, where: str, *, sheet: str | None, max_mb: float) -> FileText:
    """Lines of one sheet, one a row, with tabs between the cells.

    Line k is row k of the sheet; formulas are the values that were saved with them.

    Parameters
    ----------
    path : path
        Of the workbook.
    where : str
        Its name for messages.
    sheet : str or None
        Name of the sheet; the only one that is there by default.
    max_mb : float
        Largest file, packed and unpacked [MB].

    Raises
    ------
    InputError
        M36 too large, packed or unpacked; S39 macros, a document type, or no sound workbook; M35
        several sheets, none of that name, a formula without a value; openpyxl is not installed.
    """
    data = _packed(path, where, max_mb)
    try:
        with warnings.catch_warnings(action="ignore"):  # of styles and extensions it does not know
            found = _chosen(_opened(data, where), sheet, where)
            _check_formulas(data, found, where)
            lines = _lines(found, where)
    except InputError:
        raise
    except Exception as error:  # whatever openpyxl meets in a damaged part
        raise _unsound(error, where) from error
    source = SourceFile(path, sha256(data).hexdigest())
    return FileText(where, lines, f"xlsx sheet {found.title}, values only", source)


def _packed(path: Path, where: str, max_mb: float) -> bytes:
    """The bytes of a workbook that passes."""
    try:
        size = path.stat().st_size
        data = read_bounded(path, min(size, int(max_mb * 1e6)))
    except OSError as error:
        fix = LARGER if size > max_mb * 1e6 else "check the path"
        message = f"cannot be read: {error.strerror or f'it has {size / 1e6:.3g} MB'}"
        raise _refused(where, message, code="M36", fix=fix) from error
    _check_parts(data, where, max_mb)
    return data


def _opened(data: bytes, where: str) -> Any:
    """The workbook in openpyxl."""
    try:
        from openpyxl import load_workbook
    except ImportError as error:
        fix = "pip install 'truebed[xlsx]', or save the sheet as CSV"
        raise _refused(where, "is a workbook, and openpyxl is not installed", fix=fix) from error
    try:
        with warnings.catch_warnings(action="ignore"):
            return load_workbook(BytesIO(data), read_only=True, data_only=True, keep_links=False)
    except Exception as error:
        raise _unsound(error, where) from error


def _unsound(error: Exception, where: str) -> InputError:
    """The error of a workbook that openpyxl cannot read."""
    fix = "open and save it again, or save the sheet as CSV"
    return _refused(where, f"is no sound workbook: {type(error).__name__}", code="S39", fix=fix)


def _check_parts(data: bytes, where: str, max_mb: float) -> None:
    """Refuse what is packed too tightly, runs, or may hold more than it shows."""
    most = f"at most {max_mb:g} MB unpacked"
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            parts = archive.infolist()
            names = [part.filename.lower() for part in parts]
            if any(mark in name for mark in MACROS for name in names):
                message = "is a workbook with macros, or a binary one"
                raise _refused(where, message, code="S39", fix="save it as .xlsx")
            if len(parts) > MOST_PARTS or len(set(names)) < len(names):
                message = f"has {len(parts)} parts, or two of one name"
                fix = "save the sheet as CSV"
                raise _refused(where, message, code="M36", allowed=f"{MOST_PARTS} parts", fix=fix)
            whole = sum(part.file_size for part in parts)
            if whole > max_mb * 1e6:
                message = f"unpacks to {whole / 1e6:.3g} MB"
                raise _refused(where, message, code="M36", allowed=most, fix=LARGER)
            for part in parts:
                ratio = part.file_size / max(part.compress_size, 1)
                if part.file_size > SMALL and ratio > LARGEST_RATIO:
                    message = f"part {part.filename[:60]} unpacks {ratio:.0f} times"
                    allowed = f"at most {LARGEST_RATIO} times"
                    fix = "save the sheet as CSV"
                    raise _refused(where, message, code="M36", allowed=allowed, fix=fix)
                _check_xml(archive.read(part), part.filename, where)
    except DAMAGED as error:
        message, fix = "is a damaged or a locked workbook", "save it again, without a password"
        raise _refused(where, message, code="S39", fix=fix) from error


def _check_xml(data: bytes, name: str, where: str) -> None:
    """Refuse a document type; encodings that could hide one are none that a workbook has."""
    if not name.lower().endswith((".xml", ".rels")):
        return
    plain = data.replace(b"\0", b"").lstrip(b"\xef\xbb\xbf\xff\xfe \r\n\t")
    declared = re.match(rb"<\?xml[^>]*encoding=[\"']([\w.-]+)", plain)
    known = declared is None or declared[1].lower() in ENCODINGS
    if not plain.startswith(b"<") or not known or b"<!DOCTYPE" in plain or b"<!ENTITY" in plain:
        message, fix = f"part {name[:60]} has a document type", "save the sheet as CSV"
        if not plain.startswith(b"<") or not known:
            message = f"part {name[:60]} is no XML in UTF-8"
        raise _refused(where, message, code="S39", allowed="DOCTYPE is not allowed", fix=fix)


def _check_formulas(data: bytes, sheet: Any, where: str) -> None:
    """Refuse a formula that was never computed: its cell would look empty."""
    with zipfile.ZipFile(BytesIO(data)) as archive:
        text = archive.read(sheet._worksheet_path).replace(b"\0", b"")
    for cell in text.split(b"<c ")[1:] if b"<f" in text else ():
        if FORMULA.search(cell) and not VALUE.search(cell):
            name = re.match(rb'[^>]*r="(\w{1,10})"', cell)
            which = name[1].decode() if name else "?"
            raise _refused(
                where, f"cell {which} has a formula without a value",
                allowed="formulas are read by the values saved with them",
                fix="open the workbook, let it compute and save it",
            )  # fmt: skip


def _chosen(book: Any, wanted: str | None, where: str) -> Any:
    """The sheet that is meant."""
    names = [sheet.title for sheet in book.worksheets]
    if wanted is None and len(names) == 1:
        return book.worksheets[0]
    if wanted in names:
        return book[wanted]
    shown = ", ".join(name[:40] for name in names[:12])
    if not names:
        raise _refused(where, "has no sheet with cells", fix="save the table as CSV")
    message = f"has the sheets {shown}"
    fix = 'name one: sheet = "..." under the table of the file in session.toml'
    if wanted is not None:
        message, fix = f'has no sheet "{wanted[:40]}"', choice_of(wanted, names)
    raise _refused(where, message, allowed=f"found: {shown}" if wanted else "", fix=fix)


def _lines(sheet: Any, where: str) -> tuple[str, ...]:
    """Each row of a sheet as a line, all equally long but the empty ones."""
    sheet.reset_dimensions()  # which a file may state at will
    rows: list[list[str]] = []
    for row in sheet.iter_rows(values_only=True):
        if len(rows) == MAX_ROWS or len(row) > MOST_COLUMNS:
            wide = len(row) > MOST_COLUMNS
            message = f"has {len(row)} columns" if wide else f"has more than {MAX_ROWS} rows"
            allowed = f"at most {MAX_ROWS} rows of {MOST_COLUMNS} columns"
            raise _refused(where, message, code="M36", allowed=allowed, fix="split it")
        rows.append([_text(value) for value in row])
    width = max(map(len, rows), default=0)
    return tuple("\t".join([*row, *[""] * (width - len(row))]) if any(row) else "" for row in rows)


def _text(value: object) -> str:
    """A value as a cell of a table has it."""
    if value is None:
        return ""
    if isinstance(value, datetime | date):
        return value.isoformat()
    text = repr(value) if isinstance(value, float) else re.sub(r"\s+", " ", str(value))
    return '"' + text.replace('"', '""') + '"' if '"' in text else text


def _refused(
    where: str, message: str, *, code: str = "M35", allowed: str = "", fix: str = ""
) -> InputError:
    """The error of a workbook."""
    return refuse("file", None, allowed, code=code, message=message, fix=fix, where=where)
