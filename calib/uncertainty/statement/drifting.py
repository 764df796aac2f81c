"""Whether noise remembers, asked of rows in time order; and what a drift then leaves."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Index
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.statement.memory import (
    REMEMBERS,
    SlowDrift,
    drift,
    memory_p,
    whitened_positions,
)
from calib.uncertainty.statement.misfit import HiddenMisfit

SEED = 20_221
"""Of the permutations: the same readings give the same answer."""
FEWEST = 12
"""Rows below which no memory is looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Drifting:
    """The answer of the rows in their order."""

    p_value: float
    """Chance of residuals that follow their neighbors as these do, if noise forgets."""
    drift: SlowDrift | None
    """What it leaves in the estimate; None where the rows show no memory."""

    @property
    def sentence(self) -> str:
        """The result in words."""
        if self.drift is None:
            return f"the readings do not follow their neighbors in time (p = {self.p_value:.2g})"
        size = f"{1e6 * self.drift.sd:.1f} um per axis over {self.drift.memory:.0f} rows"
        if self.p_value >= REMEMBERS:
            return f"a drift of up to {size} is in the region"
        return (
            f"the readings follow their neighbors in time (p = {self.p_value:.2g}): a drift of up "
            f"to {size} is in the region; measure nests, poses in random order, or a second round"
        )


def drifting(
    identification: Identification,
    train: Measurements,
    train_order: Index,
    held_out: Measurements,
    held_out_order: Index,
    *,
    hidden: HiddenMisfit,
    whatever: bool = False,
) -> Drifting | None:
    """Ask whether noise remembers; None for distances or a handful of rows.

    Parameters
    ----------
    identification, train, train_order, held_out, held_out_order
        As in `drift`.
    hidden : HiddenMisfit
        What misfit there may be beside a drift.
    whatever : bool
        Whether to state what a drift may leave even if none is seen.
    """
    both = joined([train, held_out]) if len(held_out) else train
    if both.is_distance.any() or len(both) < FEWEST:
        return None
    residual = whitened_positions(identification, both)
    order = np.concatenate([train_order, held_out_order])
    p = memory_p(residual, order, np.random.default_rng(SEED))
    if p >= REMEMBERS and not whatever:
        return Drifting(p, None)
    slow = drift(
        identification, train, train_order, held_out, held_out_order,
        shape=hidden.shape, misfit=hidden.best,
    )  # fmt: skip
    return Drifting(p, slow if slow.sd > 0 else None)
