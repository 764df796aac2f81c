"""Held-out rows that are far off: named, never left out, and what the radius would be without."""

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.measurement.observations import Measurements
from calib.uncertainty.outlying.poses import Strays
from calib.uncertainty.statement.belief import Belief
from testbed.identify.records import RowErrors
from testbed.units import millimetres

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


def far_held_out(
    errors: RowErrors, table: Measurements, is_test: Bool, strays: Strays | None = None
) -> Bool:
    """Which (m,) held-out rows are far off, of all rows and their errors.

    Also those of poses that stand out, less rows of them that fit.
    """
    medians, least = _medians(errors, table, is_test), np.full(len(table), FAR)
    if strays is not None and not strays.moved:
        least[np.isin(table.pose_id, strays.poses)] = FITS
    return frozen(is_test & (medians > least), np.bool_)


def held_out_outliers(
    errors: RowErrors, table: Measurements, is_test: Bool, far: Bool, belief: Belief | None,
    name: list[str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:  # fmt: skip
    """Names of the held-out rows that are far off, worst first, and a sentence on each.

    They stay in every figure.

    Parameters
    ----------
    errors : RowErrors
        Of all rows (m).
    table : Measurements
        These rows.
    is_test : (m,) array of bool
        Which are held out.
    far : (m,) array of bool
        Which of them are far off, by `far_held_out`.
    belief : Belief or None
        What is believed: where a row lies against the others decides what is to be looked at.
    name : list of str
        (m,) how each row is called.
    """
    medians, said, poses = _medians(errors, table, is_test), [], table.together
    ranked = sorted(np.flatnonzero(far).tolist(), key=lambda row: -errors.position[row])
    for row in ranked:
        place = "inside"
        if belief is not None:
            place = str(belief.proven.applies(table.q[row : row + 1]).place[0])
        others = is_test & (poses == poses[row]) & ~far
        look = ALONE if others.any() and (medians[others] < FITS).all() else LOOK[place]
        said.append(
            f"held-out {name[row]} is off by {millimetres(errors.position[row])} mm, "
            f"{medians[row]:.0f} times the median: {look}; it counts in every figure"
        )
    return tuple(name[row] for row in ranked), tuple(said)


def _medians(errors: RowErrors, table: Measurements, is_test: Bool) -> Array:
    """Misses (m,) in medians of the held-out rows of each kind: a distance shows one direction."""
    typical = np.full(len(table), np.inf)
    for kind in set(table.kind[is_test].tolist()):
        same = table.kind == kind
        typical[same] = np.median(errors.position[is_test & same])
    with np.errstate(divide="ignore", invalid="ignore"):  # a fit that misses nothing
        return np.asarray(np.nan_to_num(errors.position / typical))
