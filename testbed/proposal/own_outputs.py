"""Files that this program wrote among those of a user, as a pattern such as *.json names them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from testbed.disk import read_bounded
from testbed.files.dialects.records import is_records
from testbed.files.refusal import refusal
from testbed.gates.paths import is_there
from testbed.schemas.names import TITLE
from testbed.store.npz import MOST_JSON
from testbed.units import listed

SCHEMA, RESULT = "a JSON Schema for editors", "a result"
WROTE = "that truebed wrote, no measurements"


def what_we_wrote(path: Path) -> str:
    """What a JSON file of this program is, by what stands in it; empty where it is none."""
    if not is_records(path) or not is_there(path, Path.is_file):
        return ""
    try:
        document: Any = json.loads(read_bounded(path, MOST_JSON))
    except (OSError, ValueError, RecursionError):  # reading it for a table says why
        return ""
    if not isinstance(document, dict):
        return ""
    if "$schema" in document and str(document.get("title", "")).startswith(f"{TITLE}: "):
        return SCHEMA
    versions = document.get("versions")
    made = isinstance(versions, dict) and TITLE in versions
    said = "format" in document and isinstance(document.get(TITLE), str)
    return RESULT if made or said else ""


def without_ours(paths: Sequence[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Files that may hold measurements, and a sentence on each of the others.

    Raises
    ------
    InputError
        S39: there are no others.
    """
    ours = {path: what for path in paths if (what := what_we_wrote(path))}
    said = tuple(f"{path.name}: {what} {WROTE}" for path, what in ours.items())
    left = [path for path in paths if path not in ours]
    if not left and said:
        names = listed([str(path) for path in ours])
        kinds = listed([*dict.fromkeys(ours.values())])
        message = f"{'is' if len(ours) == 1 else 'are'} {kinds} {WROTE}"
        raise refusal(names, "DATA", message, code="S39", fix="give what was measured")
    return left, said
