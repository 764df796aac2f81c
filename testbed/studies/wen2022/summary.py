"""Results of the re-examination, each figure with its interval over pools and robots."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Annotated, TypeVar

import numpy as np

from calib.arrays import Array
from testbed.scenario.tables import BudgetSettings
from testbed.store.quantities import METRE
from testbed.studies.over_robots import Outcome, family_confidence, outcome_of
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.paper_set import designed_trials
from testbed.studies.wen2022.ratio import Split, over, over_pools, share_over, split_of
from testbed.studies.wen2022.records import (
    ESTIMATORS,
    PoolSets,
    Reexamined,
    TrialSets,
    environment,
    reexamined_of,
)
from testbed.studies.wen2022.settings import SETS_KEY
from testbed.units import MM, Mean


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """Uncertainty from noise alone of a designed set relative to random ones, over pools."""

    trial: str
    poses: int
    against: int
    """Poses of the random sets."""
    estimator: str
    numbers: Mean
    """Mean over the numbers of u / mean u of random sets."""
    tool: Mean
    """The same for the tool point at the held-out poses."""


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """True held-out error of a designed set against that of random sets of its size."""

    truth: str
    trial: str
    poses: int
    estimator: str
    by_paper: bool
    error: Annotated[Mean, METRE]
    """Mean error with the designed set [m]."""
    other: Annotated[Mean, METRE]
    """Mean error with random sets [m]."""
    ratio: Mean
    """Logarithm of the ratio."""
    joint: Mean
    """The same with an interval that holds for all comparisons at once."""

    @property
    def outcome(self) -> Outcome:
        """Better or worse if the joint interval lies on one side of 1."""
        return outcome_of(self.joint)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """How often 95 % statements from u_best contain the truth on one kind of robot."""

    truth: str
    trial: str
    shares: tuple[Mean, ...]
    """(4,) share of held-out points inside each statement."""
    numbers: Mean
    """Share of the 24 numbers within t u_best."""
    u: Annotated[Mean, METRE]
    """Stated u of |P| [m]."""
    error: Mean
    """Mean held-out error [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PaperRow:
    """One set of Tables 1 and 2 on one kind of robots, paper estimator; lengths in m."""

    printed: paper.SetErrors
    place: int
    """Index of the trial in the record."""
    own_before: Annotated[Mean, METRE]
    own_after: Annotated[Mean, METRE]
    after: Annotated[Mean, METRE]


T = TypeVar("T", Split, Errors, Held)
S = TypeVar("S", Split, Held)


def of_kind(found: Sequence[T], kind: Reexamined) -> list[T]:
    """The results on one kind of robots."""
    return [one for one in found if one.truth == kind.truth]


def first_of(found: Sequence[S], trial: str) -> list[S]:
    """The results with those of one trial first."""
    return sorted(found, key=lambda one: one.trial != trial)


@dataclass(frozen=True, eq=False)
class Reexamination:
    """The paper's protocol on many robots: its records and results."""

    kinds: tuple[Reexamined, ...]
    """One record per kind of robots, at least one, in the order of the scenario."""
    sets: PoolSets
    repeats: int
    """Number of repeats of each optimal set, and of the random one."""
    paper_set: str
    """Trial that stands for the paper's optimal set, that of Table 3."""
    budget: BudgetSettings
    """Constants of the protocol."""

    @property
    def robots(self) -> int:
        """Robots of each kind."""
        return self.kinds[0].before.size

    @cached_property
    def judged(self) -> Reexamined:
        """The kind whose error after calibration is nearest to the printed one, by ratio."""
        printed = float(np.mean([row.held_out_mm for row in paper.SETS])) / MM
        return min(self.kinds, key=lambda kind: abs(np.log(kind.error[:, 0].mean() / printed)))

    @property
    def u_c(self) -> Array:
        """(f,) the environment's part [m or rad]."""
        return environment(self.budget, self.sets.names)

    @property
    def others(self) -> tuple[Reexamined, ...]:
        """The other kinds."""
        return tuple(kind for kind in self.kinds if kind is not self.judged)

    @cached_property
    def splits(self) -> tuple[Split, ...]:
        """The split for every kind of robot and optimal set, in the order of the records."""
        poses = {one.trial: one.poses for one in self.sets.sets}
        return tuple(
            split_of(
                kind, trial, poses[trial], (kind.u_best[i], kind.u_r, kind.u_p, kind.u_w), self.u_c
            )
            for kind in self.kinds
            for i, trial in enumerate(kind.best)
        )

    @property
    def pairs(self) -> list[tuple[TrialSets, TrialSets]]:
        """Every designed set beside the first random trial with as many poses, if there is one."""
        trials = self.sets.sets[:-1]
        random = {one.poses: one for one in reversed(trials) if not one.designed}
        return [(one, random[one.poses]) for one in trials if one.designed and one.poses in random]

    @cached_property
    def predictions(self) -> tuple[Predicted, ...]:
        """Designed against random sets of the same size, then against the budget's random set."""
        partners, budget = dict(self.pairs), self.sets.sets[-1]
        return tuple(
            Predicted(
                one.trial,
                one.poses,
                other.poses,
                estimator,
                over_pools((one.u[:, k] / other.u[:, k]).mean(axis=1)),
                over_pools(one.tool_u[:, k] / other.tool_u[:, k]),
            )
            for one in self.sets.sets
            if one.designed
            for other in filter(None, (partners.get(one), budget))
            for k, estimator in enumerate(ESTIMATORS)
        )

    @cached_property
    def errors(self) -> tuple[Errors, ...]:
        """Kinds of robots in their order, then designed trials, then estimators."""
        together = family_confidence(len(self.kinds) * len(self.pairs) * len(ESTIMATORS))
        found = []
        for kind, (one, other) in product(self.kinds, self.pairs):
            mine, theirs = (kind.error[kind.trials.index(t.trial)] for t in (one, other))
            for k, estimator in enumerate(ESTIMATORS):
                ratio = np.log(mine[k] / theirs[k])
                means = [over(values, kind.pool) for values in (mine[k], theirs[k], ratio)]
                means.append(over(ratio, kind.pool, probability=together))
                about = (kind.truth, one.trial, one.poses, estimator, one.by_paper)
                found.append(Errors(*about, *means))
        return tuple(found)

    @cached_property
    def statements(self) -> tuple[Held, ...]:
        """Kinds of robots in their order, then the paper's optimal sets."""
        points, numbers = self.sets.test_q.shape[1], len(self.sets.names)
        return tuple(
            Held(
                kind.truth,
                trial,
                tuple(share_over(inside, points, kind.pool) for inside in kind.inside[i]),
                share_over(kind.numbers_inside[i], numbers, kind.pool),
                over(kind.distance_u[i], kind.pool),
                over(kind.error[kind.trials.index(trial), 0], kind.pool),
            )
            for kind in self.kinds
            for i, trial in enumerate(kind.best)
        )

    def paper_rows(self, kind: Reexamined) -> tuple[PaperRow, ...]:
        """Tables 1 and 2 on one kind of robots; none unless all four sets were played."""
        found = []
        # other designs are neither the paper's nor random
        trials = [one for one in self.sets.sets[:-1] if one.designed == one.by_paper]
        for row in paper.SETS:
            like = [t.trial for t in trials if row.is_like(t.poses, t.designed, t.criterion)]
            if not like:
                return ()
            i = kind.trials.index(like[0])
            figures = (kind.own_before[i], kind.own_after[i], kind.error[i, 0])
            found.append(PaperRow(row, i, *(over(figure, kind.pool) for figure in figures)))
        return tuple(found)


def reexamination_of(campaign: Campaign) -> Reexamination | None:
    """The re-examination over many robots; None if it was not played."""
    scenario, kinds = campaign.scenario, reexamined_of(campaign)
    if not kinds:
        return None
    return Reexamination(
        kinds,
        campaign.records.get(SETS_KEY, PoolSets),
        scenario.uncertainty.repeats,
        designed_trials(scenario)[0],
        scenario.budget,
    )
