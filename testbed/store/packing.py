"""Arrays one after the other, each in few bytes that give it back bit for bit.

Flags take a bit each. Where an array has few different values, as shares of a hundred poses have,
these stand once and each entry is the number of its value.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from testbed.store.codec import KINDS

Table = dict[str, list[Any]]
"""What lies in the bytes, by name: dtype, shape, number of different values (0: they stand as they
are)."""
MOST_VALUES = 256
"""The number of a value is a byte."""
LOOKED_AT = 1024
"""Entries that tell whether there may be few values: a large array is not sorted for nothing."""
WIDEST = 32
"""Bytes of a value that is numbered, which bounds what a file may grow to in memory."""


def packed(arrays: Mapping[str, np.ndarray[Any, Any]]) -> tuple[Table, bytes]:
    """Arrays in the order of their names, and what says where each of them is."""
    table: Table = {}
    pieces = []
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        count, data = _coded(array.reshape(-1))
        table[name] = [array.dtype.str, list(arrays[name].shape), count]
        pieces.append(data)
    return table, b"".join(pieces)


def unpacked(table: Mapping[str, Any], data: bytes) -> dict[str, np.ndarray[Any, Any]]:
    """The arrays again; nothing larger is made than the table and the bytes agree on.

    Raises
    ------
    ValueError, TypeError
        They do not.
    """
    arrays, at = {}, 0
    for name in sorted(table):
        word, shape, count = table[name]
        dtype = np.dtype(str(word))
        whole = all(type(n) is int and n >= 0 for n in (*shape, count))
        if dtype.kind not in KINDS or not whole or (count and dtype.itemsize > WIDEST):
            raise ValueError(f"{name} is {table[name]}, which is not an array")
        size = math.prod(shape)
        each = size if count else -(-size // 8) if dtype.kind == "b" else size * dtype.itemsize
        end = at + count * dtype.itemsize + each
        if end > len(data):
            raise ValueError(f"{name} claims more bytes than there are")
        arrays[name] = _read(data[at:end], dtype, size, count).reshape(shape)
        at = end
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes are left over")
    return arrays


def _coded(flat: np.ndarray[Any, Any]) -> tuple[int, bytes]:
    """How many values are numbered, and the bytes of a flat array."""
    if flat.dtype.kind == "b":
        return 0, np.packbits(flat).tobytes()
    # as bits: the two zeros stay two
    bits = flat.view(f"u{flat.itemsize}") if flat.dtype.kind == "f" else flat
    if flat.itemsize <= WIDEST and len(np.unique(bits[:LOOKED_AT])) <= MOST_VALUES:
        values, places = np.unique(bits, return_inverse=True)
        if len(values) <= MOST_VALUES and values.nbytes + flat.size < flat.nbytes:
            return len(values), values.tobytes() + places.astype(np.uint8).tobytes()
    return 0, flat.tobytes()


def _read(data: bytes, dtype: np.dtype[Any], size: int, count: int) -> np.ndarray[Any, Any]:
    """A flat array of `size` entries."""
    if count:
        values = np.frombuffer(data, dtype, count)
        places = np.frombuffer(data, np.uint8, size, offset=values.nbytes)
        if size and places.max() >= count:
            raise ValueError(f"value {places.max()} of {count}")
        return np.asarray(values[places])
    if dtype.kind == "b":
        return np.unpackbits(np.frombuffer(data, np.uint8), count=size).astype(np.bool_)
    return np.frombuffer(data, dtype, size)
