"""Figures over robots: means, shares and ratios with their intervals, and their wording.

The robot is the unit: poses of one robot share its error.
"""

from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from testbed.units import MM, NARROW, Mean, decimals, fixed, percent

Outcome = Literal["better", "worse", "undecided"]
ROUNDING = 1e-12
"""Relative width below which an interval is rounding alone."""
CONFIDENCE = 0.95


def mean_over_robots(values: Array, *, probability: float = 0.95, least: float = 0.0) -> Mean:
    """Mean and confidence interval of one figure per robot (R,), R at least 2.

    The standard deviation is at least `least`.

    References
    ----------
    Student's t with R - 1 degrees of freedom; JCGM 100:2008, G.3.
    """
    from scipy.special import stdtrit

    count, sd = len(values), max(float(values.std(ddof=1)), least)
    t = float(stdtrit(count - 1, (1 + probability) / 2))
    return Mean(float(values.mean()), t * sd / count**0.5)


def share_over_robots(values: Array, points: ArrayLike, *, probability: float = 0.95) -> Mean:
    """Mean and interval of one share per robot (R,), each of `points` (R,) points; R may be 1.

    Points of one robot are correlated, so robots differ at least as much as for independent points.
    If a few robots happen to have equal shares, or all points inside, their scatter is too small.
    One robot alone shows nothing about others.

    References
    ----------
    The least variance is the binomial p (1 - p) / n, with p after Agresti and Coull 1998, which is
    0 or 1 for no count.
    """
    if len(values) < 2:
        return Mean(float(values.mean()), 1.0)
    n = np.broadcast_to(np.asarray(points, np.float64), values.shape)
    p = float((values * n).sum() + 2) / float(n.sum() + 4)
    least = (p * (1 - p) * float(np.mean(1 / n))) ** 0.5
    return mean_over_robots(values, probability=probability, least=least)


def log_ratio_over_robots(one: Array, other: Array, *, probability: float = 0.95) -> Mean:
    """Geometric mean of one/other over paired robots (R,), as a logarithm with its interval."""
    return mean_over_robots(np.log(one / other), probability=probability)


def outcome_of(ratio: Mean) -> Outcome:
    """Better or worse if an interval of a logarithm lies below or above zero."""
    return "worse" if ratio.low > 0 else "better" if ratio.high < 0 else "undecided"


def family_confidence(comparisons: int) -> float:
    """Confidence of each of several intervals that hold together with 95 % (Bonferroni)."""
    return 1 - (1 - CONFIDENCE) / max(comparisons, 1)


def plus_minus(mean: Mean, places: int = 2) -> str:
    """A figure with the half width of its interval; a printed figure has none.

    `places` is the least number of decimals; a narrow interval has more.
    """
    if mean.half_width <= ROUNDING * abs(mean.value):
        return fixed(mean.value, places)
    if not isfinite(mean.half_width):
        return f"{fixed(mean.value, places)} (one pool)"
    places = max(places, decimals(mean.half_width, 1))
    return f"{fixed(mean.value, places)} ± {fixed(mean.half_width, places)}"


def within(mean: Mean) -> str:
    """A length [m] in mm with its interval."""
    return plus_minus(Mean(mean.value * MM, mean.half_width * MM), 3)


def share(mean: Mean) -> str:
    """A share of one in percent with the half width of its interval."""
    if not mean.half_width:
        return percent(mean.value)
    scaled = Mean(100 * mean.value, 100 * mean.half_width)
    return f"{plus_minus(scaled, 0)}{NARROW}%"


def signed(part: float) -> str:
    """A relative change in percent, with its sign."""
    return f"{'+' if part >= 0 else ''}{fixed(100 * part, 0)}{NARROW}%"


def change(ratio: Mean) -> str:
    """A logarithm of a ratio as a change in percent with its interval."""
    middle, low, high = (float(np.expm1(x)) for x in (ratio.value, ratio.low, ratio.high))
    return f"{signed(middle)} ({signed(low)} to {signed(high)})"


def printed_change(one: float, other: float) -> str:
    """The change from one printed figure to another."""
    return signed(one / other - 1)


def percent_of(ratio: Mean) -> tuple[float, float, float]:
    """A logarithm of a ratio with its interval, as changes in percent."""
    middle, low, high = (100 * float(np.expm1(x)) for x in (ratio.value, ratio.low, ratio.high))
    return middle, low, high
