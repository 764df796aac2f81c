"""Records of very many robots: checked once, then a figure is read when it is asked for.

Such a record looks like any other of its class. Its arrays stay in its file, and each time one is
asked for it comes from there, in float64: what a run holds of a million robots is what it looks at.
"""

import dataclasses
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any, TypeVar, cast

import numpy as np

from calib.arrays import Array
from calib.errors import InputError
from testbed.store.codec import Header, require_fit, unpack
from testbed.store.documents import damaged
from testbed.store.npz import (
    FAILED,
    NPY,
    DamagedError,
    Failure,
    OtherVersionError,
    digest_of,
    header_of,
    opened_archive,
    read_array,
    require_own,
)

T = TypeVar("T")
AT_ONCE = 2**22
"""Bytes that are checked at a time."""
SOURCE = "_source"
FIX = "give the command again"


@dataclass(frozen=True, slots=True)
class Source:
    """The file of a record that was checked."""

    path: Path
    stamp: tuple[int, int]
    """Size and time of its last change, which tell that it is the same still."""

    def array(self, name: str) -> np.ndarray[Any, Any]:
        """One array, its figures in float64."""
        with self._opened() as archive:
            found = _wide(read_array(archive, name))
        found.setflags(write=False)
        return found

    def rows(self, name: str) -> Iterator[np.ndarray[Any, Any]]:
        """The same row by row."""
        with self._opened() as archive, _content(archive, name) as (member, header):
            shape = header.shape[1:]
            size = int(np.prod(shape)) * header.dtype.itemsize
            for _ in range(header.shape[0]):
                yield _wide(np.frombuffer(member.read(size), header.dtype).reshape(shape))

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        """The file, which must be the one that was checked."""
        try:
            with self.path.open("rb") as file:
                if _stamp(file) != self.stamp:
                    raise damaged(self.path, "it was changed while it was used", FIX)
                with zipfile.ZipFile(file) as archive:
                    yield archive
        except (OSError, zipfile.BadZipFile) as error:
            raise damaged(self.path, str(error), FIX) from error


def each_row(record: object, name: str) -> Iterator[Array]:
    """The rows of an array of a record, of which only one need be in memory."""
    source: Source | None = getattr(record, SOURCE, None)
    return iter(getattr(record, name)) if source is None else source.rows(name)


def kept_record(file: IO[bytes], path: Path, key: str, cls: type[T], spec: str) -> T | Failure:
    """The record in a file whose arrays stay there.

    Raises
    ------
    DamagedError
        Its checksum does not hold, it is another record's, or holds a number that is not finite.
    OtherVersionError
        It is whole, and of another format, scenario or class.
    """
    with opened_archive(file) as (archive, meta, headers, _):
        require_own(meta, key, spec)
        if meta.get("sha256") != digest_of(meta, headers, lambda name: _checked(archive, name)):
            raise DamagedError("the checksum does not hold")
        if meta.get("status") == FAILED:
            return Failure(str(meta.get("reason")))
        try:
            require_fit(cls, {**meta["values"], **headers})
            fields = {field.name for field in dataclasses.fields(cast(Any, cls))}
            there = tuple(name for name in headers if name in fields)
            others = {name: read_array(archive, name) for name in headers if name not in there}
            # arrays that take no room stand for those that stay
            inside = {name: _like(headers[name]) for name in there}
            whole = unpack(cls, {**meta["values"], **others, **inside})
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise OtherVersionError(str(error)) from error
    record: Any = object.__new__(_reader(cast(Any, cls), there))
    for name in fields.difference(there):
        object.__setattr__(record, name, getattr(whole, name))
    object.__setattr__(record, SOURCE, Source(path, _stamp(file)))
    return cast(T, record)


@cache
def _reader(cls: Any, names: tuple[str, ...]) -> Any:
    """The class whose fields of these names are read when they are asked for."""

    def read(name: str) -> property:
        return property(lambda self: getattr(self, SOURCE).array(name))

    body: Mapping[str, Any] = {"__slots__": (SOURCE,), "__module__": cls.__module__}
    return type(cls.__name__, (cls,), {**body, **{name: read(name) for name in names}})


def _stamp(file: IO[bytes]) -> tuple[int, int]:
    """What changes with a file's content."""
    state = os.fstat(file.fileno())
    return state.st_size, state.st_mtime_ns


def _like(header: Header) -> np.ndarray[Any, Any]:
    """An array as it is handed over, of one number that stands for all."""
    return np.broadcast_to(_wide(np.zeros((), header.dtype)), header.shape)


def _wide(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Figures in float64."""
    return array.astype(np.float64) if array.dtype == np.float32 else array


@contextmanager
def _content(archive: zipfile.ZipFile, name: str) -> Iterator[tuple[IO[bytes], Header]]:
    """The bytes of an array, behind what it says of itself."""
    with archive.open(f"{name}{NPY}") as member:
        header, by_columns = header_of(member)
        if by_columns and len(header.shape) > 1:
            raise DamagedError(f"{name} is stored by columns")
        yield member, header


def _checked(archive: zipfile.ZipFile, name: str) -> Iterator[bytes]:
    """The bytes of an array, some at a time; all its numbers are finite."""
    with _content(archive, name) as (member, header):
        while block := member.read(AT_ONCE):
            if (
                header.dtype.kind == "f"
                and not np.isfinite(np.frombuffer(block, header.dtype)).all()
            ):
                raise DamagedError(f"{name} holds a number that is not finite")
            yield block
