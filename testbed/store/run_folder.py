"""The folder of a run: filled record by record under a lock, and a stopped run goes on in it."""

import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Self, TypeVar

from calib.errors import refuse
from testbed.disk import (
    acquire,
    atomic_path,
    atomic_write,
    becomes,
    keep_or_write,
    remove_leftovers,
    unfollowed,
    write_error,
)
from testbed.store import layout
from testbed.store.kept import kept_record
from testbed.store.manifest import check_same_run, manifest_bytes, read_manifest
from testbed.store.npz import (
    Content,
    DamagedError,
    Failure,
    OtherVersionError,
    record_from,
    write_archive,
)
from testbed.store.pieces import StoredPiece, piece_from
from testbed.store.whole_folder import check_movable, make_way, real_folder, writing

T = TypeVar("T")
UNFINISHED_NOTE = (
    "This run is not finished. What lies in trials/ is whole.\n"
    "To go on, give the same command again with --resume.\n"
)
AGAIN = "give the command that wrote this folder again, with another --out"


class RunFolder:
    """One run folder, locked until it is closed; `create`, `resume` or `reopen` one."""

    def __init__(
        self, path: Path, lock: IO[str] | None = None, *, fresh: bool = False, begun: bool = False
    ) -> None:
        self.path = path
        self.begun = begun
        """Whether it is of just this scenario already, as `begin` would write it."""
        self._lock = lock
        self._fresh = fresh
        """Begun by this process: may be removed again while no record is in it."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._lock is not None:
            self._lock.close()

    @classmethod
    def create(cls, path: Path, *, overwrite: bool = False) -> "RunFolder":
        """A new run folder; with `overwrite` an old run there is renamed, never removed.

        Raises
        ------
        InputError
            Something is there already, or nothing can be written there.
        MachineError
            Another process is writing there.
        """
        with writing(path):
            real = real_folder(path)
            if path.exists() and not is_unused(path):
                check_movable(path, layout.MANIFEST, overwrite=overwrite, resumable=True)
                make_way(real)
        return cls._locked(real, fresh=True)

    @classmethod
    def resume(cls, path: Path, scenario_hash: str, growing_hash: str = "") -> "RunFolder":
        """The folder of a run of the same scenario and versions; a new one if none began.

        It may be one with more or fewer robots, told by `growing_hash`: what was derived from those
        is removed.
        """
        with writing(path):
            if not path.exists() or is_unused(path):
                return cls.create(path)
        return cls._stands(path, scenario_hash, growing_hash)

    @classmethod
    def share(cls, path: Path, scenario_hash: str, growing_hash: str = "") -> "RunFolder":
        """As `resume`, for several processes that fill it at once."""
        with writing(path):
            if not path.exists() or is_unused(path):
                return cls._locked(path, fresh=True, shared=True)
        return cls._stands(path, scenario_hash, growing_hash, shared=True)

    @classmethod
    def _stands(
        cls, path: Path, scenario_hash: str, growing_hash: str, *, shared: bool = False
    ) -> "RunFolder":
        """The folder of a run that began, without what was derived from other numbers of robots."""
        same = check_same_run(path, scenario_hash, growing_hash)
        folder = cls._locked(path, shared=shared, begun=same)
        if not same:
            for name in layout.DERIVED:
                (path / name).unlink(missing_ok=True)
        return folder

    @classmethod
    def reopen(cls, path: Path) -> "RunFolder":
        """A run folder to which something is to be added."""
        read_manifest(path)
        return cls._locked(path)

    @classmethod
    def _locked(
        cls, path: Path, *, fresh: bool = False, shared: bool = False, begun: bool = False
    ) -> "RunFolder":
        """The folder, made if need be, under its lock and without what a killed process left."""
        with writing(path):
            (path / layout.TRIALS).mkdir(parents=True, exist_ok=True)
            lock = acquire(path, shared=shared)
        # those of a folder that is shared may be of others that are alive
        for folder in () if shared else (path, path / layout.TRIALS, path / layout.PARTS):
            remove_leftovers(folder)
        return cls(path, lock, fresh=fresh, begun=begun)

    def begin(self, scenario: str, about: Mapping[str, Any]) -> None:
        """Write what is played; the manifest comes last and makes this a run folder."""
        self.write(layout.UNFINISHED, UNFINISHED_NOTE.encode())
        self.write(layout.SCENARIO, scenario.encode())
        self.write(layout.MANIFEST, manifest_bytes(about))

    def end(self) -> None:
        """Mark the run as finished."""
        with suppress(OSError):
            (self.path / layout.UNFINISHED).unlink(missing_ok=True)

    def discard(self) -> None:
        """Remove what this process began, unless a record is in it already."""
        with suppress(OSError):
            if self._fresh:
                (self.path / layout.TRIALS).rmdir()  # fails, and so stops, if a record is there
                for name in layout.OURS:
                    (self.path / name).unlink(missing_ok=True)
                self.path.rmdir()

    def _record_path(self, key: str) -> Path:
        """File of a record."""
        return self.path / layout.TRIALS / f"{key}.npz"

    def write_record(self, key: str, data: bytes | Content) -> None:
        """Write the file of one record; whole or not at all."""
        path = self._record_path(key)
        _make_room(path)
        if isinstance(data, bytes):
            atomic_write(path, data)
            return
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            write_archive(file, *data)

    def read_record(
        self, key: str, cls: type[T], spec: str, *, kept: bool = False
    ) -> T | Failure | None:
        """A record; None if it is missing, damaged or belongs to another scenario.

        The arrays of one that is `kept` stay in its file.
        """
        with suppress(OSError, DamagedError):
            return self._record(key, cls, spec, kept)
        return None

    def _record(self, key: str, cls: type[T], spec: str, kept: bool) -> T | Failure:
        """A record that is whole."""
        path = self._record_path(key)
        with _opened(path) as file:
            if kept:
                return kept_record(file, path, key, cls, spec)
            return record_from(file, key, cls, spec)

    def write_piece(self, name: str, data: bytes) -> None:
        """Write the file of one piece of work; whole or not at all."""
        path = self.path / layout.PARTS / f"{name}.npz"
        _make_room(path)
        atomic_write(path, data)

    def read_piece(self, name: str, spec: str) -> StoredPiece | None:
        """A piece; None if it is missing, damaged or belongs to another scenario or size."""
        path = self.path / layout.PARTS / f"{name}.npz"
        with suppress(OSError, DamagedError), _opened(path) as file:
            return piece_from(file, name, spec)
        return None

    def add(self, name: str, data: bytes) -> None:
        """Take over a record or piece, ``trials/setting.npz``, from another folder."""
        path = self.path / name
        _make_room(path)
        atomic_write(path, data)

    def require_record(
        self, key: str, cls: type[T], spec: str, *, fix: str, kept: bool = False
    ) -> T | Failure:
        """A record that must be there; `fix` says how one is had that is lost.

        Raises
        ------
        InputError
            D42: it is missing or damaged, or whole and of another version of the program.
        """
        try:
            return self._record(key, cls, spec, kept)
        except FileNotFoundError:
            told = "is missing"
        except OSError as error:
            told = f"cannot be read: {error.strerror}"
        except OtherVersionError:
            told, fix = "was written by another version of truebed", AGAIN
        except DamagedError:
            told = "is damaged"
        begun = (self.path / layout.UNFINISHED).is_file() and told == "is missing"
        message = "the run is not finished" if begun else f"the record {key} {told}"
        raise refuse(key, code="D42", message=message, fix=fix, where=str(self.path))

    def write(self, name: str, data: bytes) -> None:
        """Write another file; whole or not at all; its time stamp stays if nothing changed."""
        keep_or_write(self.path / name, data)

    def log(self, line: bytes) -> None:
        """Append one line to the log; a log that cannot be written never stops a run."""
        path = self.path / layout.LOG
        with suppress(OSError), open(path, "ab", opener=unfollowed) as file:
            file.write(line)


def _make_room(path: Path) -> None:
    """Have the folder that a file lies in, inside one that is there.

    Raises
    ------
    MachineError
        It cannot be made: the run folder was removed, or nothing can be written there.
    """
    try:
        path.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise write_error(path, error) from error


def _opened(path: Path) -> IO[bytes]:
    """An ordinary file."""
    if not stat.S_ISREG(path.stat().st_mode):  # to open a pipe would wait for ever
        raise DamagedError("it is not an ordinary file")
    return path.open("rb")


def is_unused(path: Path) -> bool:
    """Whether a folder is empty, or holds only what a run leaves that died before it began."""
    if not path.is_dir() or (path / layout.MANIFEST).exists():
        return False
    trials = path / layout.TRIALS
    return all(
        entry.name in layout.OURS or becomes(entry.name) or entry == trials
        for entry in path.iterdir()
    ) and not (trials.is_dir() and any(trials.iterdir()))
