"""The whole of one trial again and again: the same robot and poses, fresh noise, all stated anew.

Only a laboratory that knows the truth can ask whether intervals hold it. All replications go
through the arrays of `calib.identification.many`; where these do not know tracker, model or loss,
or one fit gets no certificate, one replication follows the other: 10 ms instead of .3 each.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import bdtr, chdtri

from calib.arrays import Array, Bool
from calib.geometry.frames import target_points
from calib.identification.identify import Identification
from calib.identification.many.points import stated_points
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import inside, mahalanobis_squared
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.laboratory.truth.setting import held_out_conditions
from testbed.studies.trial.compare import INTERVAL, target_prediction
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.records import Replications
from testbed.studies.trial.statement.records import Statement

BAND = 0.999
"""Probability of the bands in which an honest statement stays."""
COVERAGE = 0.95


class Repetitions(NamedTuple):
    """What K replications found and stated."""

    steps: Array
    """(K, f) estimates [m, rad]."""
    stated: Array
    """(K, f) their standard uncertainties [m, rad]."""
    nees: Array
    """(K,) normalized estimation errors squared."""
    point: Array
    """(K, t, 3) predicted points at the held-out poses [m]."""
    held: Bool
    """(K, t) whether the 95 % region by the parameters alone holds the true one."""


def replicate(
    bench: Laboratory,
    estimator: Estimator,
    first: Identification,
    visited: Measurements,
    truth: Array,
    name: str,
    statement: Statement | None = None,
) -> Replications | None:
    """Replicate the calibration of one trial; None if the scenario asks for none.

    What is believed of the first visit is judged as a region of that size about each replicated
    point: the proof behind it is not repeated.

    Nor are fits with a prior replicated: one robot's repeats cannot show what a prior is worth.
    """
    count, setting = bench.scenario.uncertainty.replications, bench.setting
    if not count or first.prior is not None:
        return None
    p_true = target_points(setting.test_true, setting.target)
    # each pose once, in the order in which it was visited first
    once = np.sort(np.unique(visited.pose_id, return_index=True)[1])
    poses = visited.rows(once)
    played = all_at_once(bench, estimator, first, poses, truth, name)
    if played is None:
        played = one_by_one(bench, estimator, first, poses, truth, name)
    error = p_true - played.point
    again = None
    if statement is not None and statement.belief is not None:
        at = held_out_conditions(bench.scenario, setting.test_q)
        believed = statement.belief.regions(setting.test_q, target=setting.target, at=at)
        again = believed.covers(error)
    f = len(truth)
    return Replications(
        count=count,
        nees=played.nees,
        parameter_coverage=(np.abs(played.steps - truth) <= INTERVAL * played.stated).mean(axis=0),
        tool_coverage=played.held.mean(axis=0),
        region_coverage=None if again is None else again.mean(axis=0),
        sd_ratio=played.stated.mean(axis=0) / played.steps.std(axis=0, ddof=1),
        mean_error=np.linalg.norm(error, axis=2).mean(axis=1),
        nees_band=chi_square_mean_band(f, count),
        # one alarm in a thousand campaigns for all parameters together, not for each
        coverage_band=binomial_band(count, probability=1 - (1 - BAND) / f),
    )


def all_at_once(
    bench: Laboratory,
    estimator: Estimator,
    first: Identification,
    poses: Measurements,
    truth: Array,
    name: str,
) -> Repetitions | None:
    """All replications over one axis of arrays; None where these do not know them."""
    count, setting = bench.scenario.uncertainty.replications, bench.setting
    hung = poses.conditions.payload
    tables = bench.visits(poses.q[None], "replication", name, count=count, payload=hung)
    fits = None if tables is None else estimator.fit_many(tables, first)
    if fits is None:
        return None
    point, sigma = stated_points(fits, setting.test_q[None], setting.target)
    p_true = target_points(setting.test_true, setting.target)
    return Repetitions(
        steps=fits.steps,
        stated=fits.standard_uncertainty,
        nees=mahalanobis_squared(fits.steps - truth, fits.covariance),
        point=point,
        held=inside(p_true - point, sigma),
    )


def one_by_one(
    bench: Laboratory,
    estimator: Estimator,
    first: Identification,
    poses: Measurements,
    truth: Array,
    name: str,
) -> Repetitions:
    """One replication after the other."""
    setting, hung, played = bench.setting, poses.conditions.payload, []
    p_true = target_points(setting.test_true, setting.target)
    for k in range(bench.scenario.uncertainty.replications):
        seen = bench.measure(poses.q, poses.pose_id, "replication", name, repeat=k, payload=hung)
        found = estimator.fit(seen, first.parameters)
        point, _, covariance = target_prediction(
            found.model, setting.test_q, setting.target, found.full_covariance
        )
        nees = mahalanobis_squared(found.step - truth, found.covariance)
        held = inside(p_true - point, covariance[:, :3, :3])
        played.append((found.step, found.standard_uncertainty, nees, point, held))
    return Repetitions(*map(np.array, zip(*played, strict=True)))


def chi_square_mean_band(freedom: int, count: int, probability: float = BAND) -> Array:
    """Band (2,) of the mean of `count` chi-square values with `freedom` degrees of freedom."""
    tail = (1 - probability) / 2
    return np.array([chdtri(freedom * count, p) / count for p in (1 - tail, tail)])


def binomial_band(count: int, expected: float = COVERAGE, probability: float = BAND) -> Array:
    """Band (2,) of the share of `count` independent intervals that hold what they should."""
    below = bdtr(np.arange(count + 1.0), count, expected)
    tail = (1 - probability) / 2
    return np.array([np.searchsorted(below, tail), np.searchsorted(below, 1 - tail)]) / count
