"""A table written again with new numbers in some of its cells, and all else unchanged."""

import re
from collections.abc import Mapping, Sequence

from calib.arrays import Array, Bool
from calib.errors import visible
from testbed.files.text import Sheet
from testbed.gates.text import ENCODINGS, MARKS, SEPARATORS, FileText
from testbed.report.text import guarded, runs

QUOTED = re.compile(r' *"((?:[^"]|"")*)"')
"""A cell in quotes, as CSV has them."""


def rewritten(
    text: FileText,
    sheet: Sheet,
    numbers: Mapping[str, Array],
    changed: Mapping[str, Bool],
    added: Mapping[str, Sequence[str] | Array],
    *,
    comma: bool,
) -> bytes:
    """A file with new numbers in some cells (m,), and further columns in all rows.

    All else stays: comments, empty lines, quotes, spaces, line ends and the encoding, except that
    cells which a spreadsheet would run get an apostrophe, and control characters of terminals are
    written as text. Each new column has (m,) words or numbers of six digits.

    Parameters
    ----------
    text, sheet : FileText, Sheet
        The file that was read.
    numbers : mapping of str to (m,) array
        New numbers by the name of their column, which read back exactly.
    changed : mapping of str to (m,) array of bool
        Rows that get them.
    added : mapping of str to (m,) array or sequence of str
        Further columns.
    comma : bool
        Whether numbers have a decimal comma.
    """
    mark, width = SEPARATORS[sheet.separator], len(sheet.head)
    lines = list(text.lines)
    content = text.content("#")[len(sheet.titles) :]
    head = content[0][0] - 1
    lines[head] = _line(lines[head], mark, width, {}, list(added))
    if sheet.units and mark != " ":
        below = content[1][0] - 1
        lines[below] += mark * (width - 1 - lines[below].count(mark) + len(added))
    places = {name: sheet.head.index(name) for name in numbers}
    for row, number in enumerate(sheet.lines):
        new = {
            places[name]: _number(float(values[row]), comma)
            for name, values in numbers.items()
            if changed[name][row]
        }
        more = [
            value if isinstance(value, str) else _number(float(f"{value:.6g}"), comma)
            for value in (column[row] for column in added.values())
        ]
        lines[number - 1] = _line(lines[number - 1], mark, width, new, more)
    ends = (*(text.ends or "\n" * (len(lines) - 1)), "")
    whole = "".join(visible(line) + end for line, end in zip(lines, ends, strict=True))
    begin = MARKS.get(text.encoding, b"")
    return begin + whole.encode(ENCODINGS[text.encoding], "backslashreplace")


def cell_spans(line: str, mark: str) -> list[tuple[int, int]]:
    """Where the cells of a line begin and end, without quotes and the spaces around them.

    Examples
    --------
    >>> line = 'P1 ; "a;b" ;3'
    >>> [line[i:j] for i, j in cell_spans(line, ";")]
    ['P1', 'a;b', '3']
    """
    if mark == " ":
        return [found.span() for found in re.finditer(r"\S+", line)]
    spans, at = list[tuple[int, int]](), 0
    while True:
        quoted = QUOTED.match(line, at)
        end = line.find(mark, quoted.end() if quoted else at)
        end = len(line) if end < 0 else end
        if quoted:
            spans.append(quoted.span(1))
        else:
            begin = at + len(line[at:end]) - len(line[at:end].lstrip())
            spans.append((begin, begin + len(line[at:end].strip())))
        if end == len(line):
            return spans
        at = end + 1


def _line(line: str, mark: str, width: int, new: Mapping[int, str], more: Sequence[str]) -> str:
    """A line of `width` cells with some `new` ones, and `more` cells appended."""
    parts, at = list[str](), 0
    for k, (begin, end) in enumerate(cell_spans(line, mark)[:width]):
        inside = begin > 0 and line[begin - 1] == '"' == line[end : end + 1]
        cell = line[begin:end]
        parts.append(line[at:begin])
        if k in new:
            quote = '"' * (mark in new[k] and not inside)
            parts.append(f"{quote}{new[k]}{quote}")
        else:
            parts.append(f"'{cell}" if runs(cell) else cell)
        at = end + inside
        parts.append('"' * inside)
    words = (word.replace(" ", "_") if mark == " " else word for word in more)
    return mark.join(["".join(parts), *(_quoted(word, mark) for word in words)])


def _number(value: float, comma: bool) -> str:
    """A number that reads back exactly."""
    text = repr(value + 0.0)
    return text.replace(".", ",") if comma else text


def _quoted(word: str, mark: str) -> str:
    """A new cell, quoted if necessary."""
    word = guarded(word)
    return '"' + word.replace('"', '""') + '"' if mark in word or '"' in word else word
