"""Results of the coverage study: cells with intervals, for the report and for result.json.

Many cells are judged together, so "falls short" is decided by bands that all hold at once with 95 %
probability (Bonferroni); the same applies to all parameters of a model.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtr, kolmogorov, ndtr

from calib.arrays import Array
from calib.uncertainty.drift.memory import REMEMBERS
from calib.uncertainty.regions import coverage_factor
from testbed.store.kept import each_row
from testbed.store.quantities import METRE, Quantity, below, in_si
from testbed.studies.coverage.study import BELIEVED, MODELS, STATEMENTS, CoverageStudy
from testbed.studies.over_robots import family_confidence, share_over_robots
from testbed.studies.trial.replications import BAND, binomial_band, chi_square_mean_band
from testbed.units import Mean

Outcome = Literal["holds", "wide", "short", "undecided", "refused"]
TWICE = 2.0
"""Factor on the promised share outside; an interval that allows so many needs more robots."""
ARRAYS = (
    *("inside", "radius_m", "mean_error_m", "p_value", "held_out_p", "flagged", "log_evidence"),
    *("believed", "growth", "p_drift", "nees", "normal_error"),
)
"""Fields of a study in arrays.npz; names of lengths end in their unit."""


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """One statement of one model on one kind of robot."""

    truth: str
    model: str
    statement: str
    level: float
    share: Mean
    """Share of held-out points inside, mean over robots with its 95 % interval."""
    joint: Mean
    """The same with an interval that holds for all cells at once."""
    radius: float
    """Mean volume-equivalent radius [m]."""
    refused: bool = False
    """Whether it is stated on no robot; the share then applies if it were used all the same."""

    @property
    def outcome(self) -> Outcome:
        """Whether the joint interval reaches the promise, lies above it, or below.

        Undecided if it also contains a share with `TWICE` as many points outside as promised.
        """
        if self.refused:
            return "refused"
        if self.joint.high < self.level:
            return "short"
        if self.joint.low > self.level:
            return "wide"
        return "holds" if self.joint.low >= 1 - TWICE * (1 - self.level) else "undecided"

    @property
    def believable(self) -> bool:
        """Whether nothing contradicts the promise, which means little with few robots."""
        return self.outcome != "short"

    @property
    def kept(self) -> bool:
        """Whether the promise is kept, with enough robots to show it."""
        return self.outcome in ("holds", "wide")


@dataclass(frozen=True, slots=True, eq=False)
class NumbersCheck:
    """Tests of the numbers of a geometric model that can match the truth: intervals, NEES, rank."""

    truth: str
    names: tuple[str, ...]
    shares: Array
    """(f,) share of robots whose interval contains the true value."""
    band: Array
    """(2,) contains all f shares at once in 99.9 % of studies with correct intervals."""
    nees: float
    """Mean NEES over robots; expected f."""
    nees_band: Array
    """(2,) 99.9 % band of that mean."""
    nees_p: float
    """P-value of its distribution, Kolmogorov-Smirnov against chi-square."""
    rank_p: float
    """P-value of the ranks of true values in the stated distributions: the smallest, times f."""

    @property
    def passed(self) -> bool:
        """Whether every test passes."""
        low, high = self.band
        return bool(
            low <= self.shares.min()
            and self.shares.max() <= high
            and self.nees_band[0] <= self.nees <= self.nees_band[1]
            and min(self.nees_p, self.rank_p) >= 1 - BAND
        )


def cells(studies: tuple[CoverageStudy, ...]) -> tuple[Cell, ...]:
    """Every cell: kinds of robots in their order, then models, then statements."""
    together = family_confidence(len(studies) * len(MODELS) * len(STATEMENTS))
    return tuple(
        Cell(
            study.truth,
            model,
            statement,
            study.level,
            share_over_robots(inside[j, made], points),
            share_over_robots(inside[j, made], points, probability=together),
            float(radius[j, made].mean()),
            statement == BELIEVED and not study.believed[i].any(),
        )
        for study in studies
        for i, (model, inside, radius) in enumerate(
            zip(MODELS, each_row(study, "inside"), each_row(study, "radius"), strict=True)
        )
        for j, statement in enumerate(STATEMENTS)
        for made in [study.made(i, j)]
        for points in [points_of(study, i, j)[made]]
    )


def points_of(study: CoverageStudy, model: int, statement: int) -> Array:
    """Number of points of the share of each robot (R,): those with a region, for regions."""
    every = np.full(study.before.size, float(study.judged))
    if STATEMENTS[statement] != BELIEVED:
        return every
    told = np.rint(study.believed[model] * study.judged)
    return np.where(told > 0, told, every)


def advised(study: CoverageStudy) -> Mean | None:
    """Share for users who follow the advice, with its interval; None if nothing is believed."""
    shares, _ = followed(study)
    robots, model = np.arange(study.before.size), study.extended.astype(np.int64)
    region = STATEMENTS.index(BELIEVED)
    points = np.stack([points_of(study, i, region) for i in range(len(MODELS))])[model, robots]
    told = study.believed[model, robots] > 0
    return share_over_robots(shares, points[told]) if len(shares) else None


def followed(study: CoverageStudy) -> tuple[Array, int]:
    """Shares (r,) for users who follow the advice, and the number of robots without a statement.

    The model is the one that the evidence chooses, and the statement is the believed region, if
    there is one.
    """
    robots = np.arange(study.before.size)
    model = study.extended.astype(np.int64)
    some = study.believed[model, robots] > 0
    return study.inside[model, STATEMENTS.index(BELIEVED), robots][some], int((~some).sum())


def numbers_check(study: CoverageStudy) -> NumbersCheck | None:
    """Tests of the parameters; None if the geometric model cannot match the truth."""
    f, count = len(study.names), study.before.size
    if not f:
        return None
    k = coverage_factor(1, study.level)
    shares, ranks = zip(
        *(
            (np.mean(np.abs(row) <= k), uniform_p(ndtr(row)))
            for row in each_row(study, "normal_error")
        ),
        strict=True,
    )
    return NumbersCheck(
        study.truth,
        study.names,
        np.array(shares),
        binomial_band(count, study.level, 1 - (1 - BAND) / f),
        float(study.nees.mean()),
        chi_square_mean_band(f, count),
        uniform_p(chdtr(f, study.nees)),
        min(1.0, f * min(ranks)),
    )


def uniform_p(values: Array) -> float:
    """P-value (Kolmogorov-Smirnov) of values (n,) for a uniform distribution on 0 to 1.

    References
    ----------
    Stephens 1970: the asymptotic law at (sqrt n + 0.12 + 0.11 / sqrt n) D, good from n = 5.
    """
    n = len(values)
    steps, sorted_values = np.arange(n + 1) / n, np.sort(values)
    gap = max((steps[1:] - sorted_values).max(), (sorted_values - steps[:-1]).max())
    return float(kolmogorov((n**0.5 + 0.12 + 0.11 / n**0.5) * gap))


def share_interval(mean: Mean) -> list[float]:
    """Interval of a share, limited to 0 and 1."""
    return [max(mean.low, 0.0), min(mean.high, 1.0)]


def published(studies: tuple[CoverageStudy, ...]) -> list[Quantity]:
    """The study in result.json."""
    first, found = studies[0], cells(studies)
    out = [Quantity("robots", first.before.size), Quantity("level", first.level)]
    for study in studies:
        out += below(f"truths/{study.truth}", _of_kind(study, found))
    return out


def published_arrays(study: CoverageStudy) -> list[Quantity]:
    """Arrays over robots, in arrays.npz."""
    return in_si({name: getattr(study, name.removesuffix("_m")) for name in ARRAYS})


def _of_kind(study: CoverageStudy, found: tuple[Cell, ...]) -> Iterator[Quantity]:
    """Attained coverage on robots of one kind, and that of following the program's advice."""
    yield Quantity("before_mean_mm", study.before.mean(), METRE)
    yield Quantity("extended_chosen", study.extended.mean())
    for i, model in enumerate(MODELS):
        yield Quantity(f"{model}/mean_mm", study.mean_error[i].mean(), METRE)
        yield Quantity(f"{model}/flagged", study.flagged[i].mean())
        yield Quantity(f"{model}/believed", study.believed[i].mean())
        yield Quantity(f"{model}/growth", study.growth[i].mean())
        yield Quantity(f"{model}/drift_seen", (study.p_drift[i] < REMEMBERS).mean())
        yield Quantity(f"{model}/converged", study.converged[i].mean())
        for cell in found:
            if (cell.truth, cell.model) == (study.truth, model):
                key = f"{model}/{cell.statement}"
                yield Quantity(f"{key}/inside", cell.share.value)
                yield Quantity(f"{key}/ci_95", share_interval(cell.share))
                yield Quantity(f"{key}/joint_ci_95", share_interval(cell.joint))
                yield Quantity(f"{key}/radius_mm", cell.radius, METRE)
                yield Quantity(f"{key}/outcome", cell.outcome)
    mean, (_, without) = advised(study), followed(study)
    yield Quantity("advice_followed/inside", mean and mean.value)
    yield Quantity("advice_followed/ci_95", mean and share_interval(mean))
    yield Quantity("advice_followed/nothing_to_believe", without)
    if (check := numbers_check(study)) is not None:
        yield Quantity("numbers/count", len(check.names))
        yield Quantity("numbers/inside_mean", check.shares.mean())
        yield Quantity("numbers/inside_min", check.shares.min())
        yield Quantity("numbers/inside_max", check.shares.max())
        yield Quantity("numbers/band_of_all", check.band)
        yield Quantity("numbers/nees_mean", check.nees)
        yield Quantity("numbers/nees_band", check.nees_band)
        yield Quantity("numbers/nees_p_value", check.nees_p)
        yield Quantity("numbers/ranks_p_value", check.rank_p)
        yield Quantity("numbers/passed", check.passed)
