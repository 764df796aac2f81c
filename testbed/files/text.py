"""Lines of a text file into a sheet: a head, and rows as long as it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from calib.errors import InputError
from testbed.files.columns import WRITTEN
from testbed.files.dialects.commented_names import with_commented_names
from testbed.files.dialects.numbers import NUMBER
from testbed.files.refusal import refusal
from testbed.files.rows.below import table_ends
from testbed.gates.text import EMPTY, FileText, separator_of, split
from testbed.report.text import runs, unguarded
from testbed.units import counted

FIRST = 3
"""Rows that show whether columns at the end have no name."""
MOST_TITLES = 50
"""Lines that free text above a table may have."""

MOST_GROUPS = 4
"""Lines above the names that say of what the columns are: Marker, its name, Position."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """Rows of cells, all as long as the head."""

    where: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    """(m,) line of the file each row stands in, from 1."""
    separator: str
    """One of `testbed.gates.text.SEPARATORS`."""
    encoding: str
    titles: tuple[str, ...] = ()
    """Lines above the one that names the columns."""
    units: tuple[str, ...] = ()
    """(c,) unit of each column, "" of one that has none, where a line below the names says them."""
    below: tuple[tuple[int, str], ...] = ()
    """Number and text of each line below the table that is none of its rows."""


def read_sheet(
    text: FileText, *, separator: str = "", header: bool | None = None, below: bool = False
) -> Sheet:
    """Cells of a table under the line that names its columns; those that begin with # do not count.

    Lines above that one are titles, if each has fewer cells. A line below it that holds nothing but
    units says those of the columns.

    Parameters
    ----------
    text : FileText
        From `read_text`.
    separator : str
        One of `testbed.gates.text.SEPARATORS`; found in the first line if empty.
    header : bool, optional
        Whether the first line names the columns; without it they are called by their numbers, from
        "1". None: it does, and most of it is no numbers.
    below : bool
        Whether sentences and sums may stand below the table.

    Raises
    ------
    InputError
        M35: the first line holds numbers, a row is longer or shorter than the head, a name comes
        twice, a quote stays open.
    """
    text = text if header is False else with_commented_names(text)
    content = text.content("#")
    if not content:
        raise refusal(text.where, "file", "has no table", fix="give the file with the rows")
    above = 0 if header is not None else titles_above(content, separator)
    titles, content = content[:above], content[above:]
    separator = separator or _separator(content)
    cells = split_cells(content, separator, text.where)
    head, first = _names(cells[0], cells[1:]), 1
    if header is False:
        head, first = tuple(str(k + 1) for k in range(len(head))), 0
    elif header is None:
        _require_names(head, f"{text.where}:{content[0][0]}")
    for title in reversed(titles[-MOST_GROUPS:]):
        head = _of_groups(head, title, separator)
    head = _without_echoes(head, cells[first:])
    _check_head(head, f"{text.where}:{content[0][0]}")
    head = tuple(name or f"column {k + 1}" for k, name in enumerate(head))
    width, units = len(head), _units(cells[1:2], len(head)) if header is not False else ()
    first += bool(units)
    end = first + table_ends(cells[first:]) if below else len(cells)
    rows = tuple(tuple(row if any(row[width:]) else row[:width]) for row in cells[first:end])
    lines = tuple(number for number, _ in content[first:end])
    said = tuple(line.strip(EMPTY) for _, line in titles)
    sheet = Sheet(
        text.where, head, rows, lines, separator, text.encoding, said, units, tuple(content[end:])
    )  # fmt: skip
    _check_lengths(sheet)
    return sheet


def _separator(content: Sequence[tuple[int, str]]) -> str:
    """What separates the cells of all lines, told by the first one.

    Tabs in some places and spaces in others are white space, where only then all rows are alike.
    """
    found = separator_of(content[0][1])
    lines = [line for _, line in content]
    if found != "tab" or len({line.rstrip().count("\t") for line in lines}) == 1:
        return found
    return "space" if len({len(line.split()) for line in lines}) == 1 else found


def titles_above(content: Sequence[tuple[int, str]], separator: str = "") -> int:
    """How many lines of free text stand above the one that names the columns.

    That is the line of words under which the most cells fit, with a number in the row below it, or
    below a line of units.
    """
    best = most = 0
    lines = [(1, line) for _, line in content[: 3 * MOST_TITLES]]
    tables: dict[str, tuple[list[list[str]], list[int]]] = {}
    for k in range(min(len(lines) - 1, MOST_TITLES + 1)):
        mark = separator or separator_of(lines[k][1])
        try:
            cells, widest = tables.get(mark) or tables.setdefault(mark, _measured(lines, mark))
        except InputError:
            return 0
        names = _names(cells[k], cells[k + 1 :])
        # the cells of a merged one are empty but for the first; what has more than any row is none
        full = (sum(map(bool, above)) for above in cells[:k])
        if _holds_data(names) or any(len(names) <= count <= widest[k + 1] for count in full):
            continue
        fit = [len(row) >= len(names) > 1 and not any(row[len(names) :]) for row in cells[k + 1 :]]
        many = sum(fit) * len(names)
        below = cells[k + 1 :]
        first = below[bool(_units(below[:1], len(names))) :][:2]
        counted = [any(NUMBER.fullmatch(cell) for cell in row) and not are_counted(row)
                   for row in first]  # fmt: skip
        if fit[0] and many > most and counted and all(counted):
            best, most = k, many
    return best


def _measured(lines: Sequence[tuple[int, str]], mark: str) -> tuple[list[list[str]], list[int]]:
    """Cells of each line, and the widest line from each on."""
    cells = split(lines, mark, "")
    widths = (len(_trimmed(row)) for row in reversed(cells))
    return cells, [*accumulate(widths, max)][::-1]


def split_cells(content: Sequence[tuple[int, str]], separator: str, where: str) -> list[list[str]]:
    """Cells of each numbered line, stripped; quotes as in CSV, and `guarded` ones as they were."""
    rows = split(content, separator, where)
    quoted = any("'" in line for _, line in content)
    return [list(map(_unquoted, row)) for row in rows] if quoted else rows


def _unquoted(cell: str) -> str:
    """A cell without the apostrophes around it, or before what a spreadsheet would run."""
    inside = cell[1:-1] if len(cell) > 2 and cell[0] == cell[-1] == "'" else ""
    return inside if inside and (NUMBER.fullmatch(inside) or not runs(inside)) else unguarded(cell)


def _trimmed(cells: Sequence[str]) -> tuple[str, ...]:
    """Cells without the empty ones that separators at the end of a line leave."""
    end = len(cells)
    while end and not cells[end - 1]:
        end -= 1
    return tuple(cells[:end])


def _names(cells: Sequence[str], below: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Cells of the line of names, those without a name at its end only where all rows have more.

    What is cut off behind a comma that was a decimal mark is no column: it has digits alone.
    """
    named, rows = len(_trimmed(cells)), list(map(_trimmed, below[:FIRST]))
    width = min([len(cells), *map(len, rows)])
    more = named < width < 2 * named and not all(row[width - 1].isdigit() for row in rows)
    return tuple(cells[: width if more else named])


def _of_groups(head: tuple[str, ...], title: tuple[int, str], separator: str) -> tuple[str, ...]:
    """Names that come again, as X under both Nominal and Measured, with the cell above before them.

    A cell above is that of the columns to its right, as merged cells are written, up to the next
    one. Names of a group get it together, and only where one of them comes again. It is the name
    of a column that has none.
    """
    if len(set(filter(None, head))) == len([name for name in head if name]):
        return head
    try:
        above = split([title], separator, "")[0]
    except InputError:
        return head
    groups, last = [], ""
    for k in range(len(head)):
        last = (above[k] if k < len(above) else "") or last
        groups.append(last)
    again = {group for group, name in zip(groups, head, strict=True) if head.count(name) > 1}
    named = [
        f"{group} {name}" if name and group and group in again else name
        for group, name in zip(groups, head, strict=True)
    ]
    own = [
        cell if above.count(cell) == 1 and cell not in named else ""
        for cell in (*above, *[""] * len(head))
    ]
    return tuple(name or cell for name, cell in zip(named, own, strict=False))


def _without_echoes(head: tuple[str, ...], rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The same with a number behind names that come again over cells that say nothing more.

    Those hold no number, as the state of a second tool, or what the first column of the name holds.
    """
    names = list(head)
    for k, name in enumerate(head):
        first = head.index(name)
        if name and first < k:
            both = [(row[first], row[k]) for row in rows if k < len(row)]
            wordy = not any(NUMBER.fullmatch(cell) for _, cell in both)
            if both and (wordy or all(one == other for one, other in both)):
                names[k] = f"{name} ({head[: k + 1].count(name)})"
    return tuple(names)


def _units(below: Sequence[Sequence[str]], width: int) -> tuple[str, ...]:
    """What the line below the names says where it holds nothing but units."""
    cells = [cell.strip("[]() ") for row in below for cell in _trimmed(row)]
    said = [cell for cell in cells if cell]
    if not said or len(cells) > width or not all(cell.lower() in WRITTEN for cell in said):
        return ()
    units = [WRITTEN.get(cell.lower(), "") for cell in cells]
    return (*units, *[""] * (width - len(units)))


def _holds_data(cells: Sequence[str]) -> bool:
    """Whether half of the cells of a line, or more, are numbers, and not those of joints."""
    return (
        not are_counted(cells)
        and 2 * sum(bool(NUMBER.fullmatch(cell)) for cell in cells) >= len(cells) > 0
    )


def are_counted(cells: Sequence[str]) -> bool:
    """Whether the numbers of a line count 1, 2, 3 ..., as names of joints, beside those of axes."""
    numbers = [cell for cell in cells if NUMBER.fullmatch(cell)]
    words = sum(bool(cell) for cell in cells) - len(numbers)
    return words > 2 < len(numbers) and numbers == [str(k + 1) for k in range(len(numbers))]


def _require_names(head: Sequence[str], where: str) -> None:
    """Refuse a first line that holds data."""
    if _holds_data(head):
        number = next(cell[:20] for cell in head if NUMBER.fullmatch(cell))
        line = where.rpartition(":")[2]
        raise refusal(
            where, "file", f'line {line} holds numbers ("{number}")', value=number,
            allowed="the first line names the columns: pose_id, q1_deg ..., x_mm ...",
            fix="name the columns, or say header = false in session.toml, "
            "which `truebed new session` writes",
        )  # fmt: skip


def _check_head(head: tuple[str, ...], where: str) -> None:
    """No name of a column comes twice, and most columns have one."""
    for k, name in enumerate(head):
        if name and name in head[:k]:
            first = head.index(name)
            message = f'columns {first + 1} and {k + 1} are both called "{name[:40]}"'
            fix = "name each once, with the tool, marker or kind that it is of before it"
            raise refusal(where, "file", message, fix=fix)
    if 2 * head.count("") > len(head):
        message = f"{head.count('')} of {len(head)} columns have no name, the first is column "
        message += str(head.index("") + 1)
        raise refusal(where, "file", message, fix="name each once")


def _check_lengths(sheet: Sheet) -> None:
    """Every row is as long as the head; a comma that is separator and decimal mark is named."""
    width = len(sheet.head)
    wrong = [k for k, row in enumerate(sheet.rows) if len(row) != width]
    if not wrong:
        return
    count = len(sheet.rows[wrong[0]])
    message, fix = (
        f"has {counted(count, 'cell')}; the first line names {width} columns",
        "correct it",
    )
    if sheet.separator == "comma" and count > width:
        message += " (is the comma separator and decimal mark in one?)"
        fix = "save it with ; between the cells, or with a decimal point"
    if len(wrong) > 1:
        message += f", and {len(wrong) - 1} more lines do not fit either"
    where, found = f"{sheet.where}:{sheet.lines[wrong[0]]}", f"{sheet.separator} between cells"
    raise refusal(where, "file", message, value=count, allowed=f"found: {found}", fix=fix)
