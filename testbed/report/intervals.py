"""Means over robots in words: lengths, shares and changes with their 95 % intervals."""

from math import isfinite

import numpy as np

from testbed.units import MM, NARROW, Mean, decimals, fixed, percent


def plus_minus(mean: Mean, places: int = 2) -> str:
    """A figure with the half width of its interval; a printed figure has none.

    `places` is the least number of decimals: a narrow interval asks for more.
    """
    if not mean.half_width:
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
