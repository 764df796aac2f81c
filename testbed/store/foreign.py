"""A folder that no verb wrote as a whole: what it is, and what to type instead."""

import os
import shlex
from itertools import islice
from pathlib import Path

from testbed.gates.paths import is_there
from testbed.names import some
from testbed.store.layout import ISO9283, MANIFEST, OWNERS, PLAN, SCENARIO

MOST, SHOWN = 1000, 4
"""Entries that are looked at, and that are named."""
ABOVE = 3
"""Folders above, of which one may be what was meant."""
TABLES = (".csv", ".tsv", ".xlsx")
"""Endings of files that are tables."""
WROTE = "give a folder that truebed wrote"


def foreign(path: Path) -> tuple[str, str]:
    """What a folder that is not what was wanted is, and what to do, in words.

    Parameters
    ----------
    path : Path
        A folder, or none.
    """
    if not is_there(path, Path.is_dir):
        return "it is not there", WROTE
    for mark in (MANIFEST, PLAN, ISO9283):
        if is_there(path / mark, Path.is_file):
            return (
                f"it is {OWNERS[mark]}",
                f"to open it, type truebed view {shlex.quote(str(path))}",
            )
    for above in (Path(os.path.normpath(path / ("../" * k))) for k in range(1, ABOVE + 1)):
        for mark in (MANIFEST, PLAN, ISO9283):
            if is_there(above / mark, Path.is_file):
                return f"it lies inside {above}, {OWNERS[mark]}", (f"give {above}")
    names = sorted(one.name for one in islice(path.iterdir(), MOST) if not one.name.startswith("."))
    if not names:
        return "it is empty", WROTE
    told, fix = f"it holds {some(names, SHOWN)}", WROTE
    if SCENARIO in names:
        place = shlex.quote(str(path / SCENARIO))
        fix = f"to play its scenario, type truebed run {place} --out NEW_FOLDER"
    elif tables := [name for name in names if Path(name).suffix.lower() in TABLES]:
        place = shlex.quote(str(path / tables[0]))
        fix = f"to calibrate from measurements, type truebed new session {place}"
    return told, fix
