"""A guard against code that hangs, which is no measure of speed: benchmarks take that."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest

HANGS = 40.0
"""CPU time [s] after which a guarded block is held to hang: fifteen times what any of them takes on
a slow machine that does other work too, and far less than their inputs take where it hangs."""


@contextmanager
def no_hang(seconds: float = HANGS) -> Iterator[None]:
    """A block that ends; one that does not is a failure as soon as its CPU time is spent.

    Inputs must be so large that code which tries all beginnings of a text, or rows once for each
    row, would take far longer. Where that cannot be, count what is called instead.
    """

    def over(number: int = 0, frame: FrameType | None = None) -> None:
        pytest.fail(f"hangs: not done after {seconds:g} s of CPU")

    start = time.process_time()
    if hasattr(signal, "setitimer"):  # elsewhere it is only seen at the end
        before = signal.signal(signal.SIGPROF, over)
        signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.signal(signal.SIGPROF, before)
    if time.process_time() - start > seconds:
        over()
