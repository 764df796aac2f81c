"""Which loops play many replicates: numpy's for a few, compiled ones for many.

The choice follows the work, never whether compiled code is kept: the bits of a result must not
hang on that. Without numba all are numpy's, equal but for the order of sums.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

MANY = 50_000
"""Replicates from which compiling is worth its while: it takes some 15 s where no code is kept."""
NUMBA = find_spec("numba") is not None


class Loops(NamedTuple):
    """Two loops over replicates, 32 side by side; see `calib.kernels.replicates`."""

    gradient: Callable[..., None]
    noisy_poses: Callable[..., None]


def loops_for(replicates: int) -> Loops:
    """The loops for so many replicates, ready for threads."""
    if replicates < MANY or not NUMBA:
        from calib.kernels import plain

        return Loops(plain.gradient, plain.noisy_poses)
    from calib.kernels.noisy_poses import noisy_poses
    from calib.kernels.replicates import gradient

    return Loops(gradient, noisy_poses)
