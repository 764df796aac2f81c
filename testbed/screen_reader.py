"""Whether what is printed is for a screen reader: no drawn lines, no bar, one fact a line."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

PLAIN = "TRUEBED_PLAIN"
"""Variable of the environment that says so for every verb."""


def is_plain() -> bool:
    """Whether it is."""
    return bool(os.environ.get(PLAIN))


@contextmanager
def plain_if(wanted: bool) -> Iterator[None]:
    """A block that prints so, if it is wanted or has been all along."""
    before = os.environ.get(PLAIN)
    if wanted:
        os.environ[PLAIN] = "1"
    try:
        yield
    finally:
        if wanted and before is None:
            del os.environ[PLAIN]
        elif wanted and before is not None:
            os.environ[PLAIN] = before
