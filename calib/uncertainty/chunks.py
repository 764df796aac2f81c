"""Random work in chunks of fixed size, each with its own stream: same bits for any thread count."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from calib.errors import InputError

R = TypeVar("R")
X = TypeVar("X")


def mapped(work: Callable[[X], R], items: Sequence[X], threads: int = 1) -> list[R]:
    """``work`` of each item, in the order of the items, on so many threads."""
    if threads < 1:
        raise InputError(
            f"threads is {threads}", code="C41", field="threads", value=threads, allowed="1 or more"
        )
    if threads == 1 or len(items) <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))


def in_chunks(
    work: Callable[[np.random.Generator, int], R],
    rng: np.random.Generator,
    total: int,
    *,
    size: int,
    threads: int = 1,
) -> list[R]:
    """Results of ``work(stream, count)`` for every chunk, in order; counts add up to `total`.

    The streams are children of `rng`, one per chunk: which thread does a chunk, and when, changes
    nothing. Asking again with the same `rng` gives fresh streams.
    """
    counts = [min(size, total - start) for start in range(0, total, size)]
    try:
        streams = rng.spawn(len(counts))
    except TypeError:
        raise InputError(
            "rng cannot make independent streams",
            code="A3",
            field="rng",
            fix="make it with numpy.random.default_rng(seed)",
        ) from None
    return mapped(lambda item: work(*item), list(zip(streams, counts, strict=True)), threads)
