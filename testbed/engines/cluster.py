"""A cluster that is there already: the workers of a dask scheduler play, this process keeps."""

import logging
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from calib.errors import CalibError, InputError, MachineError, refuse

if TYPE_CHECKING:  # a worker loads what it plays, and nothing for this
    from testbed.engines.kit import Kit
    from testbed.engines.piece import Piece

TRIES, MOST_PIECES = 3, 1000
"""Errors, or losses, after which a piece is given up; pieces that are on their way at once."""
ANSWER, PATIENCE, BEAT = 10.0, 60.0, 0.02
"""A scheduler answers or comes back, and has workers again, within so long; a look around [s]."""
_ONE = Lock()
"""One piece at a time in a process, however many threads it has."""


class Cluster:
    """The workers of a scheduler, ``tcp://HOST:PORT`` or ``file:scheduler.json``.

    `call` is what they are asked for: from a kit's bytes and a piece the bytes of its file.

    Raises
    ------
    InputError
        C42: the package that speaks with it is missing, it does not answer, or has no workers.
    """

    def __init__(self, address: str, call: "Callable[[bytes, Piece], bytes]") -> None:
        # and when workers were counted last, and their threads
        self._call, self._address, self._seen, self._threads = call, address, 0.0, 0
        name = address.removeprefix("file:")
        where = {"address": name} if name == address else {"scheduler_file": name}
        fix = "start one by `dask scheduler`, and give the address that it prints"
        if name != address and not Path(name).is_file():  # it would be waited for
            raise self._unusable("is not there", fix)
        try:
            from distributed import Client

            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it is told below
            self._client: Any = Client(**where, timeout=ANSWER, set_as_default=False)
        except ImportError as error:
            told = "needs the package distributed"
            raise self._unusable(told, "pip install 'truebed[cluster]'") from error
        except (OSError, ValueError, TypeError) as error:
            raise self._unusable("does not answer", fix) from error
        try:
            self._client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError as error:
            self.close()
            at = address if name == address else f"--scheduler-file {name}"
            fix = f"start some by `dask worker {at} --nthreads 1`"
            raise self._unusable("has no workers", fix) from error

    def play(self, kit: "Kit", pieces: "Sequence[Piece]") -> "Iterator[tuple[Piece, bytes | str]]":
        """The file of every piece, as it comes; what is lost on the way is played again."""
        waiting, tried = deque(pieces), Counter[str]()
        flying: dict[Any, Piece] = {}
        while waiting or flying:
            room = min(2 * self._count() + 2, MOST_PIECES) - len(flying)
            for piece in [waiting.popleft() for _ in range(min(room, len(waiting)))]:
                key = f"truebed-{piece.name}-{uuid4().hex}"  # no other run's, nor an earlier try's
                told = (self._call, kit.data, piece)
                flying[self._client.submit(_there, *told, key=key, pure=False)] = piece
            for future in [one for one in flying if one.status != "pending"]:
                piece = flying.pop(future)
                if (found := self._found(future, piece, tried)) is None:
                    waiting.append(piece)
                else:
                    yield piece, found
            time.sleep(BEAT)

    def close(self) -> None:
        """Leave the cluster; what nobody waits for any more is dropped there."""
        self._client.close(timeout=2)

    def _found(self, future: Any, piece: "Piece", tried: Counter[str]) -> bytes | str | None:
        """The file of a piece, why it is given up, or None if it shall be played again."""
        try:
            if future.status == "finished":
                return bytes(future.result(timeout=ANSWER))
            error = future.exception(timeout=ANSWER) if future.status == "error" else None
        except Exception:  # the worker, or the scheduler, went away with it
            error = None
        tried[piece.name] += error is not None
        if type(error).__name__ == "KilledWorker":
            return f"several workers died while they played {piece.name}"
        if error is None or (not isinstance(error, CalibError) and tried[piece.name] < TRIES):
            return None
        if isinstance(error, ImportError) or "deserializ" in str(error):
            why = f": {error}" if isinstance(error, ImportError) else ""
            told = f"cannot load truebed, or has a worker that cannot{why}"
            fix = "install it, in this version, with the scheduler and all workers"
            raise self._unusable(told, fix) from error
        raise error

    def _count(self) -> int:
        """Threads of all workers, asked for every now and then; 0 while the scheduler is away.

        Raises
        ------
        MachineError
            F12: it does not come back, or has had no workers for long.
        """
        now, threads, state = time.monotonic(), 0, self._client.status
        if state == "running" and now < self._seen + 1:
            return self._threads
        with suppress(OSError, TimeoutError):  # it may come back, until the client gives it up
            if state == "running":
                asked = self._client.scheduler.ncores
                threads = sum(self._client.sync(asked, callback_timeout=ANSWER).values())
        if threads:
            self._seen, self._threads = now, threads
        elif state == "closed" or now > self._seen + PATIENCE:
            told = "is gone" if state == "closed" else "has no workers any more"
            fix, at = "start it again, then go on with --resume", self._address
            raise MachineError(f"the scheduler {at} {told}", code="F12", value=at, fix=fix)
        return threads

    def _unusable(self, told: str, fix: str) -> InputError:
        """The error for a scheduler that cannot be used."""
        message = f"--scheduler is {self._address}, which {told}"
        return refuse("--scheduler", self._address, code="C42", message=message, fix=fix)


def _there(call: "Callable[[bytes, Piece], bytes]", kit: bytes, piece: "Piece") -> bytes:
    """Play a piece on a worker, in whose own folder it may write."""
    from distributed import get_worker

    with _ONE:
        tempfile.tempdir = get_worker().local_directory
        return call(kit, piece)
