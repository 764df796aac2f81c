"""Programs of KUKA beside their data lists, which hold the joints of inline forms."""

import re
from collections.abc import Sequence
from pathlib import Path

from testbed.disk import read_bounded
from testbed.gates.paths import is_there
from testbed.gates.text import MAX_MB

AXES = re.compile(rb"\b(E6)?AXIS\s+\w+\s*=\s*\{", re.IGNORECASE)


def without_programs(paths: Sequence[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Files without each .src whose .dat is given as well and has joints, and a sentence on each.

    Names match the two, so that the order of the moves is not needed.
    """
    lists = {path.stem.lower(): path for path in paths if _has_axes(path)}
    aside = {
        path: lists[path.stem.lower()] for path in paths
        if path.suffix.lower() == ".src" and path.stem.lower() in lists
    }  # fmt: skip
    said = tuple(
        f"{path.name}: the joints of its moves stand in {own.name}, in the order of that list"
        for path, own in aside.items()
    )
    return [path for path in paths if path not in aside], said


def _has_axes(path: Path) -> bool:
    """Whether a file is a data list with joint targets."""
    if path.suffix.lower() != ".dat" or not is_there(path, Path.is_file):
        return False
    return AXES.search(read_bounded(path, int(1e6 * MAX_MB))) is not None
