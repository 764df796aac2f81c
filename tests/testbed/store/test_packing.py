"""Arrays in few bytes come back bit for bit, and bytes that lie are refused."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest

from calib.arrays import Array, Bool
from testbed.store.npz import DamagedError, Failure, from_bytes, to_bytes
from testbed.store.packing import MOST_VALUES, packed, unpacked
from testbed.store.pieces import piece_bytes, piece_from

RNG = np.random.default_rng(3)
SHARES = (RNG.integers(0, 101, (2, 4, 250)) / 100).astype(np.float32)
ARRAYS = {
    "flags": RNG.random((3, 13)) < 0.5,
    "no flag": np.zeros((2, 0), bool),
    "shares": SHARES,
    "zeros": np.array([0.0, -0.0] * 40),
    "all different": RNG.standard_normal((2, 300)),
    "one too many": np.tile(np.arange(MOST_VALUES + 1.0), 3),
    "late": np.concatenate([np.zeros(2000), np.arange(1000.0)]),
    "words": np.array(["inside", "edge", "outside"] * 50),
    "long words": np.array(["a" * 9, "b" * 9] * 90),
    "numbers": np.arange(5),
    "turned": np.arange(12.0).reshape(3, 4).T,
    "none": np.zeros((0, 250), np.float32),
    "scalar": np.array(2.5),
}


def test_arrays_come_back_bit_for_bit_in_any_order():
    table, data = packed(ARRAYS)
    found = unpacked(dict(reversed(table.items())), data)
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        back = found[name]
        assert (back.dtype, back.shape) == (array.dtype, array.shape), name
        assert back.tobytes() == array.tobytes(), name
    numbered = [name for name, (*_, count) in table.items() if count]
    assert sorted(numbered) == ["shares", "words", "zeros"]


def test_shares_and_flags_take_a_byte_and_a_bit():
    """Of float32 and a byte: 101 shares stand once, then one byte for each of 2000."""
    different = len(np.unique(SHARES))
    assert len(packed({"shares": SHARES})[1]) == 4 * different + SHARES.size
    assert len(packed({"flags": np.ones(250, bool)})[1]) == 32


@pytest.mark.parametrize(
    ("entry", "data"),
    [
        (["<f8", [3], 0], bytes(16)),
        (["<f8", [1], 0], bytes(16)),
        (["<f8", [-1], 0], b""),
        (["<f8", [10**15], 0], bytes(16)),
        (["|b1", [10**15], 0], bytes(16)),
        (["<f8", [2.0], 0], bytes(16)),
        (["<f8", [8], 1], bytes(15) + b"\x01"),
        (["<U9", [8], 1], bytes(44)),
        (["|O", [2], 0], bytes(16)),
        (["<V8", [2], 0], bytes(16)),
        (["f8, f8", [1], 0], bytes(16)),
        (["no type", [2], 0], bytes(16)),
        (["<f8", [2]], bytes(16)),
        (5, bytes(16)),
    ],
)
def test_what_does_not_agree_with_its_bytes_is_refused(entry, data):
    with pytest.raises((ValueError, TypeError)):
        unpacked({"a": entry}, data)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a record of many robots."""

    share: Annotated[Array, "R"]
    flag: Annotated[Bool, "R"]
    word: str = "x"


def test_a_piece_gives_each_part_again_and_tells_what_is_wrong_with_one():
    parts = {"a.x": Part(SHARES[0, 0].astype(float), SHARES[1, 1] > 0.5), "a.y": Failure("no luck")}
    data = piece_bytes("a.000001", parts, "5", "cpu", single=True)
    stored = piece_from(data, "a.000001", "5")
    back = stored.part("a.x", Part)
    assert back.share.tobytes() == SHARES[0, 0].astype(float).tobytes()  # hundredths of float32
    assert (back.flag == parts["a.x"].flag).all()
    assert (back.word, stored.part("a.y", Part).reason) == ("x", "no luck")
    meta, blocks = from_bytes(data)
    meta["parts"]["a.x"]["arrays"]["share"][1] = [249]
    with pytest.raises(DamagedError, match="left over"):
        piece_from(to_bytes(meta, blocks), "a.000001", "5").part("a.x", Part)
    with pytest.raises(DamagedError):
        stored.part("a.z", Part)
