"""Which engine the command line asks for."""

import os

from calib.errors import refuse
from testbed.engines.engine import Alone, Engine

MOST = 61 if os.name == "nt" else 1000
"""Processes: Windows waits for no more at once."""

SCHEMES = ("tcp://", "tls://", "file:")


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def workers_of(text: str) -> int:
    """The number of processes that ``--workers`` asks for.

    Raises
    ------
    InputError
        C41: the text is not such a number.
    """
    if text == "auto":
        return min(cores(), MOST)
    if not (text.isascii() and text.isdigit() and len(text) < 5 and 1 <= int(text) <= MOST):
        allowed = f'it takes a whole number from 1 to {MOST}, or "auto"'
        raise refuse("--workers", text, allowed, code="C41")
    return int(text)


def slice_of(text: str) -> tuple[int, int]:
    """Number and count that ``--slice i/n`` asks for.

    Raises
    ------
    InputError
        C41: the text is not a slice.
    """
    number, _, count = text.partition("/")
    numbers = all(word.isascii() and word.isdigit() and len(word) < 7 for word in (number, count))
    if numbers and 1 <= int(number) <= int(count):
        return int(number), int(count)
    allowed = "it takes i/n for the i-th of n slices, i from 1 to n"
    raise refuse("--slice", text, allowed, code="C41", fix="write 1/4 ... 4/4 for four slices")


def crowded(workers: int) -> str:
    """A warning of more processes than cores; empty if there are enough cores."""
    if workers <= cores():
        return ""
    return (
        f"--workers is {workers}, but this process may use only {cores()} of the machine's cores: "
        "more workers need memory and are not faster"
    )


def engine_of(workers: int, scheduler: str | None = None) -> Engine:
    """The engine: a cluster if a scheduler is given, this process for one worker, else processes.

    Raises
    ------
    InputError
        C41, C42: both are given, or the scheduler cannot be used.
    """
    if scheduler is not None:
        from testbed.engines.cluster import Cluster
        from testbed.engines.kit import play_piece

        if workers != 1:
            raise refuse(
                "--workers", workers, "the scheduler has its own workers", code="C41",
                message=f"--workers is {workers} and --scheduler is given", fix="leave one out",
            )  # fmt: skip
        if not scheduler.startswith(SCHEMES):
            allowed = "it takes tcp://HOST:PORT, or file:PATH of the file that a scheduler writes"
            raise refuse("--scheduler", scheduler, allowed, code="C41")
        return Cluster(scheduler, play_piece)
    if workers == 1:
        return Alone()
    from testbed.engines.kit import play_piece
    from testbed.engines.processes import Processes

    return Processes(workers, play_piece)
