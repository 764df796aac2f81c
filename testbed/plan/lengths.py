"""Lengths and uncertainties of a plan, as people read them."""

import numpy as np

from testbed.lengths import column_unit, with_unit
from testbed.plan.records import Plan
from testbed.units import UM, significant


def length(value: float, *beside: float, digits: int = 3) -> str:
    """A length [m] with its unit as `with_unit` gives it, micro as one letter."""
    return with_unit(value, *beside, digits=digits).replace(" um", " µm")


def expanded(plan: Plan, u: float, digits: int = 3, scale: float = UM) -> str:
    """Expanded uncertainty, in a unit of which `scale` make a meter, of a standard one [m]."""
    return or_dash(plan.coverage * u * scale, digits)


def unit_of(plan: Plan, *u: float) -> tuple[float, str]:
    """Unit of a column or an axis of expanded uncertainties, by standard ones that matter [m]."""
    return column_unit(plan.coverage * np.array(u))


def curve_unit(plan: Plan) -> tuple[float, str]:
    """Unit of U against the number of poses: the first, ill-conditioned sets have no say."""
    curve = plan.curve
    reached = curve.u[np.isfinite(curve.u)]
    typical = float(np.median(reached)) if len(reached) else 0.0
    return unit_of(plan, typical, curve.target or 0.0)


def or_dash(value: float, digits: int = 3) -> str:
    """A number with so many digits, a dash where there is none."""
    return significant(float(value), digits) if np.isfinite(value) else "–"
