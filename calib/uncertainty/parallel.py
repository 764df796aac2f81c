"""Random work in batches of fixed size, each with its own stream: same bits on any threads."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from calib.errors import refuse

R = TypeVar("R")
X = TypeVar("X")


def mapped(work: Callable[[X], R], items: Sequence[X], threads: int = 1) -> list[R]:
    """``work`` of each item, in the order of the items, on so many threads."""
    if threads < 1:
        raise refuse("threads", threads, "1 or more", code="C41")
    if threads == 1 or len(items) <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))


def in_batches(
    work: Callable[[np.random.Generator, int], R],
    rng: np.random.Generator,
    total: int,
    *,
    size: int,
    threads: int = 1,
) -> list[R]:
    """Results of ``work(stream, count)`` for every batch, in order; counts add up to `total`.

    The streams are children of `rng`, one per batch: which thread does a batch, and when, changes
    nothing. Asking again with the same `rng` gives fresh streams.
    """
    counts = [min(size, total - start) for start in range(0, total, size)]
    try:
        streams = rng.spawn(len(counts))
    except TypeError:
        message, fix = "rng cannot make independent streams", "numpy.random.default_rng(seed)"
        raise refuse("rng", code="A3", message=message, fix=f"make it with {fix}") from None
    return mapped(lambda item: work(*item), list(zip(streams, counts, strict=True)), threads)
