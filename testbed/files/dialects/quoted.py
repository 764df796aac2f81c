"""Cells over several lines, as spreadsheets write them in quotes: each row in its first line."""

import re
from collections.abc import Sequence
from dataclasses import replace

from testbed.gates.text import FileText

MARK = '"'
MOST = 20
"""Lines of a cell."""
OPENS = re.compile(r'(?:^|[,;\t])\s*"[^",;\t]*$')
"""The end of a line in which a cell of no separator begins."""
CLOSES = re.compile(r'[^",;\t]*"\s*(?:[,;\t]|$)')
"""The beginning of the line in which it ends."""
WITHIN = re.compile(r"[^,;\t]*")


def with_quoted_lines(text: FileText) -> FileText:
    """A file whose cells stay in their line, the lines that they ended in empty.

    A quote that is open across a separator may be a slip that would swallow rows: such a file
    comes back as it is.
    """
    if not any(line.count(MARK) % 2 for line in text.lines):
        return text
    lines, k = list(text.lines), 0
    while k < len(lines):
        end = _end_of(lines, k) if lines[k].count(MARK) % 2 else k
        if end is None:
            return text
        if end > k:
            row = " ".join([lines[k], *lines[k + 1 : end + 1]])
            lines[k : end + 1] = [row, *[""] * (end - k)]
            if row.count(MARK) % 2:
                continue  # another cell begins where this one ends
        k = end + 1
    return replace(text, lines=tuple(lines))


def _end_of(lines: Sequence[str], k: int) -> int | None:
    """The line in which the cell ends that line k leaves open; None where it is no such cell."""
    if not OPENS.search(lines[k]):
        return None
    below = [n for n in range(k + 1, min(k + 1 + MOST, len(lines))) if lines[n]]
    for n in below:
        if CLOSES.match(lines[n]):
            return n
        if not WITHIN.fullmatch(lines[n]) or MARK in lines[n]:
            return None
    return None
