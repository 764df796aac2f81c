"""Lines that name each of their numbers, as logs of controllers do, as a table.

``{E6AXIS: A1 10.0, A2 -90.0}``, ``J1=10.0 deg, J2=-90.0 deg``, ``"q1": 0.1, "q2": -1.5``.
"""

import re
from dataclasses import replace

from testbed.gates.text import FileText

NAME, NUMBER = r"[^\W\d]\w{0,30}+", r"[-+\u2212]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][-+]?\d++)?+"
UNIT = "°|deg|degrees|rad|mrad|mm|m|in"
PAIR = re.compile(
    rf"\"?({NAME})\"?(?:\s*+[:=]\s*+|\s++)({NUMBER})(?:\s*+({UNIT}))?(?=[,;|\s}})\]]|$)"
)
"""A name, its number, and perhaps a unit."""
BEFORE = re.compile(r"[^=,;:]{1,40}+:")
"""What may stand before the first name of all lines, as ``E6AXIS:``."""
OPENS, CLOSES, BETWEEN = " \t{[(", " \t}]),;", re.compile(r"[,;|\s]*+")
FEWEST = 3
"""Names of a line, and lines of a file."""

Row = list[tuple[str, str, str]]
"""Name, number and unit of each pair."""


def with_named_numbers(text: FileText) -> FileText:
    """A file all of whose rows name the same numbers, as a table; others as they come.

    The line of names has the number 0, so that rows keep theirs.
    """
    rows: dict[int, Row] = {}
    heads = set()
    for number, line in text.content("#"):
        before, row = _row(line)
        heads.add((before, tuple((name, unit) for name, _, unit in row)))
        if not row or len(heads) > 1:
            return text
        rows[number] = row
    _, head = heads.pop() if heads else ("", ())
    if len(rows) < FEWEST or len({name for name, _ in head}) < len(head):
        return text
    names = [f"{name} [{unit}]" if unit else name for name, unit in head]
    lines = [""] * len(text.lines)
    for number, row in rows.items():
        lines[number - 1] = "\t".join(cell for _, cell, _ in row)
    return replace(text, lines=("\t".join(names), *lines), first=0)


def _row(line: str) -> tuple[str, Row]:
    """What stands before the pairs of a line, and these; none where it holds anything else."""
    line, before = line.strip(OPENS + CLOSES), ""
    found, at = _pairs(line)
    if not found and (said := BEFORE.match(line)) is not None:
        before, line = said[0], line[said.end() :].lstrip(OPENS)
        found, at = _pairs(line)
    return before, found if at == len(line) and len(found) >= FEWEST else []


def _pairs(line: str) -> tuple[Row, int]:
    """Pairs from the beginning of a line on, and where they end."""
    found, at = Row(), 0
    while (pair := PAIR.match(line, at)) is not None:
        found.append((pair[1], pair[2], pair[3] or ""))
        gap = BETWEEN.match(line, pair.end())
        at = gap.end() if gap is not None else pair.end()
    return found, at
