"""The tool point at the zero pose draw by draw: its clouds, and the expected ranges.

The record has figures over all draws. The draws themselves are repeated from their streams when
needed, so that report and recording show the same points, and no run folder has to contain them.

Ranges are predicted without draws: they are those of M normal numbers whose standard deviation is
that of linear propagation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from scipy.special import log_ndtr, ndtr

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.information.propagation import tool_covariance
from calib.uncertainty.covariance import independent_draws
from calib.uncertainty.tool_point import propagate
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.paper import TABLE3_BEST, TABLE3_RANDOM
from testbed.studies.wen2022.records import OURS_BEST, OURS_RANDOM, paper_budget_of, tool_point_of
from testbed.studies.wen2022.tool_point import draws_of, stated
from testbed.units import MM

PAIRS = {
    "Table 3 of the paper": (TABLE3_BEST, TABLE3_RANDOM),
    "this campaign": (OURS_BEST, OURS_RANDOM),
}
"""Pairs of budgets: that of the optimal set, and that of random sets."""
SHOWN = 500
"""Number of draws shown as points: the first ones, which are a fair sample."""

CONFIDENCE = 0.999
"""Probability that all correct ranges pass; one seed in a thousand fails, not one in twenty."""
BEYOND = 12.0
"""Standard deviations that one normal number in 10^32 exceeds."""
LINE = np.linspace(-BEYOND, BEYOND, 2401)
"""Nodes of sums for integrals over normal numbers; integrands are smooth over steps of .01."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Tool points of independently drawn numbers at the zero pose, in world axes."""

    source: str
    """Source of the uncertainties: one of a pair of `PAIRS`."""
    nominal: Array
    """(3,) tool point of the nominal model [m]."""
    points: Array
    """(M, 3) tool point of each draw minus the nominal one [m]."""
    linear: Array
    """(3, 3) covariance by linear propagation, J diag(u^2) J' [m^2]."""

    @property
    def shown(self) -> Array:
        """(k, 3) the draws that are shown as points [m]."""
        return self.points[:SHOWN]

    @property
    def ends(self) -> Array:
        """(3, 2) smallest and largest x, y, z of all draws, from nominal [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)], axis=-1)

    @property
    def u(self) -> Array:
        """(3,) standard uncertainties of x, y, z by linear propagation [m]."""
        return np.asarray(np.sqrt(np.diagonal(self.linear)))


def clouds_of(campaign: Campaign) -> dict[str, tuple[Cloud, Cloud]]:
    """Optimal and random cloud for each pair of budgets; none if they were not drawn."""
    study = tool_point_of(campaign)
    if study is None:
        return {}
    scenario, nominal = campaign.scenario, campaign.setting.nominal
    sources = stated(scenario, nominal, paper_budget_of(campaign))

    def cloud(source: str) -> Cloud:
        return _cloud(nominal, scenario.seed, source, study.draws, sources[source].tobytes())

    return {
        whose: (cloud(best), cloud(random))
        for whose, (best, random) in PAIRS.items()
        if {best, random} <= set(study.source)
    }


@lru_cache(maxsize=4)
def _cloud(nominal: RobotModel, seed: int, source: str, draws: int, standard: bytes) -> Cloud:
    """The draws behind one row of the record, shared by tables, claims and figures."""
    u, zero = np.frombuffer(standard), np.zeros((1, nominal.chain.n_joints))
    point = frozen(nominal.poses(zero)[0, :3, 3])
    steps = independent_draws(u, draws, draws_of(seed, source))
    points = frozen(propagate(nominal, zero, steps)[:, 0] - point)
    return Cloud(source, point, points, tool_covariance(nominal, zero, np.diag(u**2))[0, :3, :3])


@dataclass(frozen=True, slots=True)
class Range:
    """Smallest to largest of the draws along one axis, and whether that is as expected."""

    source: str
    axis: str
    """x, y or z of the world."""
    ends: tuple[float, float]
    """Smallest and largest, from nominal [m]."""
    u: float
    """Standard uncertainty along the axis by linear propagation [m]."""
    printed: bool
    """Whether it is printed in the paper; else it was drawn here."""
    good: bool
    """Whether the half width agrees with that of M normal numbers with this u."""

    @property
    def half_width(self) -> float:
        """Half of the range, in u."""
        return (self.ends[1] - self.ends[0]) / 2 / self.u


def ranges_of(clouds: Mapping[str, Sequence[Cloud]]) -> tuple[Range, ...]:
    """The one printed range in our sources, then the ranges drawn here.

    They are judged together: if all are as predicted, all pass with probability `CONFIDENCE`.
    """
    raw: list[tuple[Cloud, int, Array, int, bool]] = []
    for cloud in (cloud for pair in clouds.values() for cloud in pair):
        if cloud.source == TABLE3_BEST:
            printed = np.array(paper.X_RANGE_ZERO_BEST_MM) / MM
            raw.append((cloud, 0, printed, paper.DRAWS, True))
        draws = len(cloud.points)
        raw += [(cloud, axis, cloud.ends[axis], draws, False) for axis in range(3)]
    found = []
    for cloud, axis, ends, draws, known in raw:
        least, most = predicted_band(draws, len(raw))
        low, high, u = float(ends[0]), float(ends[1]), float(cloud.u[axis])
        good = least <= (high - low) / 2 / u <= most
        found.append(Range(cloud.source, "xyz"[axis], (low, high), u, known, good))
    return tuple(found)


@cache
def predicted_band(draws: int, comparisons: int) -> tuple[float, float]:
    """Interval for the half width of a range of M normal numbers, in their standard deviation.

    If all ranges are those of normal numbers, all lie inside with probability `CONFIDENCE`.

    Parameters
    ----------
    draws : int
        M, at least 2.
    comparisons : int
        Number of ranges that are judged together.
    """
    from scipy.optimize import brentq

    beyond = (1 - CONFIDENCE) / comparisons / 2  # Bonferroni

    def end(probability: float) -> float:
        """Half width that is not exceeded with this probability."""
        return float(
            brentq(lambda half: half_width_probability(half, draws) - probability, 0, BEYOND)
        )

    return end(beyond), end(1 - beyond)


def half_width_probability(half: float, draws: int) -> float:
    """Probability that the range of M standard normal numbers is no wider than twice `half`.

    References
    ----------
    P(R <= r) = M int phi(z) [Phi(z + r) - Phi(z)]^(M - 1) dz, z the smallest (order statistics).
    """
    outside = ndtr(LINE) + ndtr(-LINE - 2 * half)
    with np.errstate(divide="ignore"):  # all of them outside: probability zero
        others = (draws - 1) * np.log1p(-np.minimum(outside, 1.0))
    density = np.exp(others - LINE**2 / 2) * draws / np.sqrt(2 * np.pi)
    return float(np.trapezoid(density, LINE))


def mean_half_width(draws: Sequence[int]) -> Array:
    """(k,) mean half width of the range of M standard normal numbers, for each M (k,).

    It is the mean of the largest, since smallest and largest mirror each other.

    References
    ----------
    E max = b - int_-b^b Phi(z)^M dz, with b beyond all numbers.
    """
    share = np.asarray(draws, dtype=np.float64)[:, None] * log_ndtr(LINE)
    return np.asarray(BEYOND - np.trapezoid(np.exp(share), LINE, axis=-1))
