"""One record, one file: a frozen dataclass or a failure, with what it belongs to."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from calib.errors import InputError
from testbed.store import npz
from testbed.store.codec import pack, unpack
from testbed.store.layout import FORMAT

T = TypeVar("T")
DONE, FAILED = "done", "failed"


@dataclass(frozen=True, slots=True)
class Failure:
    """A record that could not be computed, and why."""

    reason: str


def record_bytes(key: str, record: object, spec: str) -> bytes:
    """The file of one record: its content, its key and the hash of what it depends on."""
    head = {"format": FORMAT, "key": key, "spec_sha256": spec}
    if isinstance(record, Failure):
        return npz.to_bytes({**head, "status": FAILED, "reason": record.reason, "values": {}}, {})
    packed = pack(record)
    arrays = {name: value for name, value in packed.items() if isinstance(value, np.ndarray)}
    values = {name: value for name, value in packed.items() if name not in arrays}
    return npz.to_bytes({**head, "status": DONE, "reason": "", "values": values}, arrays)


def record_from(data: bytes, key: str, cls: type[T], spec: str) -> T | Failure:
    """The record in a file's content.

    Raises
    ------
    DamagedError
        Its checksum does not hold, or it is another record's, scenario's or format's.
    """
    meta, arrays = npz.from_bytes(data)
    wanted = {"format": FORMAT, "key": key, "spec_sha256": spec}
    for name, value in wanted.items():
        if meta.get(name) != value:
            raise npz.DamagedError(f"{name} is {meta.get(name)!r} instead of {value!r}")
    if meta.get("status") == FAILED:
        return Failure(str(meta.get("reason")))
    try:
        return unpack(cls, {**meta["values"], **arrays})
    except (ValueError, TypeError, KeyError, InputError) as error:
        raise npz.DamagedError(str(error)) from error
