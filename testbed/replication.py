"""The whole calibration played again and again, to see whether its intervals hold the truth.

Only a laboratory that knows the truth can ask. The same robot visits the same poses K times with
fresh noise; every replication states its intervals and regions anew.
"""

import numpy as np
from scipy.special import bdtr, chdtri

from calib.arrays import Array
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import inside, mahalanobis_squared
from testbed.comparison import INTERVAL, distances, target_points, target_prediction
from testbed.estimator import Estimator
from testbed.records import Replications
from testbed.setting import Bench

BAND = 0.999
"""Probability of the bands in which an honest statement stays."""
COVERAGE = 0.95


def replicate(
    bench: Bench,
    estimator: Estimator,
    first: Identification,
    visited: Measurements,
    truth: Array,
    name: str,
) -> Replications | None:
    """Replicate the calibration of one trial; None if the scenario asks for none.

    Nor are fits with a prior replicated: one robot's repeats cannot show what a prior is worth.
    """
    count, setting = bench.scenario.uncertainty.replications, bench.setting
    if not count or first.prior is not None:
        return None
    p_true = target_points(setting.test_true, setting.target)
    steps = np.zeros((count, len(truth)))
    stated = np.zeros((count, len(truth)))
    nees, error = np.zeros(count), np.zeros((count, len(p_true)))
    held = np.zeros((count, len(p_true)), dtype=bool)
    for k in range(count):
        seen = bench.measure(visited.q, visited.pose_id, "replication", name, repeat=k)
        found = estimator.fit(seen, first.parameters)
        point, _, covariance = target_prediction(
            found.model, setting.test_q, setting.target, found.full_covariance
        )
        steps[k], stated[k] = found.step, found.standard_uncertainty
        nees[k] = mahalanobis_squared(found.step - truth, found.covariance)
        error[k] = distances(p_true, point)
        held[k] = inside(p_true - point, covariance[:, :3, :3])
    f = len(truth)
    return Replications(
        count=count,
        nees=nees,
        parameter_coverage=(np.abs(steps - truth) <= INTERVAL * stated).mean(axis=0),
        tool_coverage=held.mean(axis=0),
        sd_ratio=stated.mean(axis=0) / steps.std(axis=0, ddof=1),
        mean_error=error.mean(axis=1),
        nees_band=chi_square_mean_band(f, count),
        # one alarm in a thousand campaigns for all parameters together, not for each
        coverage_band=binomial_band(count, probability=1 - (1 - BAND) / f),
    )


def chi_square_mean_band(freedom: int, count: int, probability: float = BAND) -> Array:
    """Band (2,) of the mean of `count` chi-square values with `freedom` degrees of freedom."""
    tail = (1 - probability) / 2
    return np.array([chdtri(freedom * count, p) / count for p in (1 - tail, tail)])


def binomial_band(count: int, expected: float = COVERAGE, probability: float = BAND) -> Array:
    """Band (2,) of the share of `count` independent intervals that hold what they should."""
    below = bdtr(np.arange(count + 1.0), count, expected)
    tail = (1 - probability) / 2
    return np.array([np.searchsorted(below, tail), np.searchsorted(below, 1 - tail)]) / count
