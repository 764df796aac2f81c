"""How far slides move beyond their command, in words."""

import numpy as np

from calib.arrays import Array
from calib.identification.result import Identification
from calib.information.sizes import SCALES
from testbed.units import UM, significant


def travel_words(result: Identification, covariance: Array) -> tuple[str, ...]:
    """What scales of slides are beyond their U; as numbers they are amplitudes of long waves.

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
        if term.name not in U or not term.name.startswith(SCALES):
            continue
        if abs(value) <= U[term.name]:  # the readings do not tell it from none
            continue
        per = term.order * UM  # the slope of the wave where it begins
        said.append(
            f"joint {term.joint + 1} {significant(abs(value) * per, 2)} um/m "
            f"{'further' if value > 0 else 'less'} (U = {significant(U[term.name] * per, 2)} um/m)"
        )
    if not said:
        return ()
    return (f"slides move by another distance than commanded: {', '.join(said)}",)
