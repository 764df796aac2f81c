"""Sources of a calibration's uncertainty: noise, joints, errors of the tracker, and others."""

from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import Identification
from calib.identification.robust import sizes
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import Measurements
from calib.shown import length_words
from calib.uncertainty.budget import RowNoise, budget
from calib.uncertainty.refit import Frozen, freeze
from calib.uncertainty.statement.instrument import SOURCES, shared_rows
from calib.uncertainty.statement.shared import shared_errors
from calib.uncertainty.tool_point import tool_statement
from calib.uncertainty.type_b import CommonInput, common_inputs, type_b_covariance
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.scenario.laboratory import At960Tracker
from testbed.studies.trial.statement.records import LEVEL

DRIFT_COUNTS = 1 / 3
"""Fraction of the stated u from which drift is mentioned; below it u would grow by at most 5 %."""


@dataclass(frozen=True, slots=True, eq=False)
class UncertaintySources:
    """Uncertainty by each source, in the estimate and at the tool."""

    names: tuple[str, ...]
    """(s,) sources."""
    at_tool: Array
    """(s,) 3-D standard uncertainty, RMS over the postures asked for [m]."""
    combined: float
    """Standard uncertainty by all of them [m]."""
    systematic: Array
    """(f, f) covariance of the estimate by the tracker's systematic errors [m, rad]."""


def uncertainty_sources(
    bench: Laboratory, result: Identification, measured: Measurements, outliers: Index, q: Array
) -> UncertaintySources:
    """Split the uncertainty of one estimate into sources, at the tool point of postures q (N, n).

    Parameters
    ----------
    bench : Laboratory
        Laboratory, for the tracker's stated errors and the repeatability of joints.
    result : Identification
        Result in the mode *whitened*.
    measured : Measurements
        Measurements that it was identified from.
    outliers : (k,) array of int
        Rows with gross errors by a robust loss; their remaining effect has its own line.
    q : (N, n) array
        Postures [rad, m].
    """
    common = systematic_inputs(bench, measured)
    noise = row_noise(bench, result, measured, outliers)
    whole, target = budget(plan_of(result, measured), noise, common=common), bench.setting.target
    shared = {one.name for one in common}
    return UncertaintySources(
        whole.names,
        np.array([_rms_u(result, source.covariance, q, target) for source in whole.sources]),
        _rms_u(result, whole.covariance, q, target),
        sum(
            (source.covariance for source in whole.sources if source.name in shared),
            start=np.zeros_like(result.covariance),
        ),
    )


def plan_of(result: Identification, measured: Measurements) -> Frozen:
    """The curvature of a fit, with the weights of a robust loss."""
    if result.loss != "squared":
        weighed = measured.covariance / np.maximum(result.weights, 1e-12)[:, None, None]
        measured = replace(measured, covariance=weighed)
    prior = None
    if result.prior is not None:
        place = [result.names.index(name) for name in result.prior.names]
        prior = np.zeros_like(result.covariance)
        prior[np.ix_(place, place)] = result.prior.precision
    return freeze(result.model, measured, result.parameters, prior_precision=prior)


def row_noise(
    bench: Laboratory, result: Identification, measured: Measurements, outliers: Index
) -> list[RowNoise]:
    """Independent errors of every row: tracker, joints, and gross errors if there are any."""
    setting, m = bench.setting, len(measured)
    own, joints = (in_rounds if bench.rounds else of_the_target)(bench, measured)
    noise = [RowNoise("tracker noise", own)]
    if setting.joint_repeatability.any():
        noise.append(RowNoise("joint repeatability", joints))
    if len(outliers):
        size = sizes(result.residual, np.repeat(np.arange(m), measured.equations))
        excess = np.zeros(m)
        excess[outliers] = np.maximum(size[outliers], 1.0) ** 2 - 1.0
        noise.append(RowNoise("gross errors", excess[:, None, None] * measured.covariance))
    return noise


def of_the_target(bench: Laboratory, measured: Measurements) -> tuple[Array, Array]:
    """Covariances (m, 6, 6) of tracker and joints in rows of the one target."""
    setting, m = bench.setting, len(measured)
    T = setting.nominal.poses(measured.q)
    own = bench.tracker.own_covariance(bench.tracker.targets(T), T[:, :3, :3])
    joints = with_joint_noise(
        setting.nominal,
        measured.q,
        np.zeros((m, 6, 6)),
        setting.joint_repeatability,
        offset=np.broadcast_to(setting.target, (m, 3)),
    )
    return own, joints


def in_rounds(bench: Laboratory, measured: Measurements) -> tuple[Array, Array]:
    """Covariances (m, 6, 6) for rows of rounds, each with its own station and target."""
    model, sigma_q = bench.setting.nominal, bench.setting.joint_repeatability
    own, joints = np.zeros((2, len(measured), 6, 6))
    for one in bench.rounds:
        rows = one.rows_in(measured)
        q = measured.q[rows]
        own[rows] = one.own_covariance(model, q)
        joints[rows] = one.joint_covariance(model, q, sigma_q)
    return own, joints


def systematic_inputs(bench: Laboratory, measured: Measurements) -> tuple[CommonInput, ...]:
    """Systematic errors that the tracker states, constant over a campaign; or none."""
    settings = bench.scenario.tracker
    if not isinstance(settings, At960Tracker) or not settings.systematic:
        return ()
    size, station = bias_size(settings), bench.tracker.T_world_tracker[None]
    there = size.variance > 0
    B = shared_rows(size, bench.setting.nominal, measured, station)
    return common_inputs(tuple(compress(SOURCES, there)), B[:, :, there], size.variance[there])


def systematic_covariance(
    bench: Laboratory, result: Identification, measured: Measurements
) -> Array:
    """Covariance (f, f) of an estimate by the tracker's systematic errors; often zero [m, rad]."""
    common = systematic_inputs(bench, measured)
    if not common or result.mode == "paper":
        return np.zeros_like(result.covariance)
    return type_b_covariance(plan_of(result, measured), common)


def unseen_sources(
    bench: Laboratory, result: Identification, measured: Measurements, judged: Measurements
) -> tuple[str, ...]:
    """Errors of the tracker that matter at the tool but are visible at no held-out pose."""
    settings = bench.scenario.tracker
    if not isinstance(settings, At960Tracker) or not settings.systematic or not len(judged):
        return ()
    station = bench.tracker.T_world_tracker[None]
    return shared_errors(bias_size(settings), result, measured, judged, station).hidden


def drift_left(bench: Laboratory) -> float:
    """Error of readings by a drifting station, 3-D, RMS over time [m].

    References
    ----------
    Random walk since the last round over the nests, half its time on average; and the noise of the
    nests, which a round takes the mean of.
    """
    drift = bench.tracker.drift
    if drift is None:
        return 0.0
    nests = bench.tracker.own_covariance(drift.nests)[:, :3, :3].mean(axis=0) / len(drift.nests)
    return float(np.sqrt(3 * drift.rate**2 * drift.every / 2 + np.trace(nests)))


def systematic_reach(
    result: Identification,
    systematic: Array,
    q: Array,
    target: Array | None = None,
    *,
    level: float = LEVEL,
) -> float:
    """Mean radius of the tracker's systematic errors at postures q (N, n) [m].

    Held-out poses do not show them, since both visits have the same errors.
    """
    if not systematic.any():
        return 0.0
    common = replace(result, covariance=systematic).full_covariance
    stated = tool_statement(result.model, q, common, target=target, probability=level)
    return float(stated.region[0][:, 0].mean())


def unmodelled_effects(bench: Laboratory, u: float) -> tuple[str, ...]:
    """Known errors that are in no covariance, if they matter compared with a stated u [m]."""
    left = drift_left(bench)
    if left <= DRIFT_COUNTS * u:
        return ()
    return (
        f"the station wanders, which no stated covariance contains: about "
        f"{length_words(left, um='.0f')} stay in the readings between two rounds over the nests",
    )


def _rms_u(result: Identification, covariance: Array, q: Array, target: Array) -> float:
    """3-D standard uncertainty at the tool, RMS over postures [m]."""
    whole = replace(result, covariance=covariance).full_covariance
    stated = tool_statement(result.model, q, whole, target=target)
    return float(np.sqrt(np.mean(stated.point**2)))
