"""Records in self-checking npz files: same content, same bytes; a flipped byte never passes."""

import io
import json
import math
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from typing import IO, Any, NamedTuple, NoReturn, TypeVar

import numpy as np

from calib.errors import CalibError, InputError, MachineError
from testbed.machine import Room, require_room
from testbed.store.codec import KINDS, Header, pack, require_fit, unpack
from testbed.store.layout import FORMAT

T = TypeVar("T")
META, NPY = "meta", ".npy"
MOST_BYTES = 2**31
"""A larger archive is refused before it is read."""
LARGE = 50_000_000
"""A larger one is looked at before its arrays are: shipped scenes have left 0.7 MB at most."""
MOST_JSON = 10_000_000
"""The same of a document; one of two hundred trials has about a tenth of this."""
MOST_DIGITS = 300
"""Of a whole number in a document: one of more is beyond float64."""
DONE, FAILED = "done", "failed"


class DamagedError(Exception):
    """A file does not hold what its own checksum promises."""


class OtherVersionError(DamagedError):
    """A whole file does not hold what this version of the program writes."""


Arrays = Mapping[str, np.ndarray[Any, Any]]
Headers = Mapping[str, Header]


class Content(NamedTuple):
    """What an archive holds."""

    meta: Mapping[str, Any]
    arrays: Arrays


def digest(meta: Mapping[str, Any], arrays: Arrays) -> str:
    """Hex sha256 over the meta data and each array's name, type, shape and bytes."""
    flat = {name: np.ascontiguousarray(array).reshape(-1) for name, array in arrays.items()}
    return digest_of(meta, arrays, lambda name: (flat[name].view("V1").data,))


def digest_of(
    meta: Mapping[str, Any],
    arrays: Headers | Arrays,
    blocks: Callable[[str], Iterable[bytes | memoryview]],
) -> str:
    """The same where an array's bytes come in blocks."""
    total = sha256(canonical({k: v for k, v in meta.items() if k != "sha256"}))
    for name in sorted(arrays):
        total.update(f"{name}|{arrays[name].dtype.str}|{arrays[name].shape}|".encode())
        for block in blocks(name):
            total.update(block)
    return total.hexdigest()


def write_archive(file: IO[bytes], meta: Mapping[str, Any], arrays: Arrays) -> None:
    """Write the archive: arrays and ``meta``, JSON with a checksum over everything."""
    ordered = {name: np.asarray(arrays[name], order="C") for name in sorted(arrays)}
    text = canonical({**meta, "sha256": digest(meta, ordered)})
    # uncompressed, and numpy dates every entry 1980: the same content gives the same bytes
    members: dict[str, Any] = {META: np.frombuffer(text, np.uint8), **ordered}
    np.savez(file, **members)


def to_bytes(meta: Mapping[str, Any], arrays: Arrays) -> bytes:
    """The same as bytes."""
    buffer = io.BytesIO()
    write_archive(buffer, meta, arrays)
    return buffer.getvalue()


def from_bytes(
    data: bytes | IO[bytes], accept: Callable[[dict[str, Any], Headers], None] | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Meta data and arrays of an archive whose checksum holds; of a file only what it needs.

    `accept` looks at a large one before its arrays are read: it raises if they are not wanted.

    Raises
    ------
    DamagedError
        Anything else; nothing is ever unpickled, and nothing is read that is larger than its file.
    MachineError
        F10: it is large, and there is not that much memory.
    """
    with opened_archive(io.BytesIO(data) if isinstance(data, bytes) else data) as opened:
        archive, meta, headers, size = opened
        if size > LARGE and accept is not None:
            accept(meta, headers)
        if size > LARGE:
            require_room(Room(2 * size // 10**6, 0))
        arrays = {name: read_array(archive, name) for name in headers}
    if meta.get("sha256") != digest(meta, arrays):
        raise DamagedError("the checksum does not hold")
    return meta, arrays


@contextmanager
def opened_archive(
    file: IO[bytes],
) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any], Headers, int]]:
    """An archive, its meta data, what its arrays are, and its size in bytes.

    Raises
    ------
    DamagedError
        It is none that this module writes, or what is done with it fails.
    """
    if (size := file.seek(0, io.SEEK_END)) > MOST_BYTES:
        raise DamagedError(f"it has {size / 1e6:.6g} MB, at most {MOST_BYTES / 1e6:.6g} are read")
    try:
        with zipfile.ZipFile(file) as archive:
            headers = _headers(archive, size)
            if META not in headers:
                raise DamagedError("it has no meta data")
            if math.prod(headers[META].shape) > MOST_JSON:
                raise DamagedError("its meta data are too large")
            meta = strict_json(read_array(archive, META).tobytes())
            del headers[META]
            yield archive, meta, headers, size
    except (DamagedError, MemoryError, MachineError):
        raise
    except Exception as error:  # zip and npy readers raise almost anything
        raise DamagedError(f"{type(error).__name__}: {error}") from error


def _headers(archive: zipfile.ZipFile, size: int) -> dict[str, Header]:
    """What the arrays of an archive of `size` bytes are, each as large as its entry and plain."""
    entries = archive.infolist()
    if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries):
        raise DamagedError("an entry is compressed")
    if sum(entry.file_size for entry in entries) > size:
        raise DamagedError("the entries claim more bytes than the file has")
    headers = {}
    for entry in entries:
        with archive.open(entry) as member:
            header, _ = header_of(member)
            if header.dtype.kind not in KINDS:
                raise DamagedError(f"{entry.filename} holds {header.dtype}; allow_pickle=False")
            if math.prod(header.shape) * header.dtype.itemsize != entry.file_size - member.tell():
                raise DamagedError(f"{entry.filename} claims another size than it has")
        headers[entry.filename.removesuffix(NPY)] = header
    return headers


def header_of(member: IO[bytes]) -> tuple[Header, bool]:
    """What an entry says of its array, and whether that is stored by columns."""
    npy = np.lib.format
    first = npy.read_magic(member) == (1, 0)
    read = npy.read_array_header_1_0 if first else npy.read_array_header_2_0
    shape, by_columns, dtype = read(member)
    return Header(shape, dtype), by_columns


def read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray[Any, Any]:
    """One array of an archive whose headers have been looked at."""
    with archive.open(f"{name}{NPY}") as member:
        return np.lib.format.read_array(member, allow_pickle=False)


@dataclass(frozen=True, slots=True)
class Failure:
    """A record that could not be computed, and why."""

    reason: str


def record_bytes(key: str, record: object, spec: str) -> bytes:
    """The file of one record: its content, its key and the hash of what it depends on."""
    return to_bytes(*record_content(key, record, spec))


def record_content(key: str, record: object, spec: str, *, single: bool = False) -> Content:
    """What the file of a record holds.

    With `single`, figures of each robot are rounded to float32.
    """
    head = {"format": FORMAT, "key": key, "spec_sha256": spec}
    if isinstance(record, Failure):
        return Content({**head, "status": FAILED, "reason": record.reason, "values": {}}, {})
    packed = pack(record, single=single)
    arrays = {name: value for name, value in packed.items() if isinstance(value, np.ndarray)}
    values = {name: packed[name] for name in packed if name not in arrays}
    return Content({**head, "status": DONE, "reason": "", "values": values}, arrays)


def record_from(data: bytes | IO[bytes], key: str, cls: type[T], spec: str) -> T | Failure:
    """The record in a file's content.

    Raises
    ------
    DamagedError
        Its checksum does not hold, or it is another record's.
    OtherVersionError
        It is whole, and of another format, scenario or class.
    """

    def accept(meta: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
        require_own(meta, key, spec)
        if meta.get("status") != FAILED:
            require_fit(cls, {**meta["values"], **arrays})

    meta, arrays = from_bytes(data, accept)
    require_own(meta, key, spec)
    if meta.get("status") == FAILED:
        return Failure(str(meta.get("reason")))
    try:
        return unpack(cls, {**meta["values"], **arrays})
    except (ValueError, TypeError, KeyError, InputError) as error:
        raise OtherVersionError(str(error)) from error
    except CalibError as error:  # a number that is not finite: no version writes one
        raise DamagedError(str(error)) from error


def require_own(meta: Mapping[str, Any], key: str, spec: str) -> None:
    """Refuse another record, or one of another format or scenario."""
    if meta.get("key") != key:
        raise DamagedError(f"key is {meta.get('key')!r} instead of {key!r}")
    for name, value in (("format", FORMAT), ("spec_sha256", spec)):
        if meta.get(name) != value:
            raise OtherVersionError(f"{name} is {meta.get(name)!r} instead of {value!r}")


def strict_json(text: bytes | str) -> dict[str, Any]:
    """A JSON object without nan, numbers beyond float64, or duplicate keys.

    Raises
    ------
    ValueError
        It is not one.
    """

    def refuse(word: str) -> NoReturn:
        raise ValueError(f"{word[:20]} is not a number that can be kept")

    def number(word: str) -> float:
        value = float(word)
        return value if math.isfinite(value) else refuse(word)

    def whole(word: str) -> int:
        return int(word) if len(word) <= MOST_DIGITS else refuse(word)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        if len(set(keys)) < len(keys):
            raise ValueError(f"duplicate key {max(keys, key=keys.count)!r}")
        return dict(pairs)

    try:
        value = json.loads(
            text,
            parse_constant=refuse,
            parse_float=number,
            parse_int=whole,
            object_pairs_hook=unique,
        )
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(value, dict):
        raise ValueError("not a JSON object")
    return value


def pretty_json(value: Mapping[str, Any]) -> bytes:
    """Readable JSON with a fixed layout: UTF-8, LF; a nan, "does not apply", becomes null."""
    text = json.dumps(_with_null(value), indent=1, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def _with_null(value: Any) -> Any:
    """The same JSON value with null for every nan."""
    if isinstance(value, Mapping):
        return {key: _with_null(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_with_null(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def canonical(value: object) -> bytes:
    """Canonical JSON bytes: sorted keys, shortest round-trip floats, no nan."""
    text = json.dumps(
        value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )
    return text.encode()
