"""Choice of loops for many replicates, or springs of many robots: numpy for few, else compiled.

It depends on the amount of work, never on whether compiled code is cached, so that results are the
same to the bit. Without a numba that fits this Python and numpy, all loops are numpy's, with
results equal but for the order of sums.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

MANY = 50_000
"""Number of replicates from which compiling pays: it takes some 15 s if no code is cached."""
MANY_SPRUNG = 250
"""Number of robots from which compiling the fit of springs pays: it halves the time of a climb."""
NUMBA = find_spec("numba") is not None
"""Whether numba is installed; it is imported only if there is work enough for it."""


class Loops(NamedTuple):
    """Two loops over replicates, 32 side by side; see `calib.kernels.replicates`."""

    gradient: Callable[..., None]
    noisy_poses: Callable[..., None]


def compiles() -> bool:
    """Whether loops are compiled: numba is installed, and can be imported."""
    if not NUMBA:
        return False
    from calib.kernels.compiled import has_compiler

    return has_compiler()


def spring_loop_for(robots: int) -> Callable[..., None] | None:
    """Compiled loop that fits springs of one model for so many robots; None to use numpy."""
    if robots < MANY_SPRUNG or not compiles():
        return None
    from calib.kernels.springs import springs_of_rows

    return springs_of_rows


def loops_for(replicates: int) -> Loops:
    """The loops for so many replicates, ready for threads."""
    if replicates < MANY or not compiles():
        from calib.kernels import plain

        return Loops(plain.gradient, plain.noisy_poses)
    from calib.kernels.noisy_poses import noisy_poses
    from calib.kernels.replicates import gradient

    return Loops(gradient, noisy_poses)
