"""One figure of a test in words: its digits, its unit, the pose, pair or path it belongs to."""

from testbed.iso9283.records import StatedFigure
from testbed.units import MDEG, UM, decimals, fixed

FINEST = 1e-3
"""Smallest standard uncertainty that decides digits, and the last digit below it [um, mdeg]."""


def show(value: float, figure: StatedFigure) -> str:
    """A value of a figure in um, or mdeg, to the second digit of the typical u of its kind."""
    scale = MDEG if figure.angle else UM
    u = (figure.typical_u or figure.u) * scale
    if u >= FINEST:
        return fixed(value * scale, decimals(u, 2))
    # nothing scatters: what is left of zero is rounding
    return f"< {FINEST:g}" if abs(value * scale) < FINEST / 2 else fixed(value * scale, 3)


def limit_um(limit: float) -> str:
    """A stated limit [m] in um, as it was written."""
    return f"{limit * UM:.6g}"


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


def unit(figure: StatedFigure) -> str:
    """Unit that it is shown in."""
    return "mdeg" if figure.angle else "um"


def told(figure: StatedFigure) -> str:
    """One figure with its limits in words."""
    low, high = (show(x, figure) for x in (figure.least, figure.most))
    value = show(figure.size, figure)
    return (
        f"{figure.name} is up to {value} {unit(figure)} ({place(figure)}; 95 % limits {low} to "
        f"{high} {unit(figure)})"
    )
