"""Self-checking files of pieces of work: parts of one or more records, each done or failed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import IO, Any, TypeVar

import numpy as np

from calib.errors import CalibError, InputError
from testbed.store.codec import pack, unpack
from testbed.store.layout import FORMAT
from testbed.store.npz import (
    DONE,
    FAILED,
    DamagedError,
    Failure,
    OtherVersionError,
    from_bytes,
    require_own,
    to_bytes,
)

T = TypeVar("T")
OF_PART = "/"
"""Stands between the key of a record and the path of a field of its part."""


def piece_name(cut: str, piece: int) -> str:
    """What a piece is called in its file and by its file."""
    return f"{cut}.{piece:06d}"


def piece_bytes(
    name: str, parts: Mapping[str, object], spec: str, processor: str, *, single: bool = False
) -> bytes:
    """The file of one piece: the part of each record or its `Failure`, and who computed it.

    With `single`, figures of each robot are rounded to float32.
    """
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    told: dict[str, Any] = {}
    for key, part in parts.items():
        if isinstance(part, Failure):
            told[key] = {"status": FAILED, "reason": part.reason, "values": {}}
            continue
        packed = pack(part, single=single)
        found = {path: value for path, value in packed.items() if isinstance(value, np.ndarray)}
        arrays |= {f"{key}{OF_PART}{path}": value for path, value in found.items()}
        values = {path: value for path, value in packed.items() if path not in found}
        told[key] = {"status": DONE, "reason": "", "values": values}
    head = {"format": FORMAT, "key": name, "spec_sha256": spec, "processor": processor}
    return to_bytes({**head, "parts": told}, arrays)


@dataclass(frozen=True, slots=True, eq=False)
class StoredPiece:
    """The content of the file of one piece, checked; a part is made when it is asked for."""

    processor: str
    """Kind of processor that computed it."""
    failures: Mapping[str, str]
    """Why parts failed, by the key of their record."""
    values: Mapping[str, Mapping[str, Any]]
    """Of each part what is no array, by the key of its record."""
    arrays: Mapping[str, np.ndarray[Any, Any]]

    def part(self, key: str, cls: type[T]) -> T | Failure:
        """The part of one record.

        Raises
        ------
        DamagedError
            There is none, or it does not fit the class.
        """
        if key in self.failures:
            return Failure(self.failures[key])
        start = f"{key}{OF_PART}"
        arrays = {
            name.removeprefix(start): array
            for name, array in self.arrays.items()
            if name.startswith(start)
        }
        try:
            return unpack(cls, {**self.values[key], **arrays})
        except (ValueError, TypeError, KeyError, InputError) as error:
            raise OtherVersionError(str(error)) from error
        except CalibError as error:  # a number that is not finite: no version writes one
            raise DamagedError(str(error)) from error


def piece_from(data: bytes | IO[bytes], name: str, spec: str) -> StoredPiece:
    """The piece in a file's content.

    Raises
    ------
    DamagedError
        Its checksum does not hold, it is another piece, or of another scenario, size or version.
    """
    meta, arrays = from_bytes(data)
    require_own(meta, name, spec)
    try:
        told = meta["parts"].items()
        failures = {key: str(one["reason"]) for key, one in told if one["status"] == FAILED}
        values = {key: dict(one["values"]) for key, one in told}
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise OtherVersionError(f"{type(error).__name__}: {error}") from error
    return StoredPiece(str(meta.get("processor", "")), failures, values, arrays)
