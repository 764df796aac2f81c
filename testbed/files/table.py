"""A table under its own column names: texts and numbers, with the decimal mark found and told."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool
from calib.errors import InputError
from testbed.files.columns import close_to, is_known
from testbed.files.text import Sheet
from testbed.strict import choice_of

SHOWN = 10
"""Cells named in one message."""
MOST_BAD = 100
GROUPED = re.compile(r"\d[ '\u00a0\u202f\u2019]\d")
THREE = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True, slots=True)
class Bad:
    """A cell that is no number."""

    line: int
    column: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Cells of one file by column name."""

    sheet: Sheet
    names: Mapping[str, str]
    """Own name to the name in the file, of all columns."""
    decimal: str = ""
    """"." or ","; found in the numbers if empty."""

    @property
    def where(self) -> str:
        """File, for messages."""
        return self.sheet.where

    def __len__(self) -> int:
        return len(self.sheet.rows)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def place(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.where}:{self.sheet.lines[row]}"

    def texts(self, name: str) -> list[str]:
        """Cells (m,) of a column."""
        k = self.sheet.head.index(self.names[name])
        return [row[k] for row in self.sheet.rows]

    def numbers(self, names: Sequence[str]) -> Array:
        """Numbers (m, k) of some columns; nan where a cell is none."""
        out = np.empty((len(self), len(names)))
        for k, name in enumerate(names):
            cells = self.texts(name)
            out[:, k] = _floats(cells if self.decimal != "," else [_pointed(c) for c in cells])
        out[~np.isfinite(out)] = np.nan
        return out

    def decimals(self, name: str) -> tuple[int, int]:
        """Fewest and most digits after the decimal mark in a column."""
        counts = [_digits_after(cell, self.decimal or ".") for cell in self.texts(name)]
        return min(counts, default=0), max(counts, default=0)

    def only(self, name: str) -> str | None:
        """The one text a column holds all along; None if there is no such column.

        Raises
        ------
        InputError
            M35: it holds several.
        """
        if name not in self:
            return None
        texts = sorted(set(self.texts(name)))
        if len(texts) != 1:
            raise InputError(
                f"{name} is not the same in all lines: {', '.join(texts[:4])}",
                code="M35",
                where=self.where,
                field=name,
                fix="split the file",
            )
        return texts[0]


def table_of(
    sheet: Sheet, mapping: Mapping[str, str], numeric: Sequence[str], *, decimal: str | None = None
) -> Table:
    """A sheet with its columns renamed and its decimal mark known.

    Parameters
    ----------
    sheet : Sheet
        Cells as they stand in the file.
    mapping : mapping
        Own name to name in the file; columns left out keep their names.
    numeric : sequence of str
        Own names that will be read as numbers, as far as they are there: they decide the mark.
    decimal : {".", ","}, optional
        Stated mark.

    Raises
    ------
    InputError
        M35: a mapped column is not there, or the decimal mark stays in doubt.
    """
    for own, theirs in mapping.items():
        if not is_known(own):
            raise InputError(
                f'columns: "{own}" is no column of this program',
                code="S37",
                where=sheet.where,
                field="columns",
                value=own,
                fix=close_to(own) or "own names carry their unit: q1_deg, x_mm, rx_deg, ux_mm ...",
            )
        if theirs not in sheet.head:
            raise InputError(
                f'there is no column "{theirs}"',
                code="M35",
                where=sheet.where,
                field=own,
                value=theirs,
                allowed=f"found: {', '.join(sheet.head)[:160]} ({sheet.separator} between cells)",
                fix=choice_of(theirs, sheet.head) if len(sheet.head) < 12 else "",
            )
    used = set(mapping.values())
    names = {name: name for name in sheet.head if name not in used and name not in mapping}
    table = Table(sheet, names | dict(mapping), decimal or "")
    return table if decimal else replace(table, decimal=_decimal_mark(table, numeric))


def bad_cells(table: Table, names: Sequence[str]) -> list[Bad]:
    """Cells of some columns that are no numbers, by line."""
    rows, columns = np.nonzero(~np.isfinite(table.numbers(names)))
    return [
        Bad(table.sheet.lines[row], table.names[names[k]], table.texts(names[k])[row])
        for row, k in zip(rows[:MOST_BAD], columns[:MOST_BAD], strict=True)
    ]


def refuse_bad(table: Table, names: Sequence[str], *, drop: bool) -> tuple[Bool, list[str]]:
    """Rows (m,) whose cells are all numbers, and the warning that names the others.

    Raises
    ------
    InputError
        M25: there are others, unless `drop`.
    """
    good = np.asarray(np.isfinite(table.numbers(names)).all(axis=1))
    count = int((~good).sum())
    if not count:
        return good, []
    bad = bad_cells(table, names)
    shown = ", ".join(f'line {b.line} {b.column} "{b.text[:20]}"' for b in bad[:SHOWN])
    more = " ..." if len(bad) > SHOWN else ""
    told = (
        f"{count} of {len(table)} rows {'has' if count == 1 else 'have'} cells that are not "
        f"numbers ({shown}{more})"
    )
    if not drop:
        raise InputError(
            told,
            code="M25",
            where=table.where,
            field=bad[0].column,
            value=count,
            fix="mend them or add --drop-invalid",
        )
    return good, [f"{table.where}: {told}; left out"]


def _decimal_mark(table: Table, numeric: Sequence[str]) -> str:
    """The decimal mark that all numbers agree on."""
    comma = point = None
    sure = False
    for name in numeric:
        if name not in table:
            continue
        for row, cell in enumerate(table.texts(name)):
            marks = cell.count(","), cell.count(".")
            if sum(marks) > 1 or (GROUPED.search(cell) and any(c.isdigit() for c in cell)):
                raise InputError(
                    f'{table.names[name]} is "{cell[:40]}", which has thousands marks',
                    code="M35",
                    where=table.place(row),
                    field=name,
                    value=cell[:40],
                    allowed="a number has one decimal mark and no other",
                    fix="save it without thousands marks",
                )
            if marks[0]:
                comma = comma or (cell, row)
                sure = sure or not THREE.fullmatch(cell)
            elif marks[1]:
                point = point or (cell, row)
    if comma and point:
        raise InputError(
            f'numbers have a decimal comma ("{comma[0][:20]}", line {table.sheet.lines[comma[1]]}) '
            f'and a point ("{point[0][:20]}", line {table.sheet.lines[point[1]]})',
            code="M35",
            where=table.where,
            field="decimal",
            fix="save all of them in one form",
        )
    if comma and not sure:
        raise InputError(
            f'numbers such as "{comma[0]}" may have a decimal comma or thousands marks',
            code="M35",
            where=table.place(comma[1]),
            field="decimal",
            fix='write decimal = "," or "." under [dialect] in session.toml',
        )
    return "," if comma else "."


def _floats(cells: Sequence[str]) -> Array:
    """Numbers (m,); nan where a cell is none."""
    if not any("_" in cell for cell in cells):  # Python reads 1_000, a table should not
        try:
            return np.array([float(cell) for cell in cells], dtype=np.float64)
        except ValueError:
            pass
    return np.array([_float(cell) for cell in cells], dtype=np.float64)


def _float(cell: str) -> float:
    """One number, or nan."""
    try:
        return np.nan if "_" in cell else float(cell)
    except ValueError:
        return np.nan


def _pointed(cell: str) -> str:
    """A number with a decimal comma as one with a point; a point there makes it no number."""
    return cell.replace(",", ".") if "." not in cell else "?"


def _digits_after(cell: str, mark: str) -> int:
    """Digits after the decimal mark."""
    mantissa = re.split("[eE]", cell)[0]
    return len(mantissa.split(mark)[1]) if mark in mantissa else 0
