"""Records in self-checking npz files: same content, same bytes; a flipped byte never passes."""

import io
import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, TypeVar

import numpy as np

from calib.errors import InputError
from testbed.store.codec import pack, unpack
from testbed.store.layout import FORMAT

T = TypeVar("T")
META = "meta"
MOST_BYTES = 2**31
"""An archive that claims more than this is refused before it is read."""
DONE, FAILED = "done", "failed"


class DamagedError(Exception):
    """A file does not hold what its own checksum promises."""


class OtherVersionError(DamagedError):
    """A whole file does not hold what this version of the program writes."""


def digest(meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> str:
    """Hex sha256 over the meta data and each array's name, type, shape and bytes."""
    total = sha256(canonical({k: v for k, v in meta.items() if k != "sha256"}))
    for name, array in sorted(arrays.items()):
        total.update(f"{name}|{array.dtype.str}|{array.shape}|".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def to_bytes(meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]) -> bytes:
    """The archive: arrays and ``meta``, JSON with a checksum over everything."""
    ordered = {name: np.asarray(arrays[name], order="C") for name in sorted(arrays)}
    text = canonical({**meta, "sha256": digest(meta, ordered)})
    buffer = io.BytesIO()
    # uncompressed, and numpy dates every entry 1980: the same content gives the same bytes
    members: dict[str, Any] = {META: np.frombuffer(text, np.uint8), **ordered}
    np.savez(buffer, **members)
    return buffer.getvalue()


def from_bytes(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]]:
    """Meta data and arrays of an archive whose checksum holds.

    Raises
    ------
    DamagedError
        Anything else; nothing is ever unpickled.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries):
            raise DamagedError("an entry is compressed")
        if sum(entry.file_size for entry in entries) > min(len(data), MOST_BYTES):
            raise DamagedError("the entries claim more bytes than the file has")
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        text = arrays.pop(META).tobytes()
        meta = strict_json(text)
        if meta.get("sha256") != digest(meta, arrays):
            raise DamagedError("the checksum does not hold")
    except Exception as error:  # zip, npy and JSON readers raise almost anything
        raise DamagedError(f"{type(error).__name__}: {error}") from error
    return meta, arrays


@dataclass(frozen=True, slots=True)
class Failure:
    """A record that could not be computed, and why."""

    reason: str


def record_bytes(key: str, record: object, spec: str) -> bytes:
    """The file of one record: its content, its key and the hash of what it depends on."""
    head = {"format": FORMAT, "key": key, "spec_sha256": spec}
    if isinstance(record, Failure):
        return to_bytes({**head, "status": FAILED, "reason": record.reason, "values": {}}, {})
    packed = pack(record)
    arrays = {name: value for name, value in packed.items() if isinstance(value, np.ndarray)}
    values = {name: value for name, value in packed.items() if name not in arrays}
    return to_bytes({**head, "status": DONE, "reason": "", "values": values}, arrays)


def record_from(data: bytes, key: str, cls: type[T], spec: str) -> T | Failure:
    """The record in a file's content.

    Raises
    ------
    DamagedError
        Its checksum does not hold, or it is another record's.
    OtherVersionError
        It is whole, and of another format, scenario or class.
    """
    meta, arrays = from_bytes(data)
    if meta.get("key") != key:
        raise DamagedError(f"key is {meta.get('key')!r} instead of {key!r}")
    for name, value in (("format", FORMAT), ("spec_sha256", spec)):
        if meta.get(name) != value:
            raise OtherVersionError(f"{name} is {meta.get(name)!r} instead of {value!r}")
    if meta.get("status") == FAILED:
        return Failure(str(meta.get("reason")))
    try:
        return unpack(cls, {**meta["values"], **arrays})
    except (ValueError, TypeError, KeyError, InputError) as error:
        raise OtherVersionError(str(error)) from error


def strict_json(text: bytes | str) -> dict[str, Any]:
    """A JSON object without nan, infinity or duplicate keys.

    Raises
    ------
    ValueError
        It is not one.
    """

    def refuse(word: str) -> None:
        raise ValueError(f"{word} is not a JSON number")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        if len(set(keys)) < len(keys):
            raise ValueError(f"duplicate key {max(keys, key=keys.count)!r}")
        return dict(pairs)

    try:
        value = json.loads(text, parse_constant=refuse, object_pairs_hook=unique)
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
