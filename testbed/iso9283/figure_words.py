"""One figure of a test in words: its digits, its unit, the pose, pair or path it belongs to."""

from collections.abc import Sequence

import numpy as np

from calib.shown import length_unit
from testbed.iso9283.records import StatedFigure
from testbed.units import DEG, MDEG, MM, UM, decimals, fixed

SCALES = {"um": UM, "mm": MM, "mdeg": MDEG, "deg": DEG}
"""Units of figures, per meter and per radian."""
FULL = 999.5
"""Thousandths of a degree from which on three digits are said in deg."""
FINEST = 1e-3
"""Smallest standard uncertainty that decides digits, and the last digit below it [um, mdeg]."""


def show(value: float, figure: StatedFigure, in_unit: str = "") -> str:
    """A value of a figure to the second digit of its kind's typical u, by default in its `unit`."""
    scale = SCALES[in_unit or unit(figure)]
    u, fine = figure.typical_u or figure.u, MDEG if figure.angle else UM
    if u * fine >= FINEST:
        return fixed(value * scale, decimals(u * scale, 2))
    # nothing scatters: what is left of zero is rounding
    return f"< {FINEST:g}" if abs(value * scale) < FINEST / 2 else fixed(value * scale, 3)


def show_limit(limit: float, in_unit: str) -> str:
    """A stated limit [m] in a unit, as it was written."""
    return f"{limit * SCALES[in_unit]:.6g}"


def place(figure: StatedFigure) -> str:
    """Where a figure belongs, with its noun.

    Examples
    --------
    >>> from dataclasses import replace
    >>> one = StatedFigure("AP", "4", 0.0, 0.0, 0.0, 0.0, 0.0, 30)
    >>> place(one), place(replace(one, name="AD", where="1 to 5"))
    ('pose 4', 'distance 1 to 5')
    """
    if figure.name in ("AD", "RD"):
        return f"distance {figure.where}"
    named = figure.name in ("AT", "RT") or figure.where.casefold().startswith("pose")
    return figure.where if named else f"pose {figure.where}"


def unit(figure: StatedFigure, *beside: float) -> str:
    """Unit that suits it, its limits, its floor and lengths that it is read beside [m]."""
    return unit_of_all([figure], *beside)


def unit_of_all(figures: Sequence[StatedFigure], *beside: float) -> str:
    """Unit of a table of lengths, or of angles: that which suits the largest of them."""
    sizes = [*beside, *(size for one in figures for size in (one.size, one.most, one.floor))]
    if figures[0].angle:
        return "deg" if np.nanmax(sizes) * MDEG >= FULL else "mdeg"
    return length_unit(sizes)[1]


def told(figure: StatedFigure, in_unit: str = "") -> str:
    """One figure with its limits in words, by default in `unit`."""
    named = in_unit or unit(figure)
    value, low, high = (show(x, figure, named) for x in (figure.size, figure.least, figure.most))
    return (
        f"{figure.name} is up to {value} {named} ({place(figure)}; 95 % limits {low} to "
        f"{high} {named})"
    )
