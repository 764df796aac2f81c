"""One process per run folder, by a lock that the system frees when its owner dies."""

import os
import sys
from datetime import datetime
from pathlib import Path
from typing import IO

from calib.errors import MachineError
from testbed.output.layout import LOCK


def acquire(folder: Path) -> IO[str]:
    """Open, locked ``run.lock`` of a folder; closing it frees the lock.

    Raises
    ------
    MachineError
        Another process holds it: its pid and since when.
    """
    file = (folder / LOCK).open("a+", encoding="utf-8")
    try:
        _lock(file)
    except OSError as error:
        file.seek(0)
        owner = file.read().strip() or "another process"
        file.close()
        raise MachineError(
            f"in use by {owner}",
            code="F8",
            where=str(folder),
            value=owner,
            fix="wait, or choose another --out",
        ) from error
    file.truncate(0)
    now = datetime.now().astimezone()
    file.write(f"process {os.getpid()} since {now:%H:%M}\n")
    file.flush()
    return file


def _lock(file: IO[str]) -> None:
    """Take the lock without waiting; OSError if another process has it."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**20)  # far behind the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
