"""How much memory a piece of work takes."""

import tracemalloc
from contextlib import contextmanager


@contextmanager
def peak_below(most):
    """What is done within never holds so many bytes at once."""
    tracemalloc.start()
    try:
        yield
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < most
