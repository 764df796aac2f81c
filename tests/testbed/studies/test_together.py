"""Robots of many pieces become those of one, a piece in memory at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from calib.arrays import Array
from testbed.studies.many_robots import together
from tests.memory import peak_below

AXES = {"first": 0, "last": -1, "middle": 1, "word": 0, "none": -1}


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some robots."""

    first: Array
    last: Array
    middle: Array
    word: Array
    none: Array
    other: str


def part(k, count=3, dtype=np.float64):
    rng = np.random.default_rng(k)
    return Part(
        rng.random((count, 2)).astype(dtype), rng.random((2, 2, count)).astype(dtype),
        rng.random((2, count, 5)).astype(dtype), np.array([["in", "outside"][k % 2]] * count),
        np.zeros((0, count), dtype), f"part {k}",
    )  # fmt: skip


class Lazy(Sequence):
    def __init__(self, make, count):
        self.make, self.count = make, count

    def __len__(self):
        return self.count

    def __getitem__(self, k):
        if k >= self.count:
            raise IndexError
        return self.make(k)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_robots_come_in_the_order_of_their_parts(dtype):
    """Whatever the axis, the last piece smaller than the others, words of other lengths."""
    parts = Lazy(lambda k: part(k, 3 if k < 4 else 1, dtype), 5)
    found = together(parts, AXES)
    for name, axis in AXES.items():
        expected = np.concatenate([getattr(one, name) for one in parts], axis=axis)
        mine = getattr(found, name)
        assert (mine.dtype, mine.shape) == (expected.dtype, expected.shape)
        assert mine.tobytes() == expected.tobytes()
        assert mine.flags.c_contiguous
    assert found.other == "part 0"


def test_one_part_at_a_time_is_in_memory():
    parts = Lazy(lambda k: part(k, 250), 40)
    size = 250 * 40 * (2 + 4 + 10) * 8
    with peak_below(1.35 * size):  # the words, and a few parts
        together(parts, AXES)
