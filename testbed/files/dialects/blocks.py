"""Reports that give each point a block of lines, as those of measuring arms: a row for each point.

Either each axis has a line (``X  1.0  1.1  -0.1`` below ``Actual  Nominal  Deviation``, or
``X = 1.0`` alone), or each kind of number has one (``Actual  1.0  2.0  3.0`` below ``X  Y  Z``).
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from testbed.files.columns import WRITTEN
from testbed.files.dialects.numbers import NUMBER
from testbed.files.refusal import refusal
from testbed.gates.text import FileText
from testbed.units import counted

BEHIND = r"(?:\s*+[:=](?=[\s;])|(?=[\s;]))[\s;]*+([-+\u2212\d][-+\u2212\d.,eE\s;]*)$"
"""Numbers behind a name; no blank is tried twice, so that long lines of them take no time."""
OF_AXIS = re.compile(r"\s*+([XYZ])" + BEHIND)
AXES = re.compile(r"\s*+X[\s;,]+Y[\s;,]+Z[\s;,]*$")
OF_KIND = re.compile(r"\s*+([^\W\d][\w.]*+)" + BEHIND)
CALLED = re.compile(r"\s*+(?:point|feature|name|label|id)\b\s*+[:=]?+\s*+(?=\S)", re.IGNORECASE)
UNIT = re.compile(r"\bunits?\s*+[:=]?+\s*+\(?+\s*+([a-zµ]+)", re.IGNORECASE)
BETWEEN = re.compile(r"[\s;]+")
FIRST = 200
"""Lines among which the first block is."""
FEWEST, MOST_TITLES = 3, 6
"""Blocks of a report, and lines of words above each."""


@dataclass(frozen=True, slots=True)
class _Block:
    """Numbers of one point, and the lines that they stand in."""

    first: int
    last: int
    """Places in the content of the file, the line of heads counted."""
    kinds: tuple[str, ...]
    """Actual, Nominal ...; "" where there is only one number of each axis."""
    cells: tuple[str, ...]
    """Three of each kind."""


def with_block_rows(text: FileText) -> FileText:
    """A report in blocks as a table, its rows in the last lines of the blocks; others as they come.

    All blocks have the same shape and as many lines of words above them, the first of which is the
    name of the point.

    Raises
    ------
    InputError
        M35: most of the file is such blocks, and one of them has another shape, or another unit.
    """
    if not any(OF_AXIS.match(line) or AXES.match(line) for line in text.lines[:FIRST]):
        return text
    content = text.content("#")
    blocks = list(_blocks([line for _, line in content]))
    inside = sum(one.last - one.first + 2 for one in blocks)  # with a name each
    if len(blocks) < FEWEST or 2 * inside < len(content):
        return text
    above = [one.first - before.last - 1 for before, one in pairwise(blocks)]
    titles = Counter(above).most_common(1)[0][0]
    above = [min(blocks[0].first, titles), *above]
    shape = Counter(one.kinds for one in blocks).most_common(1)[0][0]
    for one, count in zip(blocks, above, strict=True):
        if (one.kinds, count) != (shape, titles) or not 0 < titles <= MOST_TITLES:
            raise refusal(
                f"{text.where}:{content[one.first][0]}", "file",
                f"the block of a point has {counted(count, 'line')} of words above it and "
                f"{counted(len(one.cells), 'number')}; most have {titles} and {3 * len(shape)}",
                fix="give each point the same lines, or export a table with a line for each point",
            )  # fmt: skip
    told = {WRITTEN[word]: number for number, line in content for word in _units_in(line)}
    if len(told) > 1:
        raise refusal(
            f"{text.where}:{max(told.values())}", "file", f"states {' and '.join(told)}",
            code="M21", fix="export all points in one unit",
        )  # fmt: skip
    unit = f" [{next(iter(told))}]" if told else ""
    head = ["Name", *(f"{kind} {axis}{unit}".strip() for kind in blocks[0].kinds for axis in "XYZ")]
    lines = [""] * len(text.lines)
    lines[content[blocks[0].first - titles][0] - 1] = "\t".join(head)
    for one in blocks:
        name = CALLED.sub("", content[one.first - titles][1], count=1)
        row = [" ".join(name.split()), *one.cells]
        lines[content[one.last][0] - 1] = "\t".join(row)
    return replace(text, lines=tuple(lines))


def _units_in(line: str) -> list[str]:
    """The unit that a line states; none where it states no known one."""
    found = UNIT.search(line)
    return [found[1].lower()] if found is not None and found[1].lower() in WRITTEN else []


def _blocks(lines: Sequence[str]) -> Iterator[_Block]:
    """Blocks of a report, in their order."""
    k = 0
    while k < len(lines):
        found = _of_axes(lines, k) or _of_kinds(lines, k)
        if found is not None:
            yield found
            k = found.last
        k += 1


def _of_axes(lines: Sequence[str], k: int) -> _Block | None:
    """Lines X, Y and Z from k on, below one that names their numbers if there are several."""
    three = [OF_AXIS.match(line) for line in lines[k : k + 3]]
    rows = [(one[1], _numbers(one[2])) for one in three if one is not None]
    if [axis for axis, _ in rows] != ["X", "Y", "Z"] or len({len(row) for _, row in rows}) > 1:
        return None
    count = len(rows[0][1])
    kinds = BETWEEN.split(lines[k - 1].strip()) if count > 1 and k else [""]
    if not count or len(kinds) != count or any(map(NUMBER.fullmatch, kinds)):
        return None
    cells = tuple(row[n] for n in range(count) for _, row in rows)
    return _Block(k - (count > 1), k + 2, tuple(kinds), cells)


def _of_kinds(lines: Sequence[str], k: int) -> _Block | None:
    """A line X Y Z at k, and those of each kind below it."""
    if not AXES.match(lines[k]):
        return None
    kinds, cells = list[str](), list[str]()
    for line in lines[k + 1 :]:
        one = OF_KIND.match(line)
        numbers = _numbers(one[2]) if one is not None else []
        if one is None or len(numbers) != 3:
            break
        kinds.append(one[1])
        cells += numbers
    return _Block(k, k + len(kinds), tuple(kinds), tuple(cells)) if kinds else None


def _numbers(part: str) -> list[str]:
    """Numbers of a part of a line; none where some are not."""
    cells = [cell for cell in BETWEEN.split(part.strip()) if cell]
    return cells if all(map(NUMBER.fullmatch, cells)) else []
