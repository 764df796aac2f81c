"""Shots that go wrong or fail, drawn from streams of their own."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Index
from calib.errors import InputError


@dataclass(frozen=True, slots=True)
class Mishaps:
    """Shots that go wrong in each visit."""

    outliers: int = 0
    """Grossly wrong ones; nothing in the data says which."""
    position_sd: float = 0.0
    """Of an outlier, per axis [m]."""
    rotation_sd: float = 0.0
    """Of an outlier, per axis [rad]."""
    missed: int = 0
    """Failed ones; their rows are missing."""


def streams_below(rng: np.random.Generator) -> list[np.random.Generator]:
    """Four streams of a stream's own, whatever it has given away already."""
    seeds = rng.bit_generator.seed_seq
    if not isinstance(seeds, np.random.SeedSequence):
        raise RuntimeError("the noise needs a generator made from a seed")
    return [
        np.random.default_rng(
            np.random.SeedSequence(seeds.entropy, spawn_key=(*seeds.spawn_key, _BELOW, k))
        )
        for k in range(4)
    ]


_BELOW = 0x7472  # apart from the children that `spawn` counts from 0


def some_rows(m: int, count: int, rng: np.random.Generator, key: str) -> Index:
    """Rows (count,) of m, each one once."""
    if count > m:
        raise InputError(
            f"[tracker] {key} is {count}; the visit has {m} shots",
            code="M27",
            field=f"tracker.{key}",
            value=count,
            fix=f"write {key} = {max(m - 1, 0)} or fewer",
        )
    return np.asarray(rng.permutation(m)[:count])
