"""Exports of Qualisys, whose header names each marker once: a name for each of its columns."""

from dataclasses import replace

from testbed.files.dialects.numbers import NUMBER
from testbed.gates.text import FileText

NAMES, TYPES = "MARKER_NAMES", "TRAJECTORY_TYPES"
FIRST = 30
"""Lines among which the header is."""
CLOCK = ("Frame", "Time (s)")
"""Columns before those of the markers, in exports that were told to write them."""


def with_marker_columns(text: FileText) -> FileText:
    """An export whose line of markers names their columns, in mm; other files as they come.

    Newer exports have such a line themselves, which stays.
    """
    first = text.lines[:FIRST]
    at = next((k for k, line in enumerate(first) if line.startswith(f"{NAMES}\t")), None)
    if at is None:
        return text
    types = at + 1 < len(first) and first[at + 1].startswith(TYPES)
    row = first[at + 1 + types].split("\t") if at + 1 + types < len(first) else []
    markers = first[at].strip().split("\t")[1:]
    cells = [cell.strip() for cell in row]
    own = [f"{marker} {axis} (mm)" for marker in markers for axis in "XYZ"]
    while len(cells) > len(own) and not cells[-1]:
        cells.pop()
    before = len(cells) - len(own)
    if before not in (0, len(CLOCK)) or not NUMBER.fullmatch(cells[0]):
        return text
    head = "\t".join([*CLOCK[:before], *own])
    named = [head, *[f"# {first[at + 1]}"] * types]
    return replace(text, lines=(*text.lines[:at], *named, *text.lines[at + 1 + types :]))
