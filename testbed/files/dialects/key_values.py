"""Lines that name each of their numbers, as logs of controllers do, as a table.

``{E6AXIS: A1 10.0, A2 -90.0}``, ``J1=10.0 deg, J2=-90.0 deg``, ``"q1": 0.1, "q2": -1.5``.
"""

import re
from collections.abc import Iterator
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
WORDS = re.compile(r"[\s=;{]+")
CLOCK, DAY = re.compile(r"\d{1,2}:\d{2}\S*"), re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
OPENS, CLOSES, BETWEEN = " \t{[(", " \t}]),;", re.compile(r"[,;|\s]*+")
LONGEST = 60
"""Letters that may stand before the numbers."""
FEWEST = 3
"""Names of a line, and lines of a file."""

Row = list[tuple[str, str, str]]
"""Name, number and unit of each pair."""


def with_named_numbers(text: FileText) -> FileText:
    """A file all of whose rows name the same numbers, as a table; others as they come.

    A name may stand before them, or a time, or both a day and a time. The line of names has the
    number 0, so that rows keep theirs.
    """
    rows: dict[int, Row] = {}
    words, heads = list[list[str]](), set()
    for number, line in text.content("#"):
        before, row = _row(line)
        heads.add(tuple((name, unit) for name, _, unit in row))
        words.append(_words(before))
        if not row or len(heads) > 1 or len(words[-1]) != len(words[0]):
            return text
        rows[number] = row
    head = heads.pop() if heads else ()
    if len(rows) < FEWEST or len({name for name, _ in head}) < len(head):
        return text
    told = [cells for cells in zip(*words, strict=True) if len({*cells}) > 1]
    clocks = [all(map(CLOCK.search, cells)) for cells in told]
    if len(told) > 2 or clocks.count(True) > 1 or clocks.count(False) > 1:
        return text
    names = ["time" if clock else "name" for clock in clocks]
    names += [f"{name} [{unit}]" if unit else name for name, unit in head]
    lines = [""] * len(text.lines)
    for k, (number, row) in enumerate(rows.items()):
        cells = (*(column[k] for column in told), *(cell for _, cell, _ in row))
        lines[number - 1] = "\t".join(cells)
    return replace(text, lines=("\t".join(names), *lines), first=0)


def _words(before: str) -> list[str]:
    """What stands before the numbers of a line, a day and the time behind it as one."""
    words = [word.rstrip(":") for word in WORDS.split(before) if word]
    for k in range(len(words) - 1, 0, -1):
        if CLOCK.fullmatch(words[k]) and DAY.fullmatch(words[k - 1]):
            words[k - 1 : k + 1] = [f"{words[k - 1]} {words[k]}"]
    return words


def _row(line: str) -> tuple[str, Row]:
    """What stands before the pairs of a line, and these; none where it holds anything else."""
    line = line.strip(OPENS + CLOSES)
    for at in _beginnings(line):
        rest = line[at:].lstrip(OPENS)
        said = BEFORE.match(rest)
        for part in (rest, rest[said.end() :].lstrip(OPENS) if said is not None else ""):
            found, end = _pairs(part)
            if found and end == len(part) and len(found) >= FEWEST:
                return line[: len(line) - len(part)], found
    return "", []


def _beginnings(line: str) -> Iterator[int]:
    """Where the pairs of a line may begin: with it, behind a brace, or behind its first word."""
    yield 0
    if (brace := line.find("{", 0, LONGEST)) > 0:
        yield brace
    elif (blank := line.find(" ", 0, LONGEST)) > 0:
        yield blank


def _pairs(line: str) -> tuple[Row, int]:
    """Pairs from the beginning of a line on, and where they end."""
    found, at = Row(), 0
    while (pair := PAIR.match(line, at)) is not None:
        found.append((pair[1], pair[2], pair[3] or ""))
        gap = BETWEEN.match(line, pair.end())
        at = gap.end() if gap is not None else pair.end()
    return found, at
