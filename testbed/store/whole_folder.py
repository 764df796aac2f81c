"""Where a verb may write, never over another in silence; a folder that appears whole or not."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path

from calib.errors import InputError, refuse
from testbed.disk import FULL, acquire, flush_file, flush_folder, passing_folder, write_error
from testbed.machine import SCARCE, ran_out
from testbed.store import layout

ANOTHER = "choose another --out"


@contextmanager
def whole_folder(path: Path, marker: str, *, overwrite: bool = False) -> Iterator[Path]:
    """A folder beside `path` to be filled, which becomes `path` when the block ends well.

    With `overwrite` an old one there, known by its `marker`, is renamed, never removed. On any
    exception nothing is left.

    Raises
    ------
    InputError
        `path` cannot be used.
    MachineError
        The disk is full, or another process is writing there.
    """
    check_free(path, marker, overwrite=overwrite)
    real = real_folder(path)
    try:
        with _folders_above(real), passing_folder(real) as temporary:
            yield temporary
            for file in temporary.rglob("*"):
                if file.is_file():
                    flush_file(file)
            check_free(path, marker, overwrite=overwrite)
            if real.exists():
                if is_empty(real):
                    temporary.chmod(real.stat().st_mode)  # the user's folder, the user's choice
                make_way(real)
            temporary.rename(real)
            flush_folder(real.parent)
    except OSError as error:
        raise write_error(path, error) from error


def check_free(path: Path, marker: str, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written as a whole, before anything is computed.

    Raises
    ------
    InputError
        Something is there that is not ours to move, or nothing can be written there.
    MachineError
        Another process is writing there.
    """
    with writing(path):
        if path.exists() and not is_empty(path):
            check_movable(path, marker, overwrite=overwrite)
        real = real_folder(path)
        with _folders_above(real), passing_folder(real):
            pass


@contextmanager
def _folders_above(path: Path) -> Iterator[None]:
    """Make the folders that `path` shall lie in; those made are removed if they stay empty."""
    made = list(takewhile(lambda folder: not folder.exists(), path.parents))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for folder in made:
            with suppress(OSError):  # filled, or never made
                folder.rmdir()


def real_folder(path: Path) -> Path:
    """The folder itself where `path` is a symbolic link to one, or not its own name.

    Raises
    ------
    OSError
        The link leads back to itself.
    """
    if path.name not in ("", "..") and not path.is_symlink():
        return path
    real = Path(os.path.realpath(path))
    if real.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return real


def is_empty(path: Path) -> bool:
    """Whether it is a folder with nothing in it."""
    return path.is_dir() and not any(path.iterdir())


def check_movable(path: Path, marker: str, *, overwrite: bool, resumable: bool = False) -> None:
    """Refuse anything but an old folder of its kind that may be renamed."""
    if (path / layout.LOCK).is_file():
        with suppress(OSError):
            acquire(path).close()  # MachineError while another process is writing there
    if not path.is_dir():
        allowed = "the run folder must be new" if resumable else ""
        raise _unusable(path, "is a file", allowed)
    if not overwrite:
        ways = (
            ", go on with --resume, or rename the old one with --overwrite"
            if resumable
            else ", or rename the old one by --overwrite"
        )
        raise _unusable(path, "exists already", fix=ANOTHER + ways)
    if not (path / marker).is_file():
        raise _unusable(path, f"is not {layout.OWNERS[marker]} and will not be renamed")


def make_way(path: Path) -> None:
    """Remove an empty folder; rename an old one to the first free ``<name>.old-<k>``."""
    if is_empty(path):
        path.rmdir()
        return
    number = 1
    while (new := path.with_name(f"{path.name}.old-{number}")).exists():
        number += 1
    path.rename(new)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """A block whose errors say that nothing can be written at --out, or that the disk is full."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        if isinstance(error, OSError) and error.errno in (*FULL, *SCARCE):
            raise ran_out(error) or write_error(path, error) from error
        reason = getattr(error, "strerror", None) or error
        raise _unusable(path, f"cannot be written: {reason}") from error


def _unusable(path: Path, message: str, allowed: str = "", *, fix: str = ANOTHER) -> InputError:
    """The error for a --out that cannot be used."""
    return refuse("--out", None, allowed, code="C40", message=message, fix=fix, where=str(path))
