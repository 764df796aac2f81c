"""Files that are whole or absent: temporary name, flush to disk, rename."""

import errno
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from calib.errors import MachineError
from testbed.output.layout import TEMPORARY


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
