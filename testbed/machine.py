"""Room that a process may still take of the machine, and the error that says it has run out.

Numerical libraries and Rerun abort the whole process where the system refuses them memory or files
while they start, and nothing could be told any more: so it is asked for first.
"""

import errno
import mmap
import os
import sys
from dataclasses import dataclass

from calib.errors import MachineError

SCARCE = (errno.ENOMEM, errno.EMFILE, errno.ENFILE)
"""What the system says where memory or open files have run out."""

LONGEST = 200
"""Number of characters of another package's message that are passed on."""


@dataclass(frozen=True, slots=True)
class Room:
    """What a piece of work needs beside what the process has."""

    megabytes: int
    """Of address space [MB], most of which is never touched."""
    files: int
    """Open at the same time."""


LOOKING = Room(700, 16)
"""The command itself, and verbs that look: numpy, scipy and matplotlib took 430 MB."""
RECORDING = Room(3500, 10)
"""A recording: 2900 MB were taken, reserved in large pieces for each thread of Rerun."""
COMPUTING = Room(4500, 24)
"""A verb that computes and then records."""


def require_room(room: Room) -> None:
    """Refuse work that the machine has no room for.

    Raises
    ------
    MachineError
        F10: memory or files are limited to less, by ``ulimit`` or by what there is.
    """
    handles: list[int] = []
    try:
        while len(handles) < room.files:
            handles.append(os.open(os.devnull, os.O_RDONLY))
        if sys.platform != "win32":
            # readable only, so that it counts against limits but takes no memory
            kind = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
            mmap.mmap(-1, room.megabytes * 10**6, flags=kind, prot=mmap.PROT_READ).close()
    except OSError as error:
        raise ran_out(error, room) or error from error
    finally:
        for handle in handles:
            os.close(handle)


def ran_out(error: BaseException | None, room: Room | None = None) -> MachineError | None:
    """What to tell if memory or files had run out when `error` came about; else None.

    Parameters
    ----------
    error : BaseException, optional
        With the errors that it came from.
    room : Room, optional
        That was asked for.
    """
    seen: set[int] = set()
    while error is not None and id(error) not in seen:  # causes may lead back to where they began
        seen.add(id(error))
        number = error.errno if isinstance(error, OSError) else None
        if number in (errno.EMFILE, errno.ENFILE):
            needed = f" ({room.files} at once)" if room else ""
            message = f"more files must be open{needed} than the system allows"
            return MachineError(message, code="F10", fix="raise `ulimit -n`, then try again")
        if number == errno.ENOMEM or isinstance(error, MemoryError):
            needed = f" ({room.megabytes} MB of address space)" if room else ""
            message = f"more memory is needed{needed} than the system allows"
            fix = "close other programs or raise `ulimit -v`, then try again"
            return MachineError(message, code="F10", fix=fix)
        error = error.__cause__ or error.__context__
    return None


def lacking(error: BaseException) -> MachineError | None:
    """What to tell if a package of another house is not installed, or does not load; else None."""
    name = error.name if isinstance(error, ImportError) and error.name else "testbed"
    package = name.partition(".")[0]
    if package in ("calib", "testbed", "truebed"):
        return None
    if not isinstance(error, ModuleNotFoundError):
        message = f"the package {package} cannot be loaded: {str(error)[:LONGEST]}"
        return MachineError(message, code="F13", fix=f"pip install --force-reinstall {package}")
    fix = "pip install truebed brings it; `import calib` does without"
    return MachineError(f"the package {package} is not installed", code="F13", fix=fix)
