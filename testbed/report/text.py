"""Tables as plain text, for terminals and text files."""

import csv
import io
import re
import shutil
import sys
from collections.abc import Iterable, Sequence

from calib.errors import one_line, visible

WIDTH = 110
"""Where long texts break when they do not go to a terminal."""
UNBOUNDED = 10_000
NUMBER = r"(\d[\d.,]*|[.,]\d+)(e[+-]?\d+)?"
RUN = re.compile(rf"[\t\r]|\s*[=@]|\s*[+-](?!({NUMBER})?$)", re.IGNORECASE)
"""How a cell begins that a spreadsheet would run as a formula; a number with a sign is none."""


def table(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *, wrap: bool = False
) -> str:
    """A table as text, columns of numbers to the right; `wrap` breaks long texts at the edge."""
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
        grid.add_column(name, justify="left" if words else "right", no_wrap=not wrap)
    for row in rows:
        grid.add_row(*map(one_line, row))
    edge = shutil.get_terminal_size((WIDTH, 40)).columns if sys.stdout.isatty() else WIDTH
    width = edge if wrap else UNBOUNDED
    text = io.StringIO()
    Console(file=text, width=width, color_system=None, highlight=False, markup=False).print(grid)
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
    >>> guarded("=cmd|x"), guarded("-1.5e-3"), guarded("-a")
    ("'=cmd|x", '-1.5e-3', "'-a")
    """
    return f"'{cell}" if RUN.match(cell.lstrip("'")) else cell


def unguarded(cell: str) -> str:
    """What `guarded` was given."""
    return cell[1:] if cell.startswith("'") and RUN.match(cell.lstrip("'")) else cell


def _is_number(text: str) -> bool:
    """Whether a cell begins with a digit."""
    return text.lstrip("+-")[:1].isdigit()
