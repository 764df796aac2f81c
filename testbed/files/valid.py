"""Rows of a table whose numbers are numbers, and of a size that makes sense."""

import re

import numpy as np

from calib.arrays import Bool
from testbed.files.columns import ANGLES, bound_of, unit_of
from testbed.files.refusal import refusal
from testbed.files.rows.below import said_below
from testbed.files.table import Columns, DataTable

SHOWN = 10
"""Cells named in one message."""


def valid_rows(
    table: DataTable, columns: Columns, *, drop: bool | None, spare: Bool | None = None
) -> tuple[Bool, list[str]]:
    """Rows (m,) that can be computed with, and warnings: of the others, odd ones, lines below.

    Parameters
    ----------
    table : DataTable
        Of the file.
    columns : Columns
        All that is used of it.
    drop : bool or None
        Whether to leave out the other rows; None: it cannot be asked for.
    spare : (m,) array of bool, optional
        Rows in which these columns may be empty, and of which nothing is said.

    Raises
    ------
    InputError
        There are others, unless `drop`: M25 for cells that are no numbers, V9 for numbers beyond
        what is ever measured.
    """
    names = columns.names
    size = np.abs(table.numbers(names)) * columns.factors
    if spare is not None:
        size[spare] = 0.0
    numeric = np.isfinite(size)
    bounds = [bound_of(name) for name in names]
    most, least = (np.array([getattr(bound, end) for bound in bounds]) for end in ("most", "least"))
    beyond = numeric & ((size > most) | ((size < least) & (size > 0)))
    warnings = said_below(table.where, table.sheet.below)
    for wrong, what, code in (
        (~numeric, "cells that are not numbers", "M25"),
        (beyond, "implausible numbers", "V9"),
    ):
        if not wrong.any():
            continue
        message, first = _named(table, columns, wrong, what)
        name = names[first]
        allowed = bounds[first].allowed(unit_of(name)) if code == "V9" else ""
        if not drop:
            fix = "correct them" if drop is None else "correct them or add --drop-invalid"
            most = wrong.any(axis=1).mean() > 0.5  # little would be left
            row, column = np.argwhere(wrong)[0]
            if most and code == "M25" and re.search(r"\d", table.texts(names[column])[row]):
                fix = "write numbers alone in these cells, and their unit in the column's name"
                if names[column] == "time_s":
                    fix = "call the column time if these are dates or hours"
            if most and code == "V9":
                fix = f"check the unit of {table.names[name]}"
                if unit_of(name) in ANGLES:
                    fix += "; counts of an encoder are no angles"
            raise refusal(
                table.where, table.names[name], message, code=code, allowed=allowed, fix=fix,
                value=int(wrong.any(axis=1).sum()),
            )  # fmt: skip
        warnings.append(f"{table.where}: {message}; left out")
    good = np.asarray((numeric & ~beyond).all(axis=1))
    odd = good[:, None] & (size > 0)
    odd &= ~np.column_stack([bound.is_usual(x) for bound, x in zip(bounds, size.T, strict=True)])
    if odd.any():
        message, first = _named(table, columns, odd, "odd uncertainties")
        usual = bounds[first].allowed(unit_of(names[first]), usual=True)
        warnings.append(f"{table.where}: {message}; {usual}")
    return good, warnings


def _named(table: DataTable, columns: Columns, wrong: Bool, what: str) -> tuple[str, int]:
    """A sentence on the cells (m, k) that are wrong, and the column of the first one."""
    count = int(wrong.any(axis=1).sum())
    bad = [(int(row), int(k)) for row, k in np.argwhere(wrong)[: SHOWN + 1]]
    cells = []
    for row, k in bad[:SHOWN]:
        name = columns.names[k]
        text = table.texts(name)[row][:20]
        cells.append(f'line {table.sheet.lines[row]} {table.names[name]} "{text}"')
    message = (
        f"{count} of {len(table)} rows {'has' if count == 1 else 'have'} {what} "
        f"({', '.join(cells)}{' ...' * (len(bad) > SHOWN)})"
    )
    return message, bad[0][1]
