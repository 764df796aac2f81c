"""Drift of pose accuracy and repeatability after ISO 9283: blocks of cycles against the first."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index, frozen
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.measurement.cycles import FEWEST, cycles_of, per_pose

DRAWS = 999
"""Orders of the cycles that tell what no drift would read."""
MOST = 2_000_000
"""Readings in all of them together: fewer orders of more cycles."""
BLOCK = 10
"""Cycles of a block, as the standard takes them."""


@dataclass(frozen=True, slots=True, eq=False)
class DriftFigures:
    """DAP and dRP of e poses, and what they read where nothing drifts."""

    accuracy: Array
    """(e, b) AP of each block of cycles [m]."""
    repeatability: Array
    """(e, b) RP of each [m]."""
    by_chance: Array
    """(e, 2) mean of dAP and dRP over random orders of the same cycles [m]."""
    chance: Array
    """(e, 2) what 95 % of them stay below [m]."""
    p_values: Array
    """(e, 2) share of random orders that change as much."""
    p_value: float
    """Of all poses and both figures together: the share of orders in which any of them, against its
    own size by chance, changes as much as the most striking one did."""

    @property
    def values(self) -> Array:
        """DAP and dRP (e, 2): the largest change against the first block [m]."""
        return np.stack([_change(self.accuracy), _change(self.repeatability)], axis=1)


@checked_kinds
def drift(position: ArrayLike, command: ArrayLike, *, block: int = BLOCK) -> DriftFigures:
    """Compare blocks of `block` cycles with the first one, cycles in the order of time.

    Parameters
    ----------
    position : (e, n, 3) array_like
        Attained positions; what is left after the last whole block belongs to that one [m].
    command : (e, 3) array_like
        Commanded positions [m].
    block : int
        Cycles of a block.

    Notes
    -----
    Without drift any order of whole cycles is as likely as the measured one: a permutation test,
    exact for any scatter. All poses change places together, so that what is common to a cycle
    stays together.

    Raises
    ------
    InputError
        A3: there are not two blocks.
    """
    x = cycles_of(position)
    n = x.shape[-2]
    blocks = n // max(block, 1)
    if x.ndim != 3 or block < FEWEST or blocks < 2:
        allowed = f"two blocks of {FEWEST} cycles or more, (e, n, 3) positions"
        raise refuse("block", block, allowed, code="A3")
    c = per_pose(command, x.shape[:1], "command", (3,))
    bounds = [*(block * k for k in range(blocks)), n]
    orders = orders_of(n, DRAWS)
    every = [_figures(each[orders], to, bounds) for each, to in zip(x, c, strict=True)]
    AP, RP = (np.stack([one[k][0] for one in every]) for k in (0, 1))
    # the measured order is the first one, and counts; sums of other orders differ by rounding
    changes = np.stack([[_change(figures) for figures in one] for one in every])  # (e, 2, orders)
    reached = changes >= changes[:, :, :1] * (1 - 1e-12)
    size = np.maximum(np.median(changes, axis=2, keepdims=True), 1e-300)
    striking = (changes / size).max(axis=(0, 1))
    return DriftFigures(
        frozen(AP), frozen(RP), frozen(changes.mean(axis=2)),
        frozen(np.quantile(changes, 0.95, axis=2)), frozen(reached.mean(axis=2)),
        float((striking >= striking[0] * (1 - 1e-12)).mean()),
    )  # fmt: skip


@lru_cache(maxsize=2)
def orders_of(n: int, draws: int) -> Index:
    """The measured order of n cycles, and random ones (k, n); fewer of many cycles."""
    rng = np.random.default_rng(9283)
    several = range(max(min(draws, MOST // n), 99))
    orders = np.stack([np.arange(n), *(rng.permutation(n) for _ in several)])
    orders.flags.writeable = False
    return orders


def _figures(x: Array, command: Array, bounds: list[int]) -> tuple[Array, Array]:
    """AP and RP (k, b) of blocks of cycles (k, n, 3)."""
    AP, RP = [], []
    for first, last in pairwise(bounds):
        part = x[:, first:last]
        center = part.mean(axis=1, keepdims=True)
        away = np.linalg.norm(part - center, axis=2)
        AP.append(np.linalg.norm(center[:, 0] - command, axis=1))
        RP.append(away.mean(axis=1) + 3 * away.std(axis=1, ddof=1))
    return np.stack(AP, axis=1), np.stack(RP, axis=1)


def _change(figures: Array) -> Array:
    """Largest change (...,) of figures (..., b) against the first block."""
    return np.asarray(np.abs(figures[..., 1:] - figures[..., :1]).max(axis=-1))
