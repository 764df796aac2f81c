"""Degrees and millimeters of a robot file that are read as the number that was written."""

from collections.abc import Callable

import numpy as np

Unit = Callable[[float], float]


def degrees(value: float) -> float:
    """What `numpy.radians` of it gives back an angle [rad to deg]."""
    return _inverted(float(np.degrees(value)), value, lambda x: float(np.radians(x)))


def millimeters(value: float) -> float:
    """What a thousandth of it gives back a length [m to mm]."""
    return _inverted(value * 1e3, value, lambda x: x / 1e3)


def millionths(value: float) -> float:
    """What 1e-6 times it gives back a value."""
    return _inverted(value * 1e6, value, lambda x: x * 1e-6)


def _inverted(guess: float, value: float, read: Unit) -> float:
    """The shortest decimal number that is read as `value`, or else the nearest neighbor.

    A unit's factor maps some neighbors onto one and leaves gaps of one unit in the last place.
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
