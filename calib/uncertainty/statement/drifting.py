"""Whether noise remembers, asked of rows in time order; and what a drift then leaves.

Where the poses themselves follow their neighbors, misfit does, too: then the question is void.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import FloatOrNan, Index
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.statement.evidence import sound_rows
from calib.uncertainty.statement.memory import (
    REMEMBERS,
    SlowDrift,
    drift,
    interchangeable,
    memory_p,
    whitened_positions,
)
from calib.uncertainty.statement.misfit import HiddenMisfit

SEED = 20_221
"""Of the permutations: the same readings give the same answer."""
FEWEST = 12
"""Rows below which no memory is looked for."""
SURE = 0.01
"""A p-value below which readings are said to follow their neighbors, and what to do: of good sets
one in a hundred, as of shots that do not fit. Up to `REMEMBERS` a drift is only allowed for."""
ORDERED = 0.01
"""Chance of poses as near their neighbors as these in a random order; below it the test is void."""


@dataclass(frozen=True, slots=True, eq=False)
class Drifting:
    """The answer of the rows in their order."""

    p_value: FloatOrNan
    """Chance of residuals that follow their neighbors as these do, if noise forgets; nan where the
    poses do not stand in a random order."""
    drift: SlowDrift | None
    """What it leaves in the estimate; None where the rows show no memory."""

    @property
    def void(self) -> bool:
        """Whether the order of the poses leaves nothing to ask."""
        return bool(np.isnan(self.p_value))

    @property
    def sentence(self) -> str:
        """The result in words."""
        size = ""
        if self.drift is not None:
            size = f"{1e6 * self.drift.sd:.1f} um per axis over {self.drift.memory:.0f} rows"
        if self.void:
            left = f"one of up to {size} is" if size else "what it leaves is not"
            return (
                "whether the readings drift cannot be told: poses near each other were measured "
                f"after each other, and what the model misses there is alike; {left} in the region"
            )
        if not size:
            return f"no drift is seen in the order of the readings (p = {self.p_value:.2g})"
        if self.p_value >= REMEMBERS:
            return f"a drift of up to {size} is in the region"
        if self.p_value >= SURE:
            return (
                f"a drift of up to {size} is in the region to be safe: that the readings follow "
                f"their neighbors so (p = {self.p_value:.2g}) happens by chance as well, once in "
                f"{1 / REMEMBERS:.0f} sets without any drift"
            )
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
    counts = sound_rows(identification, len(train))
    some = train.rows(counts)
    both = joined([some, held_out]) if len(held_out) else some
    if both.is_distance.any() or len(both) < FEWEST:
        return None
    residual = whitened_positions(identification, both)
    order = np.concatenate([train_order[counts], held_out_order])
    is_test = np.repeat([False, True], [len(some), len(held_out)])
    pose = np.concatenate([some.pose_id, -1 - held_out.pose_id])  # numbered apart
    alike = interchangeable(order, pose, is_test)
    spread = both.q.std(axis=0)
    joints = both.q[:, spread > 0] / spread[spread > 0]
    near, p = (
        memory_p(values, order, np.random.default_rng(SEED), alike) for values in (joints, residual)
    )
    p = np.nan if near < ORDERED else p
    if (not p < REMEMBERS and not whatever) or np.isnan(hidden.best):
        return Drifting(p, None)  # where the rows bound no misfit, they bound no drift beside it
    slow = drift(
        identification, train, train_order, held_out, held_out_order,
        shape=hidden.shape, misfit=hidden.best,
    )  # fmt: skip
    return Drifting(p, slow if slow.sd > 0 else None)
