"""Shots that do not fit: those of a calibration by name, and grossly wrong held-out ones."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from calib.arrays import Index
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import Identification
from calib.identification.outliers import Outliers, inspect
from calib.measurement.observations import Measurements
from calib.uncertainty.discrepancy import FEWEST
from calib.uncertainty.held_out import held_out
from calib.uncertainty.regions import mahalanobis_squared
from testbed.studies.trial.estimator import Estimator

GROSS = 0.05
"""Chance that any shot of a sound validation visit is set aside."""


@dataclass(frozen=True, slots=True, eq=False)
class Suspects:
    """Shots of a calibration that do not fit the others."""

    sentences: tuple[str, ...]
    rows: tuple[int, ...]


def suspects_of(estimator: Estimator, found: Identification, seen: Measurements) -> Suspects:
    """Name the shots that do not fit.

    One gross error spoils the scores of its neighbors in a plain fit: where some are found, they
    are named after a Cauchy fit.
    """
    judged = inspect(estimator.nominal, found, seen)
    if found.loss == "squared" and judged.outliers.suspect.any():
        robust = replace(estimator, loss="cauchy")
        judged = inspect(estimator.nominal, robust.fit(seen, found.parameters), seen)
    return Suspects(named(judged.outliers, seen), named_rows(judged.outliers))


def named_rows(found: Outliers) -> tuple[int, ...]:
    """Rows that do not fit; none where they are so many that the model is to blame."""
    if found.suspect.mean() > MOST_OUTLIERS:
        return ()
    return tuple(int(row) for row in np.flatnonzero(found.suspect))


def named(found: Outliers, seen: Measurements) -> tuple[str, ...]:
    """A sentence for each of them, worst first; or one that blames model or noise."""
    count = int(found.suspect.sum())
    if found.suspect.mean() > MOST_OUTLIERS:
        return (
            f"{count} of {len(seen)} shots do not fit: that many are no gross errors; the model or "
            "the stated noise is wrong",
        )
    return found.sentences(seen)


def sound_shots(
    found: Identification, shots: Measurements, used: Measurements
) -> tuple[Measurements, Index]:
    """Held-out shots without the grossly wrong ones, and the poses of these.

    Shots are set aside only under a robust loss, which says that gross errors are to be expected.
    What the model misses everywhere is no gross error: sizes count in units of the median one.
    """
    nothing = np.zeros(0, dtype=np.int64)
    if found.loss == "squared" or len(shots) < FEWEST:
        return shots, nothing
    seen = held_out(found.model, found.full_covariance, shots, used.q)
    size = mahalanobis_squared(seen.error, seen.predicted + seen.measured)
    usual = max(float(np.median(size)) / float(chdtri(3, 0.5)), 1.0)
    gross = size > usual * chdtri(3, GROSS / len(shots))
    if not gross.any() or gross.mean() > MOST_OUTLIERS:
        return shots, nothing
    return shots.rows(~gross), np.asarray(shots.pose_id[gross])
