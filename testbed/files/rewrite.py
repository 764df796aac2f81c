"""A table file written again with some numbers changed and columns added, all else as it was."""

from collections.abc import Mapping, Sequence

from calib.arrays import Array, Bool
from testbed.files.table import Table
from testbed.files.text import SEPARATORS, Text


def rewritten(
    text: Text,
    table: Table,
    columns: Sequence[str],
    numbers: Array,
    changed: Bool,
    added: Mapping[str, Sequence[str] | Array],
) -> str:
    """The lines of a file with new numbers in some rows, and further columns in all.

    Parameters
    ----------
    text : Text
        The file; comments and empty lines stay where they are.
    table : Table
        Its table.
    columns : sequence of str
        Own names of the k columns that change.
    numbers : (m, k) array
        What they become, in the file's units.
    changed : (m,) array of bool
        In which rows.
    added : mapping
        Name of each new column to its (m,) words or numbers; numbers get six digits.
    """
    sheet = table.sheet
    mark, comma = SEPARATORS[sheet.separator], table.decimal == ","
    lines = list(text.lines)
    head = next(
        k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")
    )
    lines[head] = mark.join([*(_cell(name, mark) for name in sheet.head), *added])
    places = [sheet.head.index(table.names[name]) for name in columns]
    for row, number in enumerate(sheet.lines):
        cells = list(sheet.rows[row])
        if changed[row]:
            for at, value in zip(places, numbers[row], strict=True):
                cells[at] = _number(float(value), comma)
        for values in added.values():
            value = values[row]
            word = value if isinstance(value, str) else _number(float(f"{value:.6g}"), comma)
            cells.append(word.replace(" ", "_") if mark == " " else word)
        lines[number - 1] = mark.join(_cell(cell, mark) for cell in cells)
    return "\n".join(lines)


def _number(value: float, comma: bool) -> str:
    """A number that reads back exactly."""
    text = repr(value + 0.0)
    return text.replace(".", ",") if comma else text


def _cell(cell: str, mark: str) -> str:
    """A cell, quoted where it must be."""
    if mark in cell or '"' in cell:
        return '"' + cell.replace('"', '""') + '"'
    return cell
