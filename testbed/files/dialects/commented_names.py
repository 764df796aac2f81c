"""Comments: those that begin with a semicolon, and one that names columns, as by numpy.savetxt."""

import re
from dataclasses import replace

from testbed.files.columns import WRITTEN
from testbed.files.dialects.numbers import NUMBER
from testbed.gates.text import FileText, separator_of, split

MARK = "#"
FEWEST = 3
AXIS = re.compile(
    r"(.*[\s_.\-])?(r?[xyz]|[pt][xyz]|q[wxyz]|(q|j|a|joint|axis|theta|th)[\s_]*\d)"
    r"([\s_.\-\[(].*)?"
)
"""Names of coordinates, rotations and joints, whatever stands before them or in brackets behind."""


def with_commented_names(text: FileText) -> FileText:
    """A file whose columns are named in a comment right above its numbers, without that mark.

    Such a line has a name for each number below it, of which some are coordinates or joints. A line
    of units below it loses its mark as well. Other files come back as they are.
    """
    content = text.content(MARK)
    if not content:
        return text
    first, line = content[0]
    mark = separator_of(line)
    cells = split([(first, line)], mark, text.where)[0] if '"' not in line else []
    while cells and not cells[-1]:
        cells.pop()
    numbers = sum(bool(NUMBER.fullmatch(cell)) for cell in cells)
    if 2 * numbers < len(cells) or numbers < FEWEST:
        return text
    above, at = dict[int, str](), first - 1
    while at >= 1 and text.lines[at - 1].lstrip().startswith(MARK):
        bare = text.lines[at - 1].strip().lstrip(MARK).strip()
        names = [name.strip() for name in split([(at, bare)], mark, text.where)[0]]
        if len(names) != len(cells) or any(map(NUMBER.fullmatch, names)):
            break
        above[at] = bare
        known = sum(bool(AXIS.fullmatch(name.lower())) for name in names)
        if known >= FEWEST and len(set(names)) > 1:
            lines = (above.get(k, own) for k, own in enumerate(text.lines, 1))
            return replace(text, lines=tuple(lines))
        if not all(name.strip("[]()").lower() in WRITTEN for name in names if name):
            break
        at -= 1
    return text


def with_marked_comments(text: FileText) -> FileText:
    """A file with the mark of comments before lines that begin with a semicolon.

    Controllers write comments so. No other line has a semicolon then: else it separates cells.
    """
    begun = [line.lstrip().startswith(";") for line in text.lines]
    lines = list(zip(text.lines, begun, strict=True))
    if not any(begun) or any(";" in line for line, own in lines if not own):
        return text
    return replace(text, lines=tuple(f"{MARK}{line}" if own else line for line, own in lines))
