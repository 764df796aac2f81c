"""Comparison of pose sets with random ones of their size over robots, by simultaneous intervals.

The robot is the unit, and every comparison is made in pairs on the same robots. Among many sets,
some would look better or worse by luck. So "better" and "worse" are decided by simultaneous
intervals (Bonferroni), which all hold at once with 95 % probability.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from calib.arrays import Array
from testbed.store.quantities import METRE, Quantity, below
from testbed.studies.over_robots import (
    Outcome,
    family_confidence,
    log_ratio_over_robots,
    mean_over_robots,
    outcome_of,
)
from testbed.studies.trial.records import Campaign, Trial
from testbed.units import Mean

POPULATION = "population"
MANY_TRIALS = 6
"""With more trials than this the report has a comparison by size and kind of set."""


@dataclass(frozen=True, slots=True, eq=False)
class PopulationStudy:
    """Every trial's pose set on many virtual robots, each measured once: the robot is the unit."""

    trials: Annotated[tuple[str, ...], "s"]
    """(s,) names of the trials."""
    mean_error: Annotated[Array, "s", "e", "R"]
    """(s, e, R) mean held-out position error against the truth, per trial, estimator, robot [m]."""
    rms_error: Annotated[Array, "s", "e", "R"]
    """(s, e, R) root mean square of the same [m]."""
    stated_u: Annotated[Array, "s", "e", "R"]
    """(s, e, R) root mean square over held-out poses of the stated 3-D u [m]."""
    inside: Annotated[Array, "s", "e", "R"]
    """(s, e, R) share of held-out points inside their stated 95 % region."""
    before: Annotated[Array, "R"]
    """(R,) mean held-out error of the nominal model [m]."""
    goal_u: Annotated[Array, "s", "R"]
    """(s, R) RMS tool-point u over the goal that the set promised, from the nominal model [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One pose set over all robots, first estimator of the scenario."""

    trial: Trial
    poses: int
    goal_u: float
    """RMS tool-point u over the goal that the set promised [m]; random: over all its draws."""
    efficiency: float | None
    """Certified fraction of the best value of its own criterion; None without certificate."""
    error: Mean
    """Mean held-out error, over robots [m]."""
    noise: float
    """RMS over robots of the stated u, the error that noise causes in one calibration [m]."""
    model: float
    """RMS error that noise does not explain, the model's own [m]; zero if the 95 % interval of its
    square contains zero."""
    ratio: Mean | None
    """Logarithm of the error over the random set's, 95 % interval; None for the random set."""
    joint: Mean | None
    """The same with an interval that holds for all comparisons of the campaign at once."""
    wins: float
    """Share of robots on which it beats the random set."""

    @property
    def outcome(self) -> Outcome:
        """Whether the simultaneous interval lies on one side of 1."""
        return "undecided" if self.joint is None else outcome_of(self.joint)


@dataclass(frozen=True, slots=True, eq=False)
class Contest:
    """All comparisons of a campaign."""

    sizes: tuple[int, ...]
    """Numbers of poses, ascending."""
    entries: tuple[Entry, ...]
    """Pose sets in the order of the trials."""
    comparisons: int
    """Number of intervals that hold at once."""
    robots: int

    def of_size(self, poses: int) -> tuple[Entry, ...]:
        """The sets of one size, best first; equal ones by name."""
        chosen = (entry for entry in self.entries if entry.poses == poses)
        return tuple(sorted(chosen, key=lambda entry: (_ratio(entry), entry.trial.name)))

    def reference(self, poses: int) -> Entry:
        """The random set of one size."""
        return next(e for e in self.entries if e.poses == poses and e.ratio is None)


def population_of(campaign: Campaign) -> PopulationStudy | None:
    """Every trial's set on many robots; None if the study was not played."""
    return campaign.records.find(POPULATION, PopulationStudy)


def random_partner(campaign: Campaign, trial: Trial) -> Trial | None:
    """The first random trial with as many poses."""
    size = len(trial.selection)
    return next(
        (t for t in campaign.trials if t.method == "random" and len(t.selection) == size), None
    )


def has_contest(campaign: Campaign) -> bool:
    """Whether a campaign is about comparing many pose sets."""
    study = population_of(campaign)
    return (
        study is not None
        and study.before.size > 1
        and len(campaign.trials) > MANY_TRIALS
        and any(random_partner(campaign, t) not in (None, t) for t in campaign.trials)
    )


def contest_of(campaign: Campaign) -> Contest:
    """All pose sets that have a random partner of their size."""
    study = population_of(campaign)
    assert study is not None, "asked only where many robots were played"
    pairs = [(t, p) for t in campaign.trials if (p := random_partner(campaign, t)) is not None]
    comparisons = sum(trial is not partner for trial, partner in pairs)
    entries = tuple(_entry(study, trial, partner, comparisons) for trial, partner in pairs)
    sizes = tuple(sorted({entry.poses for entry in entries}))
    return Contest(sizes, entries, comparisons, study.before.size)


def _entry(study: PopulationStudy, trial: Trial, partner: Trial, comparisons: int) -> Entry:
    """One set beside its random partner."""
    i, k = study.trials.index(trial.name), study.trials.index(partner.name)
    errors, other = study.mean_error[i, 0], study.mean_error[k, 0]
    noise = study.stated_u[i, 0] ** 2
    beyond = mean_over_robots(study.rms_error[i, 0] ** 2 - noise)
    itself = trial is partner
    proof = trial.selection.certificate
    return Entry(
        trial=trial,
        poses=len(trial.selection),
        goal_u=rms(study.goal_u[i]),
        # each robot had its own random set, so the certificate of one does not apply
        efficiency=None if proof is None or trial.method == "random" else proof.efficiency,
        error=mean_over_robots(errors),
        noise=float(noise.mean()) ** 0.5,
        model=beyond.value**0.5 if beyond.low > 0 else 0.0,
        ratio=None if itself else log_ratio_over_robots(errors, other),
        joint=None
        if itself
        else log_ratio_over_robots(errors, other, probability=family_confidence(comparisons)),
        wins=float((errors < other).mean()),
    )


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _ratio(entry: Entry) -> float:
    """Sort key of an entry."""
    return 0.0 if entry.ratio is None else entry.ratio.value


def published(campaign: Campaign) -> list[Quantity]:
    """Errors over many robots in result.json; none if the study is off."""
    study = population_of(campaign)
    return [] if study is None else below("population", _population(study, campaign))


def _population(study: PopulationStudy, campaign: Campaign) -> Iterator[Quantity]:
    """Errors of each set by estimator, and their ratio to those of the random set of its size."""
    yield Quantity("robots", study.before.size)
    yield Quantity("before_mean_mm", study.before.mean(), METRE)
    entries = contest_of(campaign).entries if study.before.size > 1 else ()
    for i, name in enumerate(study.trials):
        for j, mode in enumerate(campaign.scenario.identification.estimators):
            key = f"trials/{name}/{mode}"
            yield Quantity(f"{key}/mean_mm", study.mean_error[i, j].mean(), METRE)
            yield Quantity(f"{key}/rms_mm", rms(study.rms_error[i, j]), METRE)
            yield Quantity(f"{key}/stated_u_3d_rms_mm", rms(study.stated_u[i, j]), METRE)
            yield Quantity(f"{key}/inside_95", study.inside[i, j].mean())
        yield Quantity(f"trials/{name}/promised_u_3d_rms_mm", rms(study.goal_u[i]), METRE)
        for entry in entries:
            if entry.trial.name == name and entry.ratio is not None and entry.joint is not None:
                key = f"trials/{name}/against_random"
                yield Quantity(f"{key}/error_ratio", np.exp(entry.ratio.value))
                for word, mean in (("ci_95", entry.ratio), ("joint_ci_95", entry.joint)):
                    yield Quantity(f"{key}/{word}", [np.exp(end) for end in (mean.low, mean.high)])
                yield Quantity(f"{key}/outcome", entry.outcome)
                yield Quantity(f"{key}/smaller_error_share", entry.wins)
