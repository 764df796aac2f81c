"""What the re-examination shows: each figure with its interval, printed figures taken apart alike.

Where there are several pools, the unit of every interval is the pool with its robots, so that it
holds the luck of the sets that were chosen from it too; with one pool the robot is the unit.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from testbed.studies.many_robots import Outcome, family_confidence, mean_over_robots, outcome_of
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.pools import BUDGET_SET
from testbed.studies.wen2022.records import ESTIMATORS, STATEMENTS, PoolSets, Reexamined, TrialSets
from testbed.units import MM, Mean

PRINTED = "printed"


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """The ratio of the paper's protocol and what it is made of; means over the 24 numbers."""

    who: str
    """Kind of robots, or `PRINTED`: then intervals have no width."""
    trial: str
    """The optimal set."""
    poses: int
    ratio: Mean
    """u_best / u_rand."""
    repeats: Mean
    """u_r of the optimal set over u_r of 50 random poses."""
    counted: Mean
    """u_r / u_rand: what the random side counts besides."""
    geometric: tuple[float, float, float]
    """Geometric means of the same three: the first is the product of the others."""
    shares: tuple[Mean, Mean, Mean]
    """Of u_r, u_p, u_w in the variance of u_rand."""
    p_over_r: Mean
    w_over_r: Mean


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """What noise alone makes of a designed set against random ones, over pools."""

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
    error: Mean
    """Mean error with the designed set [m]."""
    other: Mean
    """With random sets [m]."""
    ratio: Mean
    """Logarithm of the ratio."""
    joint: Mean
    """The same with an interval that holds for all comparisons at once."""

    @property
    def outcome(self) -> Outcome:
        """Better or worse where the joint interval lies on one side of 1."""
        return outcome_of(self.joint)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """What 95 % statements from u_best hold on one kind of robot."""

    truth: str
    trial: str
    shares: tuple[Mean, ...]
    """(4,) of held-out points, per statement."""
    numbers: Mean
    """Of the 24 numbers within 1.96 u_best."""
    u: Mean
    """Stated u of |P| [m]."""
    error: Mean
    """Mean held-out error [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PaperRow:
    """One set of Tables 1 and 2 on one kind of robots, paper estimator; lengths in m."""

    printed: paper.SetErrors
    place: int
    """Of the trial in the record."""
    own_before: Mean
    own_after: Mean
    after: Mean


def by_unit(values: Array, pool: Index) -> Array:
    """Figures per robot (..., R) as means per pool (..., P); with one pool they stay as they are.

    Parameters
    ----------
    values : (..., R) array
        One figure per robot.
    pool : (R,) array
        Pool of each robot, 0 to P - 1, each as often.
    """
    pools = int(pool.max()) + 1
    if pools == 1:
        return values
    return np.stack([values[..., pool == p].mean(axis=-1) for p in range(pools)], axis=-1)


def over(values: Array, pool: Index, *, probability: float = 0.95) -> Mean:
    """Mean of one figure per robot (R,) with its interval over units."""
    return mean_over_robots(by_unit(values, pool), probability=probability)


def over_pools(values: Array) -> Mean:
    """Mean of one figure per pool (P,); with one pool the interval is infinite."""
    return Mean(float(values[0]), float("inf")) if len(values) < 2 else mean_over_robots(values)


def splits(studies: Sequence[Reexamined], sets: PoolSets) -> tuple[Split, ...]:
    """Every kind of robot and optimal set of the paper, in the order of the records."""
    found = []
    for study in studies:
        for i, trial in enumerate(study.best):
            poses = set_named(sets, trial).poses
            parts = (study.u_best[i], study.u_r, study.u_p, study.u_w)
            found.append(_split(study.truth, trial, poses, parts, study.pool))
    return tuple(found)


def printed_split() -> Split:
    """Table 3 taken apart; u_rand is the root sum of squares of its printed parts."""
    parts = [paper.table3(column)[None] for column in paper.PARTS]
    return _split(PRINTED, PRINTED, 0, parts, np.zeros(1, dtype=np.int64))


def _split(who: str, trial: str, poses: int, parts: Sequence[Array], pool: Index) -> Split:
    """From u_best, u_r, u_p, u_w (R, f) each."""
    best, u_r, u_p, u_w = parts
    random = np.sqrt(u_r**2 + u_p**2 + u_w**2)

    def mean(figures: Array) -> Mean:
        """Over the numbers, then over the units."""
        each = figures.mean(axis=1)
        return Mean(float(each[0]), 0.0) if len(each) == 1 else over(each, pool)

    geometric = (
        float(np.exp(np.log(part).mean())) for part in (best / random, best / u_r, u_r / random)
    )
    r, p, w = (mean(part**2 / random**2) for part in (u_r, u_p, u_w))
    return Split(
        who=who,
        trial=trial,
        poses=poses,
        ratio=mean(best / random),
        repeats=mean(best / u_r),
        counted=mean(u_r / random),
        geometric=tuple(geometric),  # type: ignore[arg-type]  # three of them
        shares=(r, p, w),
        p_over_r=mean(u_p / u_r),
        w_over_r=mean(u_w / u_r),
    )


def predictions(sets: PoolSets) -> tuple[Predicted, ...]:
    """Designed against random sets of the same size, then against the budget's random set."""
    found = []
    budget = set_named(sets, BUDGET_SET)
    for one in (each for each in sets.sets if each.designed):
        others = [other for other in (partner_of(sets, one), budget) if other is not None]
        for other in others:
            for k, estimator in enumerate(ESTIMATORS):
                numbers = (one.u[:, k] / other.u[:, k]).mean(axis=1)
                tool = one.tool_u[:, k] / other.tool_u[:, k]
                figures = over_pools(numbers), over_pools(tool)
                found.append(Predicted(one.trial, one.poses, other.poses, estimator, *figures))
    return tuple(found)


def set_named(sets: PoolSets, trial: str) -> TrialSets:
    """The sets of one trial; those of the budget come last."""
    if trial == BUDGET_SET:
        return sets.sets[-1]
    return next(one for one in sets.sets if one.trial == trial)


def partner_of(sets: PoolSets, designed: TrialSets) -> TrialSets | None:
    """The first random trial with as many poses."""
    random = (one for one in sets.sets[:-1] if not one.designed)
    return next((one for one in random if one.poses == designed.poses), None)


def errors(studies: Sequence[Reexamined], sets: PoolSets) -> tuple[Errors, ...]:
    """Kinds of robots in their order, then designed trials, then estimators."""
    pairs = [(one, partner_of(sets, one)) for one in sets.sets if one.designed]
    cells = [
        (study, one, other, k)
        for study in studies
        for one, other in pairs
        if other is not None
        for k in range(len(ESTIMATORS))
    ]
    together, found = family_confidence(len(cells)), []
    for study, one, other, k in cells:
        mine, theirs = (study.error[study.trials.index(t.trial), k] for t in (one, other))
        ratio = np.log(mine / theirs)
        means = [over(values, study.pool) for values in (mine, theirs, ratio)]
        means.append(over(ratio, study.pool, probability=together))
        kind = (study.truth, one.trial, one.poses, ESTIMATORS[k], one.by_paper)
        found.append(Errors(*kind, *means))
    return tuple(found)


def statements(studies: Sequence[Reexamined]) -> tuple[Held, ...]:
    """Kinds of robots in their order, then the paper's optimal sets."""
    return tuple(
        Held(
            study.truth,
            trial,
            tuple(over(study.inside[i, s], study.pool) for s in range(len(STATEMENTS))),
            over(study.numbers_inside[i], study.pool),
            over(study.distance_u[i], study.pool),
            over(study.error[study.trials.index(trial), 0], study.pool),
        )
        for study in studies
        for i, trial in enumerate(study.best)
    )


def like_the_paper(studies: tuple[Reexamined, ...]) -> Reexamined:
    """The kind of robots whose error after calibration is nearest to the printed one, by ratio."""
    printed = float(np.mean([row.held_out_mm for row in paper.SETS])) / MM
    return min(studies, key=lambda study: abs(np.log(study.error[:, 0].mean() / printed)))


def paper_rows(study: Reexamined, sets: PoolSets) -> tuple[PaperRow, ...] | None:
    """Tables 1 and 2 on one kind of robots; None unless all four sets were played."""
    rows = []
    for printed in paper.SETS:
        trial = next((one.trial for one in sets.sets[:-1] if is_like(one, printed)), None)
        if trial is None:
            return None
        i = study.trials.index(trial)
        figures = (study.own_before[i], study.own_after[i], study.error[i, 0])
        rows.append(PaperRow(printed, i, *(over(figure, study.pool) for figure in figures)))
    return tuple(rows)


def is_like(one: TrialSets, printed: paper.SetErrors) -> bool:
    """Whether a kind of set is one of the paper's: its size, how and by which index chosen."""
    if one.poses != printed.poses:
        return False
    return one.by_paper and one.criterion == printed.index if printed.optimal else not one.designed
