"""Tables as plain text, for terminals and text files."""

import csv
import io
import shutil
import sys
from collections.abc import Iterable, Sequence

WIDTH = 110
"""Where long texts break when they do not go to a terminal."""
UNBOUNDED = 10_000


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
        grid.add_row(*row)
    edge = shutil.get_terminal_size((WIDTH, 40)).columns if sys.stdout.isatty() else WIDTH
    width = edge if wrap else UNBOUNDED
    text = io.StringIO()
    Console(file=text, width=width, color_system=None, highlight=False, markup=False).print(grid)
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip().splitlines())


def csv_text(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A CSV with plain line ends."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


def _is_number(text: str) -> bool:
    """Whether a cell begins with a digit."""
    return text.lstrip("+-")[:1].isdigit()
