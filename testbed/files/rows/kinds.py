"""Rows of a table that several sections of a session read: which of them hold whose readings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Bool, Index
from testbed.files.dialects.tables import ObservedTable, RangesTable
from testbed.files.table import DataTable

FAR = ("distance",)
PLACE = (
    *"xyz", *(f"difference_{axis}" for axis in "xyz"), "range", "azimuth", "elevation", "zenith",
)  # fmt: skip
"""Columns that make a row a distance or a position, without their unit."""


def own_rows(
    table: DataTable, section: ObservedTable, others: Sequence[tuple[ObservedTable, DataTable]]
) -> Index:
    """Rows of a table without those whose cells are empty here and filled for another section.

    Parameters
    ----------
    table : DataTable
        Under the names of `section`.
    section : ObservedTable
        Whose rows are asked for.
    others : sequence of (ObservedTable, DataTable)
        Sections that read the same table, and the table under their names.
    """
    elsewhere = np.zeros(len(table), dtype=np.bool_)
    for other, renamed in others:
        elsewhere |= _filled(renamed, other)
    return np.flatnonzero(_filled(table, section) | ~elsewhere)


def some_rows(table: DataTable, rows: Index) -> DataTable:
    """The same table of some of its rows."""
    sheet = table.sheet
    cells = tuple(sheet.rows[k] for k in rows)
    lines = tuple(sheet.lines[k] for k in rows)
    return replace(table, sheet=replace(sheet, rows=cells, lines=lines))


def _filled(table: DataTable, section: ObservedTable) -> Bool:
    """Rows (m,) with something in a column of the section's readings."""
    stems = FAR if isinstance(section, RangesTable) else PLACE
    there = np.zeros(len(table), dtype=np.bool_)
    for name in table.names:
        if name.rpartition("_")[0] in stems:
            there |= np.array([bool(cell.strip()) for cell in table.texts(name)], dtype=np.bool_)
    return there
