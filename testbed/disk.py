"""Files written whole or not at all, and one process per folder by a lock the system frees."""

import errno
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import IO

from calib.errors import MachineError

LOCK = "run.lock"
"""File whose lock says that a process writes into this folder."""
TEMPORARY = ".tmp"
"""Ending of a file that is being written."""


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path in the same folder that becomes `path` when the block ends well.

    A reader, or a run that goes on after a crash, sees the old file or the new one, never half of
    one. On any exception the temporary file is removed and `path` stays as it was.

    Raises
    ------
    MachineError
        The disk is full or the folder cannot be written.
    """
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(TEMPORARY, f".{path.name}.", path.parent)
        temporary = Path(name)
        os.close(handle)
        yield temporary
        flush_file(temporary)
        temporary.chmod(0o644)
        temporary.replace(path)
        flush_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def atomic_write(path: Path, data: bytes) -> None:
    """Write `data` so that `path` is the old file or the new one, never half."""
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(data)


def keep_or_write(path: Path, data: bytes) -> None:
    """Write `data` unless `path` holds exactly that already; then its time stamp stays."""
    try:
        same = path.stat().st_size == len(data) and path.read_bytes() == data
    except OSError:
        same = False
    if not same:
        atomic_write(path, data)


def flush_file(path: Path) -> None:
    """Force a file's bytes to the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def flush_folder(folder: Path) -> None:
    """Force a rename in a folder to the disk (POSIX only)."""
    if sys.platform == "win32":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files that a killed process left behind."""
    for path in folder.glob(f".*{TEMPORARY}"):
        with suppress(OSError):
            path.unlink()


def write_error(path: Path, error: OSError) -> MachineError:
    """What to tell about a write that failed."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    reason = error.strerror or str(error)
    return MachineError(
        f"{path.name} cannot be written: {reason}",
        code="F3",
        where=str(path.parent),
        field=path.name,
        fix=f"{'free some space' if full else 'mend that'}, then give the command again; "
        "a run goes on with --resume",
    )


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
            f"in use by {owner}", code="F8", where=str(folder), value=owner,
            fix="wait, or choose another --out",
        ) from error  # fmt: skip
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
