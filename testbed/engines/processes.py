"""Processes of this machine: they end with the one that began them, and may be killed.

A child watches a pipe to its parent and ends when that closes: when the run ends, is stopped, or
dies. Where a child dies, all pieces in flight are played again, one at a time, so that it is known
which of them it was.
"""

import os
import signal
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection
from tempfile import TemporaryDirectory
from threading import Thread
from typing import TYPE_CHECKING

from calib.errors import CalibError

if TYPE_CHECKING:  # a child loads what it plays, and nothing for this
    from testbed.engines.kit import Kit
    from testbed.engines.piece import Piece

TRIES = 3
"""Deaths of a process, or errors that are no result, after which a piece is given up."""


class Processes:
    """So many processes, each with one piece at a time.

    Parameters
    ----------
    workers : int
        How many at most.
    call : callable
        What a process is asked for: from a kit's bytes and a piece the bytes of its file.
    """

    def __init__(self, workers: int, call: "Callable[[bytes, Piece], bytes]") -> None:
        self._workers, self._call = workers, call
        self._pool: ProcessPoolExecutor | None = None
        self._life: Connection | None = None
        """Its end closes where the processes shall end."""
        self._room: TemporaryDirectory[str] | None = None
        """For what they write beside."""

    def play(self, kit: "Kit", pieces: "Sequence[Piece]") -> "Iterator[tuple[Piece, bytes | str]]":
        """The file of every piece, as it comes.

        One that kills its process `TRIES` times is given up; an error that is no result is raised
        when it has come as often.
        """
        left, tried = {piece.name: piece for piece in pieces}, Counter[str]()
        while left:
            suspects = [piece for name, piece in left.items() if tried[name]]
            flying: dict[Future[bytes], Piece] = {}
            try:
                for future in self._done(kit.data, suspects, list(left.values()), flying):
                    error, piece = future.exception(), flying[future]
                    if isinstance(error, BrokenProcessPool):
                        raise error
                    del flying[future]
                    if error is None:
                        del left[piece.name]
                        yield piece, future.result()
                        continue
                    tried[piece.name] += 1
                    if isinstance(error, CalibError) or tried[piece.name] == TRIES:
                        raise error
            except BrokenProcessPool:
                self.close()
                for piece in flying.values():
                    tried[piece.name] += 1
                    if tried[piece.name] >= TRIES:
                        del left[piece.name]
                        yield piece, f"{TRIES} processes died while they played {piece.name}"

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        if self._life is not None:
            self._life.close()
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        if self._room is not None:
            self._room.cleanup()
        self._pool = self._life = self._room = None

    def _done(
        self,
        data: bytes,
        suspects: "Sequence[Piece]",
        left: "Sequence[Piece]",
        flying: "dict[Future[bytes], Piece]",
    ) -> Iterator[Future[bytes]]:
        """Futures as they end; suspects one at a time, before all others."""
        waiting = deque(suspects or left)
        while waiting or flying:
            while waiting and len(flying) < (1 if suspects else self._workers + 1):
                try:
                    flying[self._submitted(data, waiting[0], len(left))] = waiting[0]
                except OSError:
                    # no child could be begun, perhaps as the pool is just breaking: those in flight
                    # will tell
                    if not flying:
                        raise
                    break
                waiting.popleft()
            yield from wait(flying, return_when=FIRST_COMPLETED).done

    def _submitted(self, data: bytes, piece: "Piece", left: int) -> Future[bytes]:
        """A piece handed to a process; there are no more of them than pieces."""
        with _uninterrupted():
            if self._pool is None:
                context = get_context("spawn")
                theirs, self._life = context.Pipe(duplex=False)
                workers = min(self._workers, left)
                self._room = TemporaryDirectory(prefix="truebed-", ignore_cleanup_errors=True)
                theirs_too = (theirs, self._room.name)
                self._pool = ProcessPoolExecutor(workers, context, _begin, theirs_too)
            return self._pool.submit(self._call, data, piece)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """A block that Ctrl-C does not reach before it ends, nor ever the processes begun in it.

    The terminal sends it to all of them, and it is their parent that ends them.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # where the first child starts this process, it would leave the signal unblocked
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(life: Connection, room: str) -> None:
    """Set up a child: it ends when its parent closes the pipe, or is no more."""
    tempfile.tempdir = room
    Thread(target=_end_with, args=(life,), daemon=True).start()


def _end_with(life: Connection) -> None:
    """Wait for the end of the parent, then end this process at once."""
    with suppress(EOFError, OSError):
        life.recv()
    os._exit(1)
