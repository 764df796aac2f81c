"""Tables whose rows hold several targets each: a row of its own for every one of them."""

from testbed.files.dialects.tables import PointsTable
from testbed.files.refusal import refusal
from testbed.files.text import Sheet

LENGTH = "mm"
"""Unit of the coordinates where nothing says another."""


def one_target_a_row(sheet: Sheet, section: PointsTable) -> Sheet:
    """Rows of a sheet once for each target that they hold, its name in a column target.

    Cells of the other columns are repeated; a target with nothing in its three cells was not seen.

    Raises
    ------
    InputError
        M21: the line below the names says another unit; M35: a column is not there, or taken twice,
        or one is called target already.
    """
    targets, unit = section.targets, section.length or LENGTH
    _require_columns(sheet, section)
    place = {name: [sheet.head.index(column) for column in own] for name, own in targets.items()}
    taken = {k for places in place.values() for k in places}
    said = {sheet.units[k] for k in taken if sheet.units} - {"", unit}
    if said:
        raise refusal(
            sheet.where, "points.length", f"the line below the names says {said.pop()}", code="M21",
            value=unit, fix="write that as length under [points] in session.toml",
        )  # fmt: skip
    kept = [k for k in range(len(sheet.head)) if k not in taken]
    rows, lines = [], []
    for row, line in zip(sheet.rows, sheet.lines, strict=True):
        for name, places in place.items():
            if any(row[k] for k in places):
                rows.append((*(row[k] for k in kept), name, *(row[k] for k in places)))
                lines.append(line)
    return Sheet(
        where=sheet.where,
        head=(*(sheet.head[k] for k in kept), "target", *(f"{axis}_{unit}" for axis in "xyz")),
        rows=tuple(rows),
        lines=tuple(lines),
        separator=sheet.separator,
        encoding=sheet.encoding,
        titles=sheet.titles,
        units=(*(sheet.units[k] for k in kept), *[""] * 4) if sheet.units else (),
        below=sheet.below,
    )


def _require_columns(sheet: Sheet, section: PointsTable) -> None:
    """Refuse targets whose columns are not there, or serve twice."""
    columns = [column for own in section.targets.values() for column in own]
    where, key = sheet.where, "points.targets"
    for k, column in enumerate(columns):
        if column not in sheet.head:
            allowed = f"found: {', '.join(sheet.head)[:160]}"
            raise refusal(where, key, f'there is no column "{column}"', value=column,
                          allowed=allowed, fix="correct targets under [points]")  # fmt: skip
        if column in columns[:k]:
            raise refusal(where, key, f'the column "{column}" is that of two coordinates',
                          value=column, fix="correct targets under [points]")  # fmt: skip
    if "target" in sheet.head:
        raise refusal(where, key, "has a column target, and targets names several in a row",
                      fix="keep one of them")  # fmt: skip
