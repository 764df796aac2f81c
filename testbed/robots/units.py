"""Degrees and millimeters for a robot file that read back as exactly the same number."""

from collections.abc import Callable

import numpy as np

Unit = Callable[[float], float]


def degrees(value: float) -> float:
    """Degrees from which `numpy.radians` gives back an angle [rad to deg]."""
    return _inverted(float(np.degrees(value)), value, lambda x: float(np.radians(x)))


def millimeters(value: float) -> float:
    """Millimeters of which a thousandth gives back a length [m to mm]."""
    return _inverted(value * 1e3, value, lambda x: x / 1e3)


def millionths(value: float) -> float:
    """Number that gives back a value when multiplied by 1e-6."""
    return _inverted(value * 1e6, value, lambda x: x * 1e-6)


def _inverted(guess: float, value: float, read: Unit) -> float:
    """The shortest decimal number that is read as `value`, or as its nearest neighbor.

    The factor of a unit maps some neighboring numbers to one, and leaves gaps of one unit in the
    last place.
    """
    guess, value = float(guess), float(value)
    for digits in range(1, 17):
        short = float(f"{guess:.{digits}g}")
        if read(short) == value:
            return short + 0.0
    near = [guess]
    for direction in (-np.inf, np.inf):
        one = guess
        for _ in range(2):
            one = float(np.nextafter(one, direction))
            near.append(one)
    return min(near, key=lambda x: abs(read(x) - value))
