"""Observations that do not fit: those of a calibration in words, and held-out ones set aside."""

import numpy as np
from scipy.special import chdtri

from calib.arrays import Index
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import Identification
from calib.identification.outlier_search import OutlierSearch
from calib.measurement.observations import Measurements
from calib.uncertainty.discrepancy import FEWEST
from calib.uncertainty.held_out import held_out
from calib.uncertainty.regions import mahalanobis_squared

SET_ASIDE = 0.05
"""Chance that any observation of a sound validation visit is set aside."""


def outlier_sentences(search: OutlierSearch, measured: Measurements) -> tuple[str, ...]:
    """A sentence for each outlier, worst first; or one that blames model or noise."""
    if search.too_many:
        return (
            f"{len(search.suspects)} of {len(measured)} shots do not fit: that many are no gross "
            "errors; the model or the stated noise is wrong",
        )
    return search.outliers.sentences(measured)


def without_gross_errors(
    result: Identification, validation: Measurements, used: Measurements
) -> tuple[Measurements, Index]:
    """Held-out observations without the grossly wrong ones, and the poses of these.

    Observations are set aside only under a robust loss, which says that gross errors are to be
    expected. What the model misses everywhere is no gross error: sizes count in units of the median
    one.
    """
    nothing = np.zeros(0, dtype=np.int64)
    if result.loss == "squared" or len(validation) < FEWEST:
        return validation, nothing
    errors = held_out(result.model, result.full_covariance, validation, used.q)
    size = mahalanobis_squared(errors.error, errors.predicted + errors.measured)
    usual = max(float(np.median(size)) / float(chdtri(3, 0.5)), 1.0)
    gross = size > usual * chdtri(3, SET_ASIDE / len(validation))
    if not gross.any() or gross.mean() > MOST_OUTLIERS:
        return validation, nothing
    return validation.rows(~gross), np.asarray(validation.pose_id[gross])
