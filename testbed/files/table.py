"""A table under the project's column names: texts and numbers, units and decimal mark known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from testbed.bounds import FACTORS
from testbed.files.columns import AXES, TEXTS, UNITS, close_to, is_known, misspelling, unit_of
from testbed.files.dialects.marks import STATE_IT, Column, marks_of, without_thousands
from testbed.files.dialects.numbers import digits_after, floats, number_of, pointed
from testbed.files.refusal import refusal
from testbed.files.text import Sheet
from testbed.names import choice_of

LONGEST = 200
"""Characters of a name in a cell, as in session.toml."""


@dataclass(frozen=True, slots=True)
class Columns:
    """Columns of numbers that belong together; their own names carry the units."""

    names: tuple[str, ...] = ()

    @property
    def factors(self) -> tuple[float, ...]:
        """Of each unit, to SI."""
        return tuple(FACTORS[unit_of(name)] for name in self.names)


def together(*parts: Columns | None) -> Columns:
    """All columns of some; None has none."""
    return Columns(tuple(name for part in parts if part for name in part.names))


@dataclass(frozen=True, slots=True)
class Unread:
    """Columns of a file that nothing reads."""

    where: str
    columns: tuple[str, ...]
    """As the file calls them."""

    @property
    def sentence(self) -> str:
        """Where they are not used."""
        return f"{self.where}: not used: {', '.join(self.columns)}"


@dataclass(frozen=True, slots=True, eq=False)
class DataTable:
    """Cells of one file by column name."""

    sheet: Sheet
    names: Mapping[str, str]
    """Own name to the name in the file, of all columns."""
    decimal: str = ""
    """"." or ","; found in the numbers if empty."""
    thousands: str = ""
    """What stands between groups of three digits, if anything does."""

    @property
    def where(self) -> str:
        """File, for messages."""
        return self.sheet.where

    def __len__(self) -> int:
        return len(self.sheet.rows)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def place(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.where}:{self.sheet.lines[row]}"

    @property
    def places(self) -> tuple[str, ...]:
        """(m,) file and line of each row."""
        return tuple(f"{self.where}:{line}" for line in self.sheet.lines)

    def found(self, most: int = 160) -> str:
        """The columns there are, for messages: so many letters of them."""
        return f"found: {', '.join(self.names)[:most]}"

    def texts(self, name: str) -> tuple[str, ...]:
        """Cells (m,) of a column."""
        k = self.sheet.head.index(self.names[name])
        return tuple(row[k] for row in self.sheet.rows)

    def texts_of(self, name: str) -> tuple[str, ...] | None:
        """Cells (m,) of a column that may be missing."""
        return self.texts(name) if name in self else None

    def numbers(self, names: Sequence[str]) -> Array:
        """Numbers (m, k) of some columns; nan where a cell is none."""
        out = np.empty((len(self), len(names)))
        for k, name in enumerate(names):
            cells = self.texts(name)
            if self.thousands:
                cells = tuple(without_thousands(cell, self.thousands) for cell in cells)
            out[:, k] = floats(cells if self.decimal != "," else [pointed(c) for c in cells])
        out[~np.isfinite(out)] = np.nan
        return out

    def values(self, columns: Columns) -> Array:
        """Numbers (m, k) of some columns in SI units."""
        return self.numbers(columns.names) * columns.factors

    def find(self, kind: str, *stems: str) -> Columns | None:
        """Columns of some stems, each in whatever unit of a kind; None if none of them is there.

        Raises
        ------
        InputError
            M35: one is there in two units, some are there and some are not, or the coordinates of
            a point differ in their units.
        """
        units = UNITS[kind]
        there = {stem: [f"{stem}_{u}" for u in units if f"{stem}_{u}" in self] for stem in stems}
        for stem, names in there.items():
            if len(names) > 1:
                message = f"{' and '.join(names)} are both present"
                raise refusal(self.where, stem, message, fix="keep one of them")
        found = tuple(name for names in there.values() for name in names)
        if not found:
            return None
        missing = [stem for stem, names in there.items() if not names]
        if missing:
            fix = misspelling(self.names) or "give all of them or none"
            raise self.incomplete(found[0], missing, fix)
        if stems == AXES[:3] and len({unit_of(name) for name in found}) > 1:
            message, fix = f"{', '.join(found)} have different units", "give them in one unit"
            raise refusal(self.where, stems[0], message, fix=fix)
        return Columns(found)

    def incomplete(
        self, there: str, missing: Sequence[str], fix: str = "give all of them or none"
    ) -> InputError:
        """The error where columns that belong together are not all there."""
        message = f"there is a column {there} but none for {', '.join(missing)}"
        return refusal(self.where, missing[0], message, fix=fix)

    def decimals(self, name: str) -> tuple[int, int]:
        """Fewest and most digits after the decimal mark in a column."""
        counts = [digits_after(cell, self.decimal or ".") for cell in self.texts(name)]
        return min(counts, default=0), max(counts, default=0)

    def only(self, name: str) -> str | None:
        """The one text a column holds, in rows that say it; None if there is no such column.

        Raises
        ------
        InputError
            M35: it holds several.
        """
        if name not in self:
            return None
        texts = sorted({*filter(None, self.texts(name))} or {""})
        if len(texts) != 1:
            message = f"{name} is not the same in all lines: {', '.join(texts[:4])}"
            raise refusal(self.where, name, message, fix="split the file")
        return texts[0]


def table_of(
    sheet: Sheet,
    mapping: Mapping[str, str],
    *,
    decimal: str | None = None,
    grouped: bool = True,
    in_doubt: str = STATE_IT,
) -> DataTable:
    """A sheet with its columns renamed and its decimal mark known.

    Parameters
    ----------
    sheet : Sheet
        Cells as they stand in the file.
    mapping : mapping
        Own name to name in the file; columns left out keep their names.
    decimal : {".", ","}, optional
        Stated mark; else all columns of this program that hold numbers decide it.
    grouped : bool
        Whether thousands marks are read where nothing else can be meant and no mark is stated.
    in_doubt : str
        What to do where it stays in doubt.

    Raises
    ------
    InputError
        M21: a column's unit is contradicted by the line below the names; M35: a mapped column is
        not there, or the decimal mark stays in doubt; M36: an endless name.
    """
    for own, theirs in mapping.items():
        if not is_known(own):
            fix = "own names carry their unit: q1_deg, x_mm, rx_deg, ux_mm ..."
            raise unknown_column(sheet.where, "columns", own, fix)
        if theirs not in sheet.head:
            raise refusal(
                sheet.where, own, f'there is no column "{theirs}"', value=theirs,
                allowed=f"found: {', '.join(sheet.head)[:160]} ({sheet.separator} between cells)",
                fix=choice_of(theirs, sheet.head) if len(sheet.head) < 12 else "",
            )  # fmt: skip
    used = set(mapping.values())
    names = {name: name for name in sheet.head if name not in used and name not in mapping}
    table = DataTable(sheet, names | dict(mapping), decimal or "")
    _require_units(table)
    for name in TEXTS:
        require_short(table, name)
    if decimal:  # beside a stated mark another one is a mistake
        _require_mark(table)
        return table
    numeric = [name for name in table.names if is_known(name) and name not in TEXTS]
    columns = [Column(name, table.names[name], table.texts(name)) for name in numeric]
    found = marks_of(sheet.where, sheet.lines, columns, grouped=grouped, in_doubt=in_doubt)
    return replace(table, decimal=found.decimal, thousands=found.thousands)


def _require_mark(table: DataTable) -> None:
    """Refuse a decimal mark that is stated where all numbers have the other one."""
    other, word = (".", "point") if table.decimal == "," else (",", "comma")
    numeric = [name for name in table.names if is_known(name) and name not in TEXTS]
    cells = [(cell, row) for name in numeric for row, cell in enumerate(table.texts(name))]
    if any(table.decimal in cell for cell, _ in cells):
        return
    for cell, row in cells:
        if cell.count(other) == 1 and np.isfinite(number_of(cell.replace(other, "."))):
            message = f'decimal is "{table.decimal}", and numbers have a decimal {word} ("{cell}")'
            fix = f'write decimal = "{other}" under [dialect], or leave it out'
            raise refusal(table.place(row), "decimal", message, value=table.decimal, fix=fix)


def _require_units(table: DataTable) -> None:
    """Refuse a column that is called by another unit than the line below the names says."""
    said = dict(zip(table.sheet.head, table.sheet.units, strict=False))
    for own, theirs in table.names.items():
        unit, other = unit_of(own) if is_known(own) else "", said.get(theirs, "")
        if unit and other and unit != other:
            called = f"is called {own}" if own == theirs else f'has {own} = "{theirs}"'
            raise refusal(
                table.where, own, f"{called}, and the line below the names says {other}",
                code="M21", value=other, fix="correct the one that is wrong",
            )  # fmt: skip


def require_short(table: DataTable, name: str) -> None:
    """Refuse endless names: they are compared, numbered and shown."""
    texts = table.texts_of(name) or ("",)
    longest = max(range(len(texts)), key=lambda row: len(texts[row]))
    if len(texts[longest]) > LONGEST:
        raise refusal(
            table.place(longest), name,
            f"{table.names[name]} has {len(texts[longest])} characters", code="M36",
            allowed=f"at most {LONGEST}", fix="shorten it",
        )  # fmt: skip


def unknown_column(where: str, key: str, own: str, fix: str) -> InputError:
    """The error of a name under a key of session.toml that is none of ours; a likely one first."""
    message = f'{key.rpartition(".")[2]}: "{own}" is not a column of this program'
    return refusal(where, key, message, code="S37", value=own, fix=close_to(own) or fix)
