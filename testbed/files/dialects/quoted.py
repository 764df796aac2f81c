"""Cells in quotes: over several lines, as spreadsheets write them, or parted by spaces, as by R."""

import re
from collections.abc import Sequence
from dataclasses import replace

from testbed.gates.text import SEPARATORS, FileText, separator_of, split

MARK = '"'
CELL = re.compile(r'"([^"]*)"|([^\s"]+)')
"""A cell between spaces: what it holds in quotes, or without."""
MOST = 20
"""Lines of a cell."""
OPENS = re.compile(r'(?:^|[,;\t])\s*"[^",;\t]*$')
"""The end of a line in which a cell of no separator begins."""
CLOSES = re.compile(r'[^",;\t]*"\s*(?:[,;\t]|$)')
"""The beginning of the line in which it ends."""
WITHIN = re.compile(r"[^,;\t]*")
OPENS_LIST = re.compile(r'(?:^|[,;\t])\s*"(?:[\w.]{1,20}\()?[\[(][^"]*$')
"""The same where the cell is a list, in which separators may stand."""
CLOSES_LIST = re.compile(r'[^"]*[\])]"\s*(?:[,;\t]|$)')
WITHIN_LIST = re.compile(r"[\s\d.,;eE+\[\]()-]*")


def with_quoted_lines(text: FileText) -> FileText:
    """A file whose cells stay in their line, the lines that they ended in empty.

    A quote that is open across a separator, other than in a list of numbers, may be a slip that
    would swallow rows: such a file comes back as it is.
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
    closes, within = CLOSES, WITHIN
    if not OPENS.search(lines[k]):
        if not OPENS_LIST.search(lines[k]):
            return None
        closes, within = CLOSES_LIST, WITHIN_LIST
    below = [n for n in range(k + 1, min(k + 1 + MOST, len(lines))) if lines[n]]
    for n in below:
        if closes.match(lines[n]):
            return n
        if not within.fullmatch(lines[n]) or MARK in lines[n]:
            return None
    return None


def with_row_names(text: FileText) -> FileText:
    """A table as R's write.table writes it, its cells parted by tabs; other files as they come.

    Its first line names the columns in quotes, but not the one of the names of the rows, which each
    line begins with, in quotes as well. Spaces part cells, unless another mark was chosen.
    """
    first = next((line for line in text.lines if line.strip()), "")
    separator = separator_of(first)
    mark = SEPARATORS[separator]
    names = rf'"[^"{mark}]*"'
    if not re.fullmatch(rf"{names}(?:{re.escape(mark)}{names})+", first.strip()):
        return text
    content = text.content("#")
    head, *second = _cells(content[:2], separator, text.where)
    usual = (1,) if separator != "space" else (0, 1)
    if not second or len(second[0]) - len(head) not in usual:
        return text
    rows = _cells(content[1:], separator, text.where)
    more = {len(row) - len(head) for row in rows}
    named = all(line.startswith(MARK) for _, line in content)
    if len(more) > 1 or (more == {1} and not named):
        return text
    lines = list(text.lines)
    for (number, _), row in zip(content, [[""] * more.pop() + head, *rows], strict=True):
        if any("\t" in cell or MARK in cell for cell in row):
            return text
        lines[number - text.first] = "\t".join(row)
    return replace(text, lines=tuple(lines))


def _cells(content: Sequence[tuple[int, str]], separator: str, where: str) -> list[list[str]]:
    """Cells of numbered lines, also of those in quotes between spaces."""
    if separator != "space":
        return split(content, separator, where)
    found = (CELL.finditer(line) for _, line in content)
    return [[one[1] if one[2] is None else one[2] for one in line] for line in found]
