"""Saddles of numbers that no reading tells where a fit has ended, and the way down from there.

Where readings are the same on both sides of a number, as distances are on either side of a plane,
they have no slope by it: a fit that begins between the two ends there, where the prior of the
number holds it, and the gradient is zero at what is no minimum. Second derivatives tell.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from calib.arrays import Array, Index
from calib.identification.tangent import System

X = TypeVar("X")

UNTOLD = 1e-3
"""Slope of the readings by a number, in noises for a prior sd of it, below which they tell none."""
PROBE = 1e-3
"""Step of the second derivatives, in units of the prior sd."""
LENGTHS = 0.5 ** np.arange(16)
"""Steps down that are tried, likewise."""
CURVED = 1e-2
"""Curvature that counts, in units of the prior's."""
ALIKE = 1e-3
"""Part of the way down by which the other side of a saddle may differ and count as alike."""


class WayDown(NamedTuple):
    """A step down from a saddle."""

    step: Array
    """(p,)"""
    along: Index
    """Places of the numbers that it moves."""
    both: bool
    """Whether the step to the other side leads as far down."""


def way_down(
    evaluate: Callable[[X], System], move: Callable[[X, Array], X], x: X, some: Index, sd: Array
) -> WayDown | None:
    """The best step down from where a fit has ended, None where that is a minimum.

    Parameters
    ----------
    evaluate, move
        As in `least_squares.solve`.
    x : X
        Where the fit has ended.
    some : (k,) array of int
        Places of the numbers that are looked at: those that have a prior.
    sd : (k,) array
        Of that prior.

    References
    ----------
    Nocedal & Wright 2006, theorem 2.3: at a minimum the second derivatives are positive
    semidefinite, and so are those by a part of the numbers.
    """
    here = evaluate(x)
    normal = System(here.r, here.A).normal[0]
    untold = np.sqrt(np.diagonal(normal)[some]) * sd < UNTOLD
    some, sd = some[untold], sd[untold]
    if not len(some):
        return None

    def stepped(units: Array) -> Array:
        step = np.zeros(len(normal))
        step[some] = sd * units
        return step

    def pull(units: Array) -> Array:
        """Half of the gradient, its sign turned."""
        return np.asarray(sd * evaluate(move(x, stepped(units))).normal[1][some])

    own = sd * here.normal[1][some]
    curvature = np.array([own - pull(PROBE * unit) for unit in np.eye(len(some))]) / PROBE
    values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
    if not values[0] < -CURVED:
        return None
    down = vectors[:, 0] * np.where(vectors[np.abs(vectors[:, 0]).argmax(), 0] < 0, -1.0, 1.0)

    def cost(units: Array) -> float:
        found = evaluate(move(x, stepped(units))).normal[2]
        return found if np.isfinite(found) else np.inf

    drops = np.array([here.normal[2] - cost(length * down) for length in LENGTHS])
    best = int(np.argmax(drops))
    if not drops[best] > 0:
        return None
    other = here.normal[2] - cost(-LENGTHS[best] * down)
    along = some[np.abs(down) > ALIKE]
    both = bool(abs(other - drops[best]) < ALIKE * drops[best])
    return WayDown(stepped(LENGTHS[best] * down), along, both)
