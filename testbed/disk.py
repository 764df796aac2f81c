"""Files and folders written whole or not at all, and one process per folder by a lock.

Locks are the system's, which frees them when a process dies. What is made gets the permissions that
the user's umask leaves, and a symbolic link is never followed where a file of ours is expected.
"""

import errno
import os
import re
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import IO

from calib.errors import MachineError

LOCK = "run.lock"
"""File whose lock says that a process writes into this folder."""
TEMPORARY = ".tmp"
"""Ending of a file or folder that is being written."""
_BEING_WRITTEN = re.compile(rf"\.(.+)\.[a-z0-9_]{{8}}{re.escape(TEMPORARY)}", re.DOTALL)


def beside(path: Path) -> Path:
    """A new name in the same folder for what will become `path`: ``.NAME.1a2b3c4d.tmp``."""
    return path.with_name(f".{path.name}.{os.urandom(4).hex()}{TEMPORARY}")


def becomes(name: str) -> str:
    """Name of what a file or folder named by `beside` was to become; empty for any other."""
    found = _BEING_WRITTEN.fullmatch(name)
    return found[1] if found else ""


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
    temporary = beside(path)
    try:
        temporary.touch(exist_ok=False)
        yield temporary
        flush_file(temporary)
        temporary.replace(path)
        flush_folder(path.parent)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
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


def read_bounded(path: Path, most: int) -> bytes:
    """The content of an ordinary file of at most `most` bytes; its size is seen before it is read.

    Raises
    ------
    OSError
        It cannot be read, is no ordinary file, or larger; `strerror` says which in words.
    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):  # to open a pipe would wait for ever
        raise OSError(errno.EINVAL, "it is not an ordinary file")
    if state.st_size <= most:
        with path.open("rb") as file:
            data = file.read(state.st_size + 1)  # a byte more if it grows meanwhile
        if len(data) <= most:
            return data
    found, allowed = (f"{size / 1e6:.6g} MB" for size in (state.st_size, most))
    raise OSError(errno.EFBIG, f"it has {found}, and at most {allowed} are read")


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
    """Remove the files that a killed process was writing in a folder of ours."""
    for path in folder.glob(f".*{TEMPORARY}"):
        with suppress(OSError):
            if becomes(path.name):
                path.unlink()


@contextmanager
def passing_folder(path: Path) -> Iterator[Path]:
    """A new folder beside `path`, to become it; removed with the block unless it was renamed.

    What killed processes were filling to become `path` is removed first: folders of that kind which
    no process holds locked.
    """
    for left in path.parent.glob(f".*{TEMPORARY}"):
        if becomes(left.name) == path.name and left.is_dir() and not left.is_symlink():
            lock = _lock_folder(left)
            if lock is not None:
                shutil.rmtree(left, ignore_errors=True)
                os.close(lock)
    folder = beside(path)
    folder.mkdir()
    lock = _lock_folder(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _lock_folder(folder: Path) -> int | None:
    """Handle that keeps a folder locked; None if another process does, or no lock is to be had.

    Windows locks no folders: what a killed process leaves there stays.
    """
    if sys.platform == "win32":
        return None
    import fcntl

    handle = None
    try:
        handle = os.open(folder, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        if handle is not None:
            os.close(handle)
        return None
    return handle


def unfollowed(path: str, flags: int) -> int:
    """Opener of a file that shall be ours: what a symbolic link points at is not opened.

    Nor is it waited for at the end of a pipe that nobody reads.
    """
    ours = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        return os.open(path, flags | ours, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            error.strerror = f"{Path(path).name} there is a symbolic link"
        raise


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says where a disk is full."""


def write_error(path: Path, error: OSError) -> MachineError:
    """What to tell about a write that failed."""
    full = error.errno in FULL
    reason = error.strerror or str(error)
    return MachineError(
        f"{path.name} cannot be written: {reason}",
        code="F3",
        where=str(path.parent),
        field=path.name,
        fix=f"{'free some space' if full else 'correct that'}, then give the command again; "
        "a run goes on with --resume",
    )


def acquire(folder: Path, *, shared: bool = False) -> IO[str]:
    """Open, locked ``run.lock`` of a folder; closing it frees the lock.

    A shared lock keeps out who wants the folder alone, and lets in who would share it, too.

    Raises
    ------
    MachineError
        Another process holds it: its pid and since when.
    """
    file = open(folder / LOCK, "a+", encoding="utf-8", opener=unfollowed)  # noqa: SIM115  # open as long as it locks
    try:
        _lock(file, shared=shared)
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


def _lock(file: IO[str], *, shared: bool) -> None:
    """Take the lock without waiting; OSError if another process has it.

    Windows shares none: there every slice needs a folder of its own.
    """
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**20)  # far behind the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
