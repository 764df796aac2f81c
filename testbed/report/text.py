"""Tables as plain text, for terminals and text files."""

import csv
import io
import re
import shutil
import sys
from collections.abc import Iterable, Sequence
from textwrap import wrap as wrap_lines

from calib.errors import one_line, visible
from testbed.screen_reader import is_plain

WIDTH = 110
"""Where long texts break when they do not go to a terminal."""
UNBOUNDED = 10_000
NARROWEST = 60
"""Columns of a terminal below which broken texts stand in lines of their own, not in a table."""
MOST_TABLES = 3
"""Into which a table is folded; if it took more, each row stands by itself."""
WITH_UNIT = re.compile(r"(?<=\d) (?=(?:%|um|mm|m|mdeg|deg|s|min|h|K|kg|Nm)(?!\w))")
"""The space between a number and its unit, where no line is broken."""
NO_BREAK = "\u00a0"
"""A space that no line ends with; it is shown as any other."""
SPACE = 2
"""Between two columns."""
HANGING = 4
"""Spaces before the further lines of a broken one, at least: two stand before one of its own."""
VERDICT = "Verdict"
"""How the line of a verdict begins."""
NUMBER = r"(\d[\d.,]*|[.,]\d+)(e[+-]?\d+)?"
SIGNED = re.compile(rf"[\t\r]|\s*[=@]|\s*[+-](?!({NUMBER})?$)", re.IGNORECASE)
"""How a cell begins that a spreadsheet takes for a formula; a number with a sign is none."""
WORD = re.compile(r"[+-](?![A-Z]{1,3}\d{1,7}$)[^\W\d]\w*", re.IGNORECASE)
"""A sign and a plain word, such as -x: as a formula it names nothing, runs nothing and shows no
other number. A word such as P5 is a cell of the sheet, whose number would stand in its place."""


def table(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *, wrap: bool = False
) -> str:
    """A table as text, columns of numbers to the right; `wrap` breaks long texts at the edge.

    What is wider than the terminal is folded: into tables below each other that repeat the columns
    by which rows are told apart, or, where that does not help, into lines of one fact each.
    """
    cells = [[one_line(cell) for cell in row] for row in rows]
    if is_plain():
        return facts(title, head, cells)
    edge = terminal_width()
    if wrap:
        narrow = edge < NARROWEST
        return folded(facts(title, head, cells)) if narrow else _grid(title, head, cells, edge)
    whole = _grid(title, head, cells)
    if not sys.stdout.isatty() or max(map(len, whole.split("\n"))) <= edge:
        return whole
    parts = folded_columns([[*column] for column in zip(head, *cells, strict=True)], edge)
    if parts is None:
        return folded(facts(title, head, cells))
    if len(parts) > MOST_TABLES:
        keys = next(k for k, (i, j) in enumerate(zip(*parts[:2], strict=False)) if i != j)
        return folded(_blocks(title, head, cells, keys))
    return "\n\n".join(
        _grid(
            "" if k else title, [head[i] for i in part], [[row[i] for i in part] for row in cells]
        ).strip("\n")
        for k, part in enumerate(parts)
    )


def _blocks(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], keys: int) -> str:
    """Each row as a sentence below what tells it apart, its first cells."""
    blocks = [title] if title else []
    for row in rows:
        told = zip(head[keys:], row[keys:], strict=True)
        # a name and its number stay in one line
        facts = ", ".join(f"{name} {cell}".replace(" ", NO_BREAK) for name, cell in told)
        blocks.append(f"{', '.join(row[:keys])}\n  {facts}")
    return "\n\n".join(blocks)


def folded_columns(columns: Sequence[Sequence[str]], edge: int) -> list[list[int]] | None:
    """Columns of each of the tables that one is folded into; None if it cannot be.

    Parameters
    ----------
    columns : sequence of sequences of str
        Head and cells of each.
    edge : int
        Characters of a line.

    Examples
    --------
    >>> folded_columns([["a", "x", "y"], ["bb", "1", "2"], ["cc", "3", "4"]], 7)
    [[0, 1], [0, 2]]
    """
    wide = [max(map(len, column)) + SPACE for column in columns]
    rows = list(zip(*(column[1:] for column in columns), strict=True))
    keys = 1
    while keys < len(columns) and len({row[:keys] for row in rows}) < len(rows):
        keys += 1
    first = sum(wide[:keys])
    if keys == len(columns) or first + max(wide[keys:]) > edge:
        return None
    parts: list[list[int]] = []
    for i in range(keys, len(columns)):
        if not parts or sum(wide[j] for j in parts[-1]) + wide[i] > edge:
            parts.append([*range(keys)])
        parts[-1].append(i)
    return parts


def facts(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as lines of one fact each, for screen readers and narrow terminals.

    Examples
    --------
    >>> print(facts("Errors", ["trial", "mm"], [["a", "0.1"], ["b", "0.2"]]))
    Errors
    <BLANKLINE>
    trial: a
      mm: 0.1
    <BLANKLINE>
    trial: b
      mm: 0.2
    """
    blocks = [title] if title else []
    for row in rows:
        told = [f"{name or 'and'}: {cell}" for name, cell in zip(head, row, strict=True) if cell]
        blocks.append("\n  ".join(told))
    return "\n\n".join(blocks)


def terminal_width() -> int:
    """Where lines break: at the terminal's edge, or at `WIDTH` where there is none."""
    return shutil.get_terminal_size((WIDTH, 40)).columns if sys.stdout.isatty() else WIDTH


def folded(text: str) -> str:
    """Sentences broken at the terminal's edge, further lines indented; elsewhere as they are."""
    if not sys.stdout.isatty() or is_plain():
        return text
    edge = max(terminal_width(), 20)
    return "\n".join(
        part.replace(NO_BREAK, " ")
        for line in text.split("\n")
        for part in (
            wrap_lines(
                WITH_UNIT.sub(NO_BREAK, line),
                edge,
                subsequent_indent=" " * max(len(line) - len(line.lstrip()) + 2, HANGING),
                break_long_words=False,
                break_on_hyphens=False,
            )
            if len(line) > edge
            else [line]
        )
    )


def verdict_lines(sentence: str) -> list[str]:
    """A verdict with a line for each of its thoughts, so that each line stands by itself.

    A thought ends with its sentence or, outside of parentheses, at a semicolon; what a colon
    counts out stays together.

    Examples
    --------
    >>> verdict_lines("It falls from 3 to 1 mm (a; b); that can be believed.")
    ['Verdict: It falls from 3 to 1 mm (a; b).', '  That can be believed.']
    >>> verdict_lines("Three hold: a; b; c.")
    ['Verdict: Three hold: a; b; c.']
    """
    thoughts, begin, counts_out = list[str](), 0, False
    for mark in re.finditer(r"[.:;](?= )", sentence):
        so_far = sentence[begin : mark.start()]
        if so_far.count("(") != so_far.count(")"):
            continue
        if mark[0] == "." or (mark[0] == ";" and not counts_out):
            thoughts.append(f"{so_far}.")
            begin = mark.end() + 1
        counts_out = mark[0] == ":" or (counts_out and mark[0] == ";")
    first, *rest = [*thoughts, sentence[begin:]]
    return [f"{VERDICT}: {first}", *(f"  {text[:1].upper()}{text[1:]}" for text in rest)]


def _grid(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], width: int | None = None
) -> str:
    """A table with a line below its head, as wide as it is, or with texts broken at a width."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    grid = Table(
        title=title or None,
        box=SIMPLE_HEAD,
        title_justify="left",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for i, name in enumerate(head):
        words = i == 0 or all(not _is_number(row[i]) for row in rows)
        grid.add_column(name, justify="left" if words else "right", no_wrap=width is None)
    for row in rows:
        grid.add_row(*row)
    text = io.StringIO()
    Console(
        file=text, width=width or UNBOUNDED, color_system=None, highlight=False, markup=False
    ).print(grid)
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip().split("\n"))


def csv_text(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A CSV with plain line ends, which a spreadsheet only shows and a terminal only prints."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(guarded, head))
    writer.writerows(map(guarded, row) for row in rows)
    return visible(text.getvalue())


def guarded(cell: str) -> str:
    """A cell of a CSV, behind an apostrophe if a spreadsheet would run it.

    Examples
    --------
    >>> guarded("=cmd|x"), guarded("-1.5e-3"), guarded("-2+a"), guarded("-x")
    ("'=cmd|x", '-1.5e-3', "'-2+a", '-x')
    """
    behind = _is_guarded(cell)  # one more, or this one would be taken off
    return f"'{cell}" if behind or runs(cell) else cell


def unguarded(cell: str) -> str:
    """What `guarded` was given."""
    return cell[1:] if _is_guarded(cell) else cell


def runs(cell: str) -> bool:
    """Whether a spreadsheet would run a cell, or show another number in its place."""
    return bool(SIGNED.match(cell)) and not WORD.fullmatch(cell)


def _is_guarded(cell: str) -> bool:
    """Whether apostrophes stand before what begins as a formula does."""
    return cell.startswith("'") and bool(SIGNED.match(cell.lstrip("'")))


def _is_number(text: str) -> bool:
    """Whether a cell begins with a digit."""
    return text.lstrip("+-")[:1].isdigit()
