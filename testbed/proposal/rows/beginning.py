"""First lines of long files, which are enough to try interpretations."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from testbed.gates.text import FileText
from testbed.proposal.data import Document, Found, files_of
from testbed.proposal.rows.clocks import OFFSET, REACH, beside_readings

TRIED = 300
"""Number of lines of one file with which interpretations are tried."""
MATCHED = 2000
"""Number of rows of several files above which only their first lines are tried as well."""
SEEN = ("frames", "points", "ranges")


def beginnings(
    documents: Sequence[Document], looks: Sequence[Found], root: Path
) -> dict[tuple[Path, str | None], FileText]:
    """The text of each file in a folder with which sessions are tried; a part of long ones."""
    texts = {(root / one.name, one.sheet): _beginning(one, looks) for one in looks}
    return texts | {(root / one.name, one.sheet): text for one, text in _logs(documents, looks)}


def _beginning(look: Found, looks: Sequence[Found]) -> FileText:
    """A file, or its first lines if it is long."""
    whole = len(looks) > 1 and max(one.rows for one in looks) <= MATCHED
    lines = look.text.lines if whole else look.text.lines[:TRIED]
    return replace(look.text, lines=lines)


def _logs(
    documents: Sequence[Document], looks: Sequence[Found]
) -> Iterator[tuple[Found, FileText]]:
    """Long logs of joints that are matched to readings by time: rows near the first ones."""
    if max(one.rows for one in looks) <= MATCHED:
        return
    files = {(one.name, one.sheet): one for one in looks}
    for document in documents:
        if document.get("match") == "time":
            tables = [document[key] for key in ("joints", *SEEN) if key in document]
            log, seen = (files[files_of(one)[0], one.get("sheet")] for one in tables)
            ahead = document["joints"].get(OFFSET, 0.0)
            yield log, beside_readings(log, seen, TRIED, document.get(REACH, 0.0), ahead)
