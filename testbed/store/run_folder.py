"""The run folder: opened under a lock, filled record by record, never overwritten in silence."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self, TypeVar

from calib.errors import InputError
from testbed.disk import acquire, atomic_write, keep_or_write, remove_leftovers
from testbed.store import layout
from testbed.store.manifest import check_same_run, manifest_bytes, read_manifest
from testbed.store.npz import DamagedError
from testbed.store.record import Failure, read_record

T = TypeVar("T")


class RunFolder:
    """One run folder, locked until it is closed; `create`, `resume` or `reopen` one."""

    def __init__(self, path: Path, lock: IO[str] | None = None, *, fresh: bool = False) -> None:
        self.path = path
        self._lock = lock
        self._fresh = fresh
        """Begun by this process: may be removed again while no record is in it."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        try:
            if path.exists() and not is_unused(path):
                _make_way(path, overwrite=overwrite)
            (path / layout.TRIALS).mkdir(parents=True, exist_ok=True)
            lock = acquire(path)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the name
            raise _unwritable(path, error) from error
        remove_leftovers(path)
        return cls(path, lock, fresh=True)

    @classmethod
    def resume(cls, path: Path, scenario_hash: str) -> "RunFolder":
        """The folder of a run of the same scenario and versions; a new one if none began."""
        try:
            if not path.exists() or is_unused(path):
                return cls.create(path)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the name
            raise _unwritable(path, error) from error
        check_same_run(path, scenario_hash)
        return cls.reopen(path)

    @classmethod
    def reopen(cls, path: Path) -> "RunFolder":
        """A run folder to which something is to be added."""
        read_manifest(path)
        try:
            (path / layout.TRIALS).mkdir(exist_ok=True)
            lock = acquire(path)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the name
            raise _unwritable(path, error) from error
        remove_leftovers(path)
        remove_leftovers(path / layout.TRIALS)
        return cls(path, lock, fresh=False)

    def begin(self, scenario: str, about: Mapping[str, Any]) -> None:
        """Write what is played; the manifest comes last and makes this a run folder."""
        note = (
            "This run is not finished. What lies in trials/ is whole.\n"
            "To go on, give the same command again with --resume.\n"
        )
        self.write(layout.UNFINISHED, note.encode())
        self.write(layout.SCENARIO, scenario.encode())
        self.write(layout.MANIFEST, manifest_bytes(about))

    def end(self) -> None:
        """Say that the run is finished."""
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

    def record_path(self, key: str) -> Path:
        """File of one record."""
        return self.path / layout.TRIALS / f"{key}.npz"

    def write_record(self, key: str, data: bytes) -> None:
        """Write the file of one record; whole or not at all."""
        atomic_write(self.record_path(key), data)

    def read_record(self, key: str, cls: type[T], spec: str) -> T | Failure | None:
        """One record, or None if it is missing, damaged or belongs to another scenario."""
        try:
            return read_record(self.record_path(key), key, cls, spec)
        except DamagedError:
            return None

    def write(self, name: str, data: bytes) -> None:
        """Write another file; whole or not at all; its time stamp stays if nothing changed."""
        keep_or_write(self.path / name, data)

    def log(self, line: bytes) -> None:
        """Append one line to the log; a log that cannot be written never stops a run."""
        with suppress(OSError), (self.path / layout.LOG).open("ab") as file:
            file.write(line)


def is_unused(path: Path) -> bool:
    """Whether a folder is empty, or holds only what a run leaves that died before it began."""
    if not path.is_dir() or (path / layout.MANIFEST).exists():
        return False
    trials = path / layout.TRIALS
    return all(
        entry.name in layout.OURS or entry.name.endswith(layout.TEMPORARY) or entry == trials
        for entry in path.iterdir()
    ) and not (trials.is_dir() and any(trials.iterdir()))


def _make_way(path: Path, *, overwrite: bool) -> None:
    """Rename an old run to the first free ``<name>.old-<k>``; refuse anything else."""
    if not path.is_dir():
        raise InputError(
            "is a file",
            code="C40",
            where=str(path),
            field="--out",
            allowed="the run folder must be new",
            fix="choose another --out",
        )
    if (path / layout.LOCK).is_file():
        with suppress(OSError):
            acquire(path).close()  # MachineError while another process is writing there
    if not overwrite:
        raise InputError(
            "exists already",
            code="C40",
            where=str(path),
            field="--out",
            fix="choose another --out, go on with --resume, or rename the old one with --overwrite",
        )
    if not (path / layout.MANIFEST).is_file():
        raise InputError(
            "is not a run folder and will not be renamed",
            code="C40",
            where=str(path),
            field="--overwrite",
            fix="choose another --out",
        )
    number = 1
    while (new := path.with_name(f"{path.name}.old-{number}")).exists():
        number += 1
    path.rename(new)


def _unwritable(path: Path, error: OSError | ValueError) -> InputError:
    """Nothing can be written at --out."""
    return InputError(
        f"cannot be written: {getattr(error, 'strerror', None) or error}",
        code="C40",
        where=str(path),
        field="--out",
        fix="choose another --out",
    )
