"""Lengths for people: in um, and in mm from 1 mm on, with one unit for all that are compared."""

from numpy.typing import ArrayLike

from calib.shown import length_unit
from testbed.units import significant


def with_unit(length: float, *beside: float, digits: int = 3) -> str:
    """A length [m] with the unit that suits it and all that it is read beside.

    Below 1 mm in um with `digits` significant digits; from there on in mm, with three at least.

    Examples
    --------
    >>> with_unit(412e-6), with_unit(999.6e-6), with_unit(12.7e-3), with_unit(412e-6, 12.7e-3)
    ('412 um', '1.00 mm', '12.7 mm', '0.412 mm')
    >>> with_unit(26e-6, digits=1), with_unit(12.7e-3, digits=1)
    ('26 um', '12.7 mm')
    """
    scale, unit = length_unit([length, *beside])
    return f"{significant(length * scale, digits if unit == 'um' else max(digits, 3))} {unit}"


def as_stated(length: float, *beside: float) -> str:
    """A length [m] that somebody wrote, digit by digit, with its unit; as `with_unit`.

    Examples
    --------
    >>> as_stated(123.4e-6), as_stated(12.5e-3)
    ('123.4 um', '12.5 mm')
    """
    scale, unit = length_unit([length, *beside])
    return f"{length * scale:.6g} {unit}"


def column_unit(lengths: ArrayLike) -> tuple[float, str]:
    """Unit of a column or an axis of lengths [m], per meter, and its name in a report."""
    scale, unit = length_unit(lengths)
    return scale, unit.replace("u", "µ")
