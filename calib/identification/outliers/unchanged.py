"""Within what the zeros of joints are the same in some rows of a fit as in the others."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.identification.outliers.whitened import WhitenedRows
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

COVERAGE = 2.0
"""Standard deviations of 95 %."""


def zeros_within(identification: Identification, table: Measurements, side: Bool) -> Array:
    """Largest change (n,) of each joint's zero that readings allow [rad, m]; inf: they tell none.

    Parameters
    ----------
    identification : Identification
        Fit of all rows of `table`.
    table : Measurements
        Poses and points.
    side : (m,) array of bool
        Rows that may have other zeros than the rest.

    References
    ----------
    |x| + 2 u: x = b / S and u = sqrt(v / S) with b and S as in `moved_once` of one joint, and the
    larger of one and chi-square per degree of freedom for v.
    """
    names, chain = identification.parameters.names, identification.model.chain
    free, derivative = WhitenedRows.of(identification, table), predict(identification.model, table)
    scale = max(free.square / max(free.freedom, 1), 1.0)
    within = np.full(chain.n_joints, np.inf)
    for joint in range(chain.n_joints):
        name = f"{'d' if chain.prismatic[joint] else 'theta'}{joint + 1}"
        one = derivative.rows[:, :, [names.index(name)]] * side[:, None, None]
        gain, rank, change = free.drop(one)
        if rank and gain > 0:
            size = abs(float(change[0]))
            within[joint] = size * (1 + COVERAGE * np.sqrt(scale / gain))
    return frozen(within)
