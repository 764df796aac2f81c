"""How far slides move beyond their command, in words."""

import numpy as np

from calib.arrays import Array
from calib.geometry.parameters import is_scale, shown_in
from calib.identification.result import Identification
from testbed.units import significant


def travel_words(result: Identification, covariance: Array) -> tuple[str, ...]:
    """What scales of slides are beyond their U.

    Parameters
    ----------
    result : Identification
        The chosen model.
    covariance : (f, f) array
        Of its free numbers, as the table of numbers has it.
    """
    errors = result.model.joint_errors
    U = dict(zip(result.names, 2 * np.sqrt(np.diag(covariance)), strict=True))
    said = []
    for term, value in zip(errors.terms, errors.coefficients.tolist(), strict=False):
        if term.name not in U or not is_scale(term.name):
            continue
        if abs(value) <= U[term.name]:  # the readings do not tell it from none
            continue
        unit, per = shown_in(term.name, True)
        size, half = (significant(one * per, 2) for one in (abs(value), U[term.name]))
        way = "further" if value > 0 else "less"
        said.append(f"joint {term.joint + 1} {size} {unit} {way} (U = {half} {unit})")
    if not said:
        return ()
    return (f"slides move by another distance than commanded: {', '.join(said)}",)
