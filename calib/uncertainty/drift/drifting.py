"""Whether noise remembers, asked of rows in time order; and what a drift then leaves.

Where the poses themselves follow their neighbors, misfit does, too: then rows of different poses
cannot tell it from a drift, and the region allows for one; where their order hides one that goes
steadily from the first row to the last, for that as well. Visits of one pose share its misfit and
can tell; without them the question is void. Where poses follow their neighbors so little that it
may be chance, the misfit that hangs on where they stand is taken off before the question is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import LATER, Array, FloatOrNan, Index
from calib.identification.fit_statistics import RED
from calib.identification.folds import FEWEST_TO_CONFIRM, FOLDS
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import tool_poses
from calib.shown import length_words
from calib.uncertainty.drift.memory import (
    REMEMBERS,
    SlowDrift,
    drift,
    interchangeable,
    memory_p,
    seen_by_rows,
    visits_of_poses,
    whitened_positions,
)
from calib.uncertainty.drift.steady import SteadyDrift, steady_drift
from calib.uncertainty.statement.evidence import sound_rows
from calib.uncertainty.statement.misfit import HiddenMisfit

SEED = 20_221
"""Of the permutations: the same readings give the same answer."""
FEWEST = 12
"""Rows below which no memory is looked for."""
SURE = 0.01
"""A p-value below which readings are said to follow their neighbors, and what to do: of good sets
one in a hundred, as of shots that do not fit. Up to `REMEMBERS` a drift is only allowed for."""
TELLING = FOLDS * FEWEST_TO_CONFIRM
"""Training poses below which no joint errors can be confirmed: what they bend an arm by may then be
all that readings which follow their neighbors show. Of nine arms that sag, measured at 7 training
and 20 held-out poses by a plan, two were said to drift, at p = 0.01 and 0.004; none did."""
AGAIN = 12
"""Poses that show a steady drift once they are measured again at the end: of .1 and of .3 mm it was
named in all of 24 sets of 80 poses sorted by the first joint, of which 8 named none."""
ORDERED = 0.01
"""Chance of poses as near their neighbors as these in a random order; below it the test is void."""


@dataclass(frozen=True, slots=True, eq=False)
class Drifting:
    """The answer of the rows in their order."""

    p_value: FloatOrNan
    """Chance of residuals that follow their neighbors as these do, if noise forgets; nan where the
    poses do not stand in a random order and were not visited again."""
    drift: SlowDrift | None
    """What it leaves in the estimate; None where the rows show no memory."""
    of_visits: bool = False
    """Whether visits of one pose tell it, since the poses do not stand in a random order."""
    steady: Annotated[SteadyDrift | None, LATER] = None
    """One that goes steadily all session long, where the order of the poses hides it."""
    few: Annotated[int, LATER] = 0
    """Training poses where they are fewer than `TELLING` and the model misses them by more than
    noise: that is as good an explanation. Else 0."""

    @property
    def covariance(self) -> Array | None:
        """(P, P) of all numbers, from both [m, rad]; None where the region has neither."""
        parts = [one.covariance for one in (self.drift, self.steady) if one is not None]
        return np.asarray(np.sum(parts, axis=0)) if parts else None

    @property
    def void(self) -> bool:
        """Whether the order of the poses leaves nothing to ask."""
        return bool(np.isnan(self.p_value))

    @property
    def hides_one(self) -> bool:
        """Whether rows speak for a steady drift, of which their order hides the rest."""
        return self.void and self.steady is not None and self.steady.p_value < SURE

    @property
    def seen(self) -> bool:
        """Whether rows follow their neighbors so that something is to be done about it."""
        return self.drift is not None and self.p_value < SURE and not self.few

    @property
    def sentence(self) -> str:
        """The result in words."""
        size = ""
        if self.drift is not None:
            size = length_words(self.drift.sd, um=".1f")
            size += f" per axis over {self.drift.memory:.0f} rows"
        if self.void:
            return self._undecided(size)
        steady = "" if self.steady is None else f"; the region includes {self.steady.words}"
        return f"{self._decided(size)}{steady}"

    def _decided(self, size: str) -> str:
        """Whether readings drift, as their order or visits of the same poses tell."""
        which = "differences between visits of one pose" if self.of_visits else "readings"
        if not size:
            return f"the order of the {which} shows no drift (p = {self.p_value:.2g})"
        if self.p_value >= REMEMBERS:
            return f"the region includes a drift of up to {size}"
        if self.few:
            return (
                f"the region includes a drift of up to {size} as a precaution: that successive "
                f"{which} agree so well (p = {self.p_value:.2g}), what the model misses explains "
                f"as well, and {self.few} training poses do not tell the two apart"
            )
        if self.p_value >= SURE:
            return (
                f"the region includes a drift of up to {size} as a precaution: that successive "
                f"{which} agree so well (p = {self.p_value:.2g}) also happens by chance, in one "
                f"of {1 / REMEMBERS:.0f} sets without any drift"
            )
        return (
            f"successive {which} are correlated (p = {self.p_value:.2g}), so the region includes "
            f"a drift of up to {size}; measure drift nests, poses in random order, or a second "
            "round"
        )

    def _undecided(self, size: str) -> str:
        """That nothing tells whether readings drift, and what the region has of it."""
        left = f"includes one of up to {size}" if size else "does not include one"
        end = "a second round in the same order would decide it"
        if self.steady is not None:
            left = f"{left}, and" if size else "includes"
            left += f" {self.steady.words}"
            end += f"; the first {AGAIN} poses once more at the end would show the steady one"
        return (
            "whether the readings drift cannot be decided, because neighboring poses were measured "
            f"one after another, where the model misses much the same; the region {left}; {end}"
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
    alike = interchangeable(order, pose, is_test, seen_by_rows(both))
    stands = where_poses_stand(both.q, tool_poses(identification.model, both)[:, :3, 3])

    def follows_in_time(values: Array) -> float:
        return memory_p(values, order, np.random.default_rng(SEED), alike)

    ordered = follows_in_time(stands) < ORDERED
    p = follows_in_time(residual if ordered else beside_misfit(residual, stands, alike))
    asked = whatever or p < REMEMBERS
    if ordered:
        # rows follow their neighbors by a drift, or by misfit along a tour. A few visits that show
        # none do not rule it out: how large it may be beside them, its likelihood says
        p = _between_visits(residual, order, visits_of_poses(order, pose, _seen(both)))
        asked = asked or p < REMEMBERS
    if np.isnan(hidden.best):
        # where the rows bound no misfit, they bound no drift beside it
        return Drifting(p, None, ordered)
    rows = (identification, train, train_order, held_out, held_out_order)
    size, shape = hidden.best, hidden.shape
    slow = drift(*rows, shape=shape, misfit=size) if asked else None
    steady = steady_drift(*rows, shape=shape, misfit=size) if ordered else None
    few = train.n_poses if train.n_poses < TELLING and hidden.p_value < RED else 0
    left = slow if slow is not None and slow.sd > 0 else None
    return Drifting(p, left, ordered, steady, 0 if ordered else few)


def _seen(table: Measurements) -> Array:
    """What rows (m, d) of one pose must have in common for the model to miss the same there."""
    came = table.conditions.approach
    seen = seen_by_rows(table)
    return seen if came is None else np.ascontiguousarray(np.column_stack([seen, came]))


def _between_visits(residual: Array, order: Index, alike: tuple[Index, ...]) -> float:
    """Chance of rows that follow their neighbors so by what visits (k, c) of one pose differ by.

    Not a number for a handful of rows.
    """
    if sum(visits.size for visits in alike) < FEWEST:
        return np.nan
    about = np.zeros_like(residual)  # poses without other visits tell nothing
    for visits in alike:
        about[visits] = residual[visits] - residual[visits].mean(axis=0)
    return memory_p(about, order, np.random.default_rng(SEED), alike)


def where_poses_stand(q: Array, p: Array) -> Array:
    """What misfit hangs on (..., m, 2 n + 3): joints, how far each is from its middle, the tool.

    Poses may be sorted by the size of an angle, or by height, and no joint follows its neighbors.

    Parameters
    ----------
    q : (..., m, n) array
        Joints [rad, m].
    p : (..., m, 3) array
        Places of the tool [m].
    """
    joints, place = (x - x.mean(axis=-2, keepdims=True) for x in (q, p))
    squares = joints**2
    squares = squares - squares.mean(axis=-2, keepdims=True)
    # of the tool one size for all axes: whatever frame it is seen in
    size = np.sqrt((place**2).mean(axis=(-2, -1), keepdims=True))
    parts = [_of_unit_size(joints), _of_unit_size(squares), place / np.where(size > 0, size, 1.0)]
    return np.concatenate(parts, axis=-1)


def beside_misfit(residual: Array, stands: Array, alike: Sequence[Index]) -> Array:
    """Residuals (..., m, 3) less the misfit that follows where their poses stand.

    Poses in no strict order may still follow their neighbors a little more than by chance, as those
    of twenty do along a tour; and so does a misfit as large as the noise. What is left depends on
    no order: in a random one the test keeps its level, whatever is taken off.

    Parameters
    ----------
    residual : (..., m, 3) array
        Whitened: that of the noise has variance one.
    stands : (..., m, d) array
        From `where_poses_stand`.
    alike : sequence of (k, c) arrays of int
        Rows that may change places, from `interchangeable`.

    References
    ----------
    r - F inv(F'F + c I) F'r, r and F about the means of their kinds: the best linear guess (BLUP)
    of a misfit linear in F with the variance that r has beyond that of the noise, if any, in the
    mean over the rows: c = mean |F_j|^2 / (mean r^2 - 1), no guess where r has no more than noise.
    """
    r, F = residual.copy(), stands.copy()
    for rows in alike:
        for x in (r, F):
            x[..., rows, :] -= x[..., rows, :].mean(axis=(-3, -2), keepdims=True)
    excess = np.maximum((r**2).mean(axis=(-2, -1)) - 1, 0.0)[..., None, None]
    width = (F**2).sum(axis=-1).mean(axis=-1)[..., None, None]
    F = F * np.sqrt(excess / np.where(width > 0, width, 1.0))
    turned = np.swapaxes(F, -1, -2)
    guess = F @ np.linalg.solve(turned @ F + np.eye(F.shape[-1]), turned @ r)
    return np.asarray(np.where(excess > 0, r - guess, residual))


def _of_unit_size(x: Array) -> Array:
    """Columns (..., m, n) about zero with standard deviation one; those that stand still stay."""
    size = np.sqrt((x**2).mean(axis=-2, keepdims=True))
    return np.asarray(x / np.where(size > 0, size, 1.0))
