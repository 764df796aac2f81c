"""Which loops play many replicates or fit springs of many robots: of few numpy's, else compiled.

The choice follows the work, never whether compiled code is kept: the bits of a result must not
hang on that. Without numba, or with one that is not made for this Python or numpy, all are numpy's,
equal but for the order of sums.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

MANY = 50_000
"""Replicates from which compiling is worth its while: it takes some 15 s where no code is kept."""
MANY_SPRUNG = 250
"""Robots whose springs are fitted from which it is: their climb then takes half as long."""
NUMBA = find_spec("numba") is not None
"""Whether it is installed; it is imported only where work is large enough for it."""


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
    """What fits springs of one model for so many robots; None where numpy serves."""
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
