"""Lines of long files that are enough to try readings with."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from testbed.gates.text import FileText
from testbed.proposal.data import Document, Found
from testbed.proposal.rows.clocks import REACH, beside_readings

TRIED = 300
"""Lines of one file that readings are tried with."""
MATCHED = 2000
"""Rows of several files above which they are tried with their first lines, too."""
SEEN = ("frames", "points", "ranges")


def beginnings(
    documents: Sequence[Document], looks: Sequence[Found], root: Path
) -> dict[tuple[Path, str | None], FileText]:
    """The text that sessions are tried with, of each file in a folder: of long ones a part."""
    texts = {(root / one.name, one.sheet): _beginning(one, looks) for one in looks}
    return texts | {(root / one.name, one.sheet): text for one, text in _logs(documents, looks)}


def _beginning(look: Found, looks: Sequence[Found]) -> FileText:
    """A file, or its first lines where it is long."""
    whole = len(looks) > 1 and max(one.rows for one in looks) <= MATCHED
    lines = look.text.lines if whole else look.text.lines[:TRIED]
    return replace(look.text, lines=lines)


def _logs(
    documents: Sequence[Document], looks: Sequence[Found]
) -> Iterator[tuple[Found, FileText]]:
    """Long logs of joints whose times bring them to readings: their rows about the first ones."""
    if max(one.rows for one in looks) <= MATCHED:
        return
    files = {(one.name, one.sheet): one for one in looks}
    for document in documents:
        if document.get("match") == "time":
            tables = [document[key] for key in ("joints", *SEEN) if key in document]
            log, seen = (files[one["file"], one.get("sheet")] for one in tables)
            yield log, beside_readings(log, seen, TRIED, document.get(REACH, 0.0))
