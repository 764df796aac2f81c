"""Pieces that take no time and need no package: a process which plays them is there at once.

Faults are told by files in a folder: ``3.die once`` kills the process that plays piece 3 and is
gone, ``3.die always`` stays; so do ``raise`` (no result) and ``wait``, which plays nothing until
its file is removed.
"""

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path


@dataclass(frozen=True)
class Toy:
    """A piece of nothing."""

    name: str


@dataclass(frozen=True)
class ToyKit:
    """A folder with faults."""

    folder: Path

    @property
    def data(self) -> bytes:
        return str(self.folder).encode()


def toys(count: int) -> list[Toy]:
    return [Toy(str(k)) for k in range(count)]


def play(kit: bytes, piece: Toy) -> bytes:
    """What a process is asked for."""
    folder = Path(kit.decode())
    (folder / f"{piece.name}.pid").write_text(str(os.getpid()))
    for what, often in product(("die", "raise", "wait"), ("once", "always")):
        fault = folder / f"{piece.name}.{what} {often}"
        if not fault.exists():
            continue
        if often == "once":
            fault.unlink()
        if what == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "raise":
            raise ImportError("a library that is not there today")
        while fault.exists():
            time.sleep(0.01)
    return f"{piece.name} of {folder}".encode()


def expected(kit: ToyKit, pieces: Sequence[Toy]) -> dict[str, bytes]:
    return {piece.name: f"{piece.name} of {kit.folder}".encode() for piece in pieces}


def alive(pid: int) -> bool:
    """Whether a process is there, and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def gone(pids: Sequence[int], seconds: float = 20.0) -> bool:
    """Whether processes end within some time."""
    end = time.monotonic() + seconds
    while any(map(alive, pids)) and time.monotonic() < end:
        time.sleep(0.02)
    return not any(map(alive, pids))


def family(pid):
    """A process and all below it."""
    found = [pid]
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rsplit(")", 1)[1].split()[1]) == pid:
                found += family(int(path.parent.name))
        except (OSError, ValueError):
            continue
    return found
