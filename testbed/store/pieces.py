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
from testbed.store.packing import packed, unpacked

T = TypeVar("T")
NOBODY = "nobody"
"""Stands for the processor of a piece that took its processes with it, and was not played."""
BLOCK = "/arrays"
"""Follows the key of a record in the name of the arrays of its part."""


def piece_name(cut: str, piece: int) -> str:
    """What a piece is called in its file and by its file."""
    return f"{cut}.{piece:06d}"


def piece_bytes(
    name: str, parts: Mapping[str, object], spec: str, processor: str, *, single: bool = False
) -> bytes:
    """The file of one piece: the part of each record or its `Failure`, and who computed it.

    With `single`, figures of each robot are rounded to float32. The arrays of each part are one
    entry of the archive: as entries of their own they would take more for their heads than many of
    them have to say.
    """
    blocks: dict[str, np.ndarray[Any, Any]] = {}
    told: dict[str, Any] = {}
    for key, part in parts.items():
        if isinstance(part, Failure):
            told[key] = {"status": FAILED, "reason": part.reason}
            continue
        content = pack(part, single=single)
        values = {
            name: value for name, value in content.items() if not isinstance(value, np.ndarray)
        }
        arrays = {name: value for name, value in content.items() if name not in values}
        table, block = packed(arrays)
        told[key] = {"status": DONE, "values": values, "arrays": table}
        blocks[f"{key}{BLOCK}"] = np.frombuffer(block, np.uint8)
    head = {"format": FORMAT, "key": name, "spec_sha256": spec, "processor": processor}
    return to_bytes({**head, "parts": told}, blocks)


@dataclass(frozen=True, slots=True, eq=False)
class StoredPiece:
    """The content of the file of one piece, checked; a part is made when it is asked for."""

    processor: str
    """Kind of processor that computed it."""
    failures: Mapping[str, str]
    """Why parts failed, by the key of their record."""
    told: Mapping[str, Mapping[str, Any]]
    """Of each part what is no array, and where the arrays are, by the key of its record."""
    blocks: Mapping[str, np.ndarray[Any, Any]]
    """Its arrays."""

    @property
    def played(self) -> bool:
        """Whether what it holds came of playing it; else it is worth another try."""
        return self.processor != NOBODY

    def part(self, key: str, cls: type[T]) -> T | Failure:
        """The part of one record.

        Raises
        ------
        DamagedError
            There is none, or it does not fit the class.
        """
        if key in self.failures:
            return Failure(self.failures[key])
        try:
            told = self.told[key]
            arrays = unpacked(told["arrays"], self.blocks[f"{key}{BLOCK}"].tobytes())
            return unpack(cls, {**told["values"], **arrays})
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
    meta, blocks = from_bytes(data)
    require_own(meta, name, spec)
    try:
        told = dict(meta["parts"])
        failures = {k: str(one["reason"]) for k, one in told.items() if one["status"] == FAILED}
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise OtherVersionError(f"{type(error).__name__}: {error}") from error
    return StoredPiece(str(meta.get("processor", "")), failures, told, blocks)
