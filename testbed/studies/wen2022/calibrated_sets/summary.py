"""Results of calibrated random sets: ranks of the designed ones, spreads, index against error."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array
from calib.identification.identify import Mode
from testbed.store.quantities import METRE
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.calibrated_sets.records import (
    INDICES,
    AgainstRandom,
    random_calibrations_of,
)
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.units import MM, decimals, fixed


@dataclass(frozen=True, slots=True)
class OverSets:
    """One figure over several pose sets."""

    mean: float
    sd: float
    """Experimental standard deviation between the sets, n - 1; zero for a single one."""

    @property
    def millimetres(self) -> str:
        """A length [m] in mm, with its spread if it has one."""
        if not self.sd:
            return fixed(self.mean * MM, 3)
        places = max(3, decimals(self.sd * MM, 1))
        return f"{fixed(self.mean * MM, places)} ± {fixed(self.sd * MM, places)}"


def spread_of(values: Array) -> OverSets:
    """Mean and standard deviation of figures (K,), K at least 1."""
    return OverSets(float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else 0.0)


@dataclass(frozen=True, slots=True)
class Rank:
    """One designed set among random ones of its size, by one estimator; lengths in m."""

    trial: str
    poses: int
    criterion: str
    estimator: Mode
    index: str
    """Observability index that is compared with the errors: the set's own, or O1."""
    designed_index: float
    random_index: OverSets
    designed: Annotated[float, METRE]
    """Mean held-out error."""
    random: Annotated[OverSets, METRE]
    smallest: Annotated[float, METRE]
    largest: Annotated[float, METRE]
    own_before: Annotated[float, METRE]
    """Mean error of the nominal model on the designed set's own poses."""
    random_own_before: Annotated[OverSets, METRE]
    own_after: Annotated[float, METRE]
    random_own_after: Annotated[OverSets, METRE]
    sets: int
    """Number of random sets that were calibrated."""
    better_than: int
    """Number of random sets with a larger held-out error."""
    own_lower_than: int
    """Number of random sets with a larger error on their own poses."""
    starts_lower_than: int
    """Number of random sets with a larger error on their own poses before calibration."""
    correlation: float
    """Rank correlation of index and held-out error among the random sets."""
    correlation_ends: tuple[float, float]
    """Its 95 % interval."""


def rank_of(one: AgainstRandom, mode: Mode) -> Rank:
    """Rank of a designed set by one estimator."""
    k, drawn, own = ESTIMATORS.index(mode), one.random, one.designed
    i, index = index_of_choice(one)
    error, after = drawn.error[k], drawn.own_after[k]
    designed, own_after = float(own.error[k, 0]), float(own.own_after[k, 0])
    r, low, high = rank_correlation(drawn.index[i], error)
    return Rank(
        trial=one.trial,
        poses=one.poses,
        criterion=one.criterion,
        estimator=mode,
        index=index,
        designed_index=float(own.index[i, 0]),
        random_index=spread_of(drawn.index[i]),
        designed=designed,
        random=spread_of(error),
        smallest=float(error.min()),
        largest=float(error.max()),
        own_before=float(own.own_before[0]),
        random_own_before=spread_of(drawn.own_before),
        own_after=own_after,
        random_own_after=spread_of(after),
        sets=len(error),
        better_than=int((error > designed).sum()),
        own_lower_than=int((after > own_after).sum()),
        starts_lower_than=int((drawn.own_before > own.own_before[0]).sum()),
        correlation=r,
        correlation_ends=(low, high),
    )


def index_of_choice(one: AgainstRandom) -> tuple[int, str]:
    """Place and name of the index compared with errors: the set's own, or O1."""
    known = [k for k, name in enumerate(INDICES) if name == one.criterion]
    place = known[0] if known else 0
    return place, INDICES[place]


def ranks(campaign: Campaign) -> tuple[Rank, ...]:
    """Every designed set by every estimator; none if random sets were not calibrated."""
    study = random_calibrations_of(campaign)
    sets = study.sets if study else ()
    return tuple(rank_of(one, mode) for one in sets for mode in ESTIMATORS)


def rank_correlation(x: Array, y: Array) -> tuple[float, float, float]:
    """Spearman's rank correlation of two figures (n,), with its 95 % interval.

    Without spread in either figure, or with fewer than four pairs, it is 0 (-1 to 1). The value is
    that of `scipy.stats`, whose import alone takes a second; tests compare both.

    References
    ----------
    Fieller, Hartley & Pearson 1957: atanh r has a variance of about 1.06 / (n - 3).
    """
    if len(x) < 4 or not np.ptp(x) or not np.ptp(y):
        return 0.0, -1.0, 1.0
    r = float(np.corrcoef(_places(x), _places(y))[0, 1])
    half = 1.96 * (1.06 / (len(x) - 3)) ** 0.5
    middle = np.arctanh(np.clip(r, -1 + 1e-12, 1 - 1e-12))
    return r, float(np.tanh(middle - half)), float(np.tanh(middle + half))


def _places(values: Array) -> Array:
    """Rank of each value (n,), ties shared."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - (count - 1) / 2.0)[place])


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row of Tables 1 and 2 on the robot of this campaign, lengths in m."""

    printed: paper.SetErrors
    sets: int
    """Number of pose sets: one, or all random ones that were calibrated."""
    own_before: OverSets
    own_after: OverSets
    """Error on its own poses by the paper's estimator."""
    error: OverSets
    """Held-out error by the paper's estimator."""
    weighed: OverSets | None
    """Held-out error by the whitened estimator; None if not played."""


def table_rows(campaign: Campaign) -> tuple[TableRow | None, ...]:
    """A row for each printed one; None for a set that this campaign does not play.

    Random rows are those of all calibrated random sets; if there are none, of the one trial.
    """
    return tuple(_of_sets(campaign, row) or _of_trial(campaign, row) for row in paper.SETS)


def set_like(campaign: Campaign, printed: paper.SetErrors) -> AgainstRandom | None:
    """The designed set like the printed one of this index and size, among random ones."""
    study = random_calibrations_of(campaign)
    wanted = (printed.poses, printed.index)
    sets = study.sets if study else ()
    return next((one for one in sets if (one.poses, one.criterion) == wanted), None)


def _of_sets(campaign: Campaign, printed: paper.SetErrors) -> TableRow | None:
    """The row from calibrated sets."""
    one = set_like(campaign, printed)
    if one is None:
        return None
    sets = one.designed if printed.optimal else one.random
    figures = (sets.own_before, sets.own_after[0], *sets.error)
    return TableRow(printed, len(sets.own_before), *map(spread_of, figures))


def _of_trial(campaign: Campaign, printed: paper.SetErrors) -> TableRow | None:
    """The row from the first trial like a printed one."""
    own, weighed = (estimate_like(campaign, printed, mode) for mode in ESTIMATORS)
    if own is None:
        return None
    seen = own.comparison
    before, after, error = (
        OverSets(one.mean, 0.0)
        for one in (seen.identification_before, seen.identification_after, seen.accuracy_after)
    )
    other = None if weighed is None else OverSets(weighed.comparison.accuracy_after.mean, 0.0)
    return TableRow(printed, 1, before, after, error, other)


def estimate_of(trial: Trial, mode: str) -> Estimate | None:
    """The estimate of a trial by one estimator."""
    return next((estimate for estimate in trial.estimates if estimate.mode == mode), None)


def estimate_like(campaign: Campaign, printed: paper.SetErrors, mode: str) -> Estimate | None:
    """Our estimate from a set like a printed one, by one estimator."""
    for trial in campaign.trials:
        chosen, designed = trial.selection, trial.method != "random"
        if printed.is_like(len(chosen.indices), designed, chosen.criterion):
            return estimate_of(trial, mode)
    return None
