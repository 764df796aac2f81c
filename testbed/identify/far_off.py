"""Held-out rows that are far off: named, never left out, and what the radius would be without."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.belief import Belief
from testbed.identify.records import RowErrors
from testbed.units import MM, significant

FAR = 5.0
"""Held-out misses beyond so many medians are named: sound ones of a campaign end at four."""
FITS = 3.0
"""Readings missed by fewer medians than that fit."""
LOOK = {
    "inside": "check its reading, or the model may fail there",
    "edge": "it lies at the edge of what the others prove, where the model may fail",
    "outside": "it lies outside what the others prove, where the model may fail",
}
"""What is said of a held-out row far off, by its place."""
ALONE = "another reading of that pose fits, so check this one"
"""What is said where neither the arm nor its model can be to blame."""


def far_held_out(errors: RowErrors, table: Measurements, is_test: Bool) -> Bool:
    """Which (m,) held-out rows are far off, of all rows and their errors."""
    return frozen(is_test & (_medians(errors, table, is_test) > FAR), np.bool_)


def held_out_outliers(
    errors: RowErrors, table: Measurements, is_test: Bool, belief: Belief | None, name: list[str]
) -> tuple[str, ...]:
    """A sentence on each held-out row that is far off, worst first; they stay in every figure.

    Parameters
    ----------
    errors : RowErrors
        Of all rows (m).
    table : Measurements
        These rows.
    is_test : (m,) array of bool
        Which are held out.
    belief : Belief or None
        What is believed: where a row lies against the others decides what is to be looked at.
    name : list of str
        (m,) how each row is called.
    """
    medians, far = _medians(errors, table, is_test), far_held_out(errors, table, is_test)
    said, poses = [], table.together
    for row in sorted(np.flatnonzero(far).tolist(), key=lambda row: -errors.position[row]):
        place = "inside"
        if belief is not None:
            place = str(belief.proven.applies(table.q[row : row + 1]).place[0])
        others = is_test & (poses == poses[row]) & ~far
        look = ALONE if others.any() and (medians[others] < FITS).all() else LOOK[place]
        said.append(
            f"held-out {name[row]} is off by {significant(errors.position[row] * MM)} mm, "
            f"{medians[row]:.0f} times the median: {look}; it counts in every figure"
        )
    return tuple(said)


def _medians(errors: RowErrors, table: Measurements, is_test: Bool) -> Array:
    """Misses (m,) in medians of the held-out rows of each kind: a distance shows one direction."""
    typical = np.full(len(table), np.inf)
    for kind in set(table.kind[is_test].tolist()):
        same = table.kind == kind
        typical[same] = np.median(errors.position[is_test & same])
    with np.errstate(divide="ignore", invalid="ignore"):  # a fit that misses nothing
        return np.asarray(np.nan_to_num(errors.position / typical))
