"""Contents of a user's files: tables with and without a header, exports, programs, workbooks."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from os.path import commonpath
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from calib.errors import InputError
from testbed.files.dialects.commented_names import with_commented_names
from testbed.files.dialects.controllers.read import Language, joints_in, language_of
from testbed.files.dialects.numbers import NUMBER, NUMBERS_ALONE, number_of
from testbed.files.dialects.spatial_lines import name_fields, sa_lines
from testbed.files.refusal import refusal
from testbed.files.rows.planned import foretold
from testbed.files.rows.widened import sheet_in
from testbed.files.sources import text_of
from testbed.files.text import Sheet, are_counted, read_sheet, titles_above
from testbed.gates.paths import is_there, real
from testbed.gates.text import MAX_MB, FileText
from testbed.gates.workbook import is_workbook, sheet_names
from testbed.proposal.names import Meaning, meanings
from testbed.proposal.transforms import SHORT

Kind = Literal["table", "bare", "points", "frames", "program"]
Document = dict[str, Any]
ASSIGNED = re.compile(r"[^\W\d]\w{0,30}\s*=\s*[\[{(]")
MATRIX = re.compile(r"\s*[^\W\d]\w{0,30}\s*=\s*(?:[\[{(]\s*(?:[-+.\d].*|%.*)?)?")
"""A line with which a script, or a console, begins a matrix behind a name."""
AXES = 3
"""Fewest numbers in a row of joints or places."""
BEGIN = 50
"""Lines of which one may begin a matrix."""


@dataclass(frozen=True, slots=True)
class Found:
    """One table of a file, and its likely kind."""

    path: Path
    name: str
    """Name of the file, as in session.toml."""
    sheet: str | None
    text: FileText
    kind: Kind
    """A table, one without names of its columns, an export of points or frames, or a program."""
    head: tuple[str, ...]
    rows: int
    meanings: tuple[Meaning, ...] = ()
    width: int = 0
    """Number of numbers in a row after its names, in a table without a header."""
    names: int = 0
    """Number of names in a row before its numbers, in a table without a header."""
    named: tuple[int, ...] = ()
    """Possible numbers of name fields in an export, the likely one first."""
    length: str = ""
    """Unit of an export, if stated."""
    language: Language | None = None
    """Language of a program."""
    notes: tuple[str, ...] = ()
    """Notes on parts of a program that are not used."""
    also: "Found | None" = None
    """The same rows as a table without a header, if they may be more than an export."""
    table: Sheet | None = None
    """Its cells, if its columns have names."""

    @property
    def called(self) -> str:
        """File and sheet."""
        return self.name + (f" sheet {self.sheet}" if self.sheet is not None else "")

    @property
    def stems(self) -> dict[str, Meaning]:
        """Meaning of each column, by its name without the unit."""
        return {meaning.plain: meaning for meaning in self.meanings}

    def has(self, *stems: str) -> bool:
        """Whether there are columns of all these stems."""
        return set(stems) <= set(self.stems)

    def column(self, name: str) -> tuple[str, ...]:
        """Cells of a column."""
        table = self.table or sheet_in(self.text, header=False)
        k = table.head.index(name)
        return tuple(row[k] for row in table.rows)


Part: TypeAlias = tuple[Found, Document, tuple[str, ...], str]
"""File, keys of its table, assumptions, and the layout of a file without a header."""


def files_of(table: Document) -> tuple[str, ...]:
    """Names of the files of a table of session.toml; of several, one per station or reflector."""
    several = (*table.get("files", ()), *table.get("reflector_files", {}).values())
    return several or tuple(filter(None, [table.get("file")]))


def look_at(paths: Sequence[Path], root: Path) -> tuple[Found, ...]:
    """The tables of some files, each sheet of a workbook by itself.

    Raises
    ------
    InputError
        R6: a file is not in the folder of the session; or it cannot be read as any of these.
    """
    found = []
    for k, path in enumerate(paths):
        where = str(path)
        if path in paths[:k]:
            raise refusal(where, "DATA", "is given twice", code="S37", fix="give each file once")
        at = real(path, field="DATA", code="S37")
        if is_there(at, Path.is_dir):
            fix = "give the files in it"
            raise refusal(where, "DATA", "is a folder", code="S37", fix=fix)
        if is_there(at, Path.is_file) and not at.is_relative_to(root.resolve()):
            raise refusal(
                where, "DATA", "does not lie in the folder of the session", code="R6",
                allowed=f"session.toml reads files in {root} or below",
                fix=f"copy it there, or give --out in {_folder_above(paths)}",
            )  # fmt: skip
        sheets = sheet_names(path, where) if is_workbook(path) else (None,)
        alone = len(sheets) == 1
        for sheet in sheets:
            text = with_commented_names(text_of(path, where, sheet=sheet, max_mb=MAX_MB))
            if any(line.strip() for line in text.lines):
                name = at.relative_to(root.resolve()).as_posix() if at.exists() else path.name
                cover = not alone and _is_cover(text)
                own = _cover if cover else _looked
                found.append(own(path, name, None if alone else sheet, text))
    return tuple(found)


def _folder_above(paths: Sequence[Path]) -> str:
    """The lowest folder that contains all files, in the form of the given paths."""
    folders = [path.parent for path in paths]
    alike = len({folder.is_absolute() for folder in folders}) == 1
    if not alike or any(".." in folder.parts for folder in folders):
        folders = [folder.resolve() for folder in folders]
    return commonpath(folders) or "."


def _is_cover(text: FileText) -> bool:
    """Whether a sheet has no two rows of a table, as a page of words beside those that have."""
    lines = [_cells(line) for _, line in text.content()]
    return sum(sum(map(bool, map(NUMBER.fullmatch, cells))) >= AXES for cells in lines) < 2


def _cover(path: Path, name: str, sheet: str | None, text: FileText) -> Found:
    """Such a sheet, which is not used."""
    return Found(path, name, sheet, text, "table", (), 0)


def _looked(path: Path, name: str, sheet: str | None, text: FileText) -> Found:
    """One table with its likely kind."""
    if (language := language_of(text)) is not None:
        found = joints_in(text, language)
        own = _of_sheet(path, name, sheet, text, "program", found.sheet)
        return replace(own, language=language, notes=found.note)
    content = text.content("#", "//")
    if not content:
        raise refusal(text.where, "file", "has no table", fix="give the file with the rows")
    _require_no_matrices(text, content)
    headed = _has_head(content[0][1])
    commented = any(line.lstrip().startswith("//") for line in text.lines) and not headed
    titled = titles_above(content) and not commented
    if commented or not (titled or headed):
        _require_no_lists(text, content)
        try:
            return _of_lines(path, name, sheet, text)
        except InputError:
            if commented:
                raise
    return _of_sheet(path, name, sheet, text, "table", sheet_in(text))


def _cells(line: str) -> list[str]:
    """Cells of a line with any separator."""
    marks = [mark for mark in ("\t", ";", ",") if mark in line]
    cells = line.split(marks[0]) if marks else line.split()
    return [cell.strip() for cell in cells]


def _has_head(line: str) -> bool:
    """Whether a first line names columns; lines of data have names first, then numbers."""
    cells = [cell for cell in _cells(line) if cell]
    if are_counted(cells):
        return True
    numbers = [bool(NUMBER.fullmatch(cell)) for cell in cells]
    return 2 * sum(numbers) < len(cells) and not any(numbers[1:])


def _of_sheet(
    path: Path, name: str, sheet: str | None, text: FileText, kind: Kind, table: Sheet
) -> Found:
    """A table with a header."""
    ahead = foretold(table.head)
    kept = [k for k, own in enumerate(table.head) if own not in ahead]
    units = [table.units[k] for k in kept] if table.units else []
    means = _points_by_name(meanings([table.head[k] for k in kept], units), table)
    return Found(path, name, sheet, text, kind, table.head, len(table.rows), means, table=table)


def _points_by_name(means: tuple[Meaning, ...], table: Sheet) -> tuple[Meaning, ...]:
    """The same meanings, but names of targets that never repeat are names of points.

    Tables of Spatial Analyzer use such names; a reflector is measured more than once.
    """
    stems = {one.plain: one for one in means}
    one = stems.get("target")
    if one is None or one.known or "pose_id" in stems:
        return means
    column = table.head.index(one.theirs)
    cells = [row[column] for row in table.rows]
    if len(set(cells)) < len(cells) or len(cells) < 2:
        return means
    return tuple(replace(each, stem="pose_id") if each is one else each for each in means)


def _of_lines(path: Path, name: str, sheet: str | None, text: FileText) -> Found:
    """Rows without a header: names, then numbers."""
    comma = text.content("#", "//")[0][1]
    commented = any(line.lstrip()[:2] == "//" for line in text.lines)
    if (";" in comma or "\t" in comma) and not commented:
        table = read_sheet(text, header=False, below=True)
        fields, length = table.rows, ""
        lines = None
    else:
        lines = sa_lines(text)
        fields, length = lines.fields, lines.length
    first = fields[0]
    names = next((k for k, cell in enumerate(first) if NUMBER.fullmatch(cell)), len(first))
    width = 0
    for cell in first[names:]:
        if not NUMBER.fullmatch(cell):
            break
        width += 1
    kind: Kind = "bare"
    if lines is not None and (names or commented):
        # coordinates behind up to three names are points; one name and a transform are a frame
        kind = "frames" if names == 1 and _is_frame(fields, width) else "points"
    named: tuple[int, ...] = ()
    if lines is not None and kind == "points":
        try:
            named = (name_fields(lines, None),)
        except InputError:  # numbers may be names
            named = tuple(k for k in range(names, 4) if k <= names + width - 3)
    head = tuple(str(k + 1) for k in range(len(first)))
    own = tuple(line[0] for line in fields) if names == 1 else ()
    means = (Meaning("1", "pose_id", ""),) if len(set(own)) == len(fields) else ()
    rows = Found(path, name, sheet, text, "bare", head, len(fields), means, width, names)
    if kind == "bare":
        return rows
    also = rows if means and not commented else None
    return replace(rows, kind=kind, meanings=(), named=named, length=length, also=also)


def _is_frame(fields: Sequence[Sequence[str]], width: int) -> bool:
    """Whether the numbers after a name are those of a frame."""
    if width != SHORT.size:
        return width in (6, 7, 16, 19)
    rows = [[number_of(cell) for cell in line[1 : SHORT.size + 1]] for line in fields]
    return SHORT.fits(np.array([row for row in rows if len(row) == SHORT.size]))


def _require_no_lists(text: FileText, content: Sequence[tuple[int, str]]) -> None:
    """Refuse lists that each line gives to names, as the printout of a program."""
    number, line = content[0]
    if (found := ASSIGNED.search(line)) is not None:
        raise refusal(
            f"{text.where}:{number}", "file", f'has lists behind names ("{found[0]} ...")',
            allowed="each line holds numbers, which a line above them names",
            fix="write the numbers alone, below a line q1_deg, q2_deg ... x_mm, y_mm, z_mm",
        )  # fmt: skip


def _require_no_matrices(text: FileText, content: Sequence[tuple[int, str]]) -> None:
    """Refuse matrices that stand below each other, each behind its name."""
    begun = [
        (k, line) for (k, line), (_, below) in pairwise(content[: BEGIN + 1])
        if MATRIX.fullmatch(line) and NUMBERS_ALONE.fullmatch(below)
    ]  # fmt: skip
    if begun:
        number, line = begun[0]
        name = line.partition("=")[0].strip()
        raise refusal(
            f"{text.where}:{number}", "file", f"begins a matrix behind a name ({name} =)",
            allowed="a file holds one table",
            fix="write each matrix to a file of its own, in MATLAB by writematrix(Q, 'q.csv')",
        )  # fmt: skip
