"""The statements of a calibration on its tool point, and which of them to believe.

They use sources of uncertainty, observations that do not fit, the check of linear propagation at
the tool point, and errors at held-out poses. All of these come from the tracker's readings; only
`attained` and `inside`, which `compare` adds, use the truth.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index
from calib.held_out_counts import FEWEST
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import Identification
from calib.identification.outliers.search import search_outliers
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.drift.drifting import Drifting
from calib.uncertainty.held_out import held_out
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.gain import of_all_numbers
from calib.uncertainty.tool_point import tool_statement
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.laboratory.truth.setting import held_out_conditions
from testbed.scenario.fixtures import rounds_per_visit
from testbed.streams import stream
from testbed.studies.trial.compare import attained, held_by
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.statement.caveats import warnings_of
from testbed.studies.trial.statement.linear_check import linear_check
from testbed.studies.trial.statement.records import LEVEL, Replayed, Statement, Validation
from testbed.studies.trial.statement.regions import honest_share, radii, tool_regions
from testbed.studies.trial.statement.sources import (
    systematic_reach,
    uncertainty_sources,
    unmodelled_effects,
    unseen_sources,
)

SET_ASIDE = 0.05
"""Probability that any observation of a sound validation visit is set aside."""


def state(
    bench: Laboratory,
    estimator: Estimator,
    result: Identification,
    visits: list[Measurements],
    validation: Validation,
    name: str,
) -> Statement:
    """Compute the statements on the tool point after one calibration.

    Parameters
    ----------
    bench : Laboratory
        The laboratory.
    estimator : Estimator
        Estimator that was used.
    result : Identification
        Its result from the first visit.
    visits : list of Measurements
        All visits of the trial's poses.
    validation : Validation
        The held-out poses, measured.
    name : str
        Name of the trial, after which the streams of bootstrap and Monte Carlo are named.
    """
    first, setting, seed = visits[0], bench.setting, bench.scenario.seed
    search = search_outliers(estimator.nominal, result, first)
    outliers, misfits = np.sort(search.rows), search.outliers.sentences(first)
    if search.too_many:
        misfits = (
            f"{len(search.suspects)} of {len(first)} observations do not fit: too many for gross "
            "errors; the model or the stated noise is wrong",
        )
    robust = result.loss != "squared"
    sources = uncertainty_sources(
        bench, result, first, outliers if robust else outliers[:0], setting.test_q
    )
    whole = replace(result, covariance=result.covariance + sources.systematic)
    linear, worst = linear_check(
        whole, first, setting.test_q, setting.target, stream(seed, "statement", "linear", name)
    )
    lack = None
    if not robust and len(visits) > 1:
        # all visits fitted together: is the misfit larger than the scatter of repeats?
        lack = estimator.fit(joined(visits), result.parameters).lack_of_fit
    kept = sound_held_out(result, validation.seen, first)
    observations = validation.seen.rows(kept)
    set_aside = np.setdiff1d(validation.seen.pose_id, observations.pose_id)
    target, repeatability = setting.target, setting.joint_repeatability
    judgement = judge(
        replace(result, lack_of_fit=lack),
        observations,
        train=first,
        circumstances=Circumstances(
            visits=sound_rows(result, joined(visits)),
            order=in_time(bench, first, kept),
            shared=of_all_numbers(result, sources.systematic),
            repeatability=repeatability,
            told_by=told_by(bench),
            target=(float(target[0]), float(target[1]), float(target[2])),
            unmodelled=unmodelled_effects(bench, sources.combined),
        ),
        probability=LEVEL,
        rng=stream(seed, "statement", "bootstrap", name),
        rejected_too=True,
        linear=linear,
    )
    held_out, discrepancy, played = judgement.held_out, judgement.discrepancy, judgement.bootstrap
    assert held_out is not None  # the tracker measures poses or points, never distances
    belief, judge_q, shared = judgement.belief, validation.judge_q, 0.0
    judges_met = held_out_conditions(bench.scenario, judge_q)
    once = np.unique(observations.pose_id, return_index=True)[1]
    at_judges, at_held_out, at_measured = (
        tool_regions(whole, judgement, sources.systematic, q, target, repeatability, at)
        for q, at in (
            (judge_q, judges_met),
            (setting.test_q, held_out_conditions(bench.scenario, setting.test_q)),
            (observations.q[once], observations.conditions.rows(once)),
        )
    )
    radius = radii(at_measured, judgement)
    if judgement.conformal is not None:
        shared = systematic_reach(result, sources.systematic, judge_q, target)
        radius["conformal"] = judgement.conformal.radius + shared
    larger_noise_u, drift_u, misfit_u = beyond_sources(
        whole, belief, judgement.drifting, setting.test_q, target
    )
    return Statement(
        model="extended" if estimator.extended else "geometric",
        why=estimator.reason.sentence,
        levels=estimator.reason.levels,
        because=estimator.reason.because,
        log_evidence=estimator.log_evidence,
        offered=estimator.offered,
        steps=estimator.steps,
        outliers=misfits,
        outlier_poses=first.pose_id[outliers],
        set_aside=set_aside,
        lack_of_fit=lack,
        held_out=held_out,
        belief=belief,
        point=judgement.point,
        questions=judgement.questions,
        frame=judgement.frame,
        drifting=judgement.drifting,
        discrepancy=discrepancy,
        conformal=judgement.conformal,
        bootstrap=None if played is None else summary(played),
        linear=linear,
        linear_pose=worst,
        sources=sources.names,
        source_u=sources.at_tool,
        combined_u=sources.combined,
        larger_noise_u=larger_noise_u,
        drift_u=drift_u,
        misfit_u=misfit_u,
        discrepancy_u=(
            float("nan")
            if discrepancy is None
            else float(np.sqrt(np.trace(discrepancy.covariance)))
        ),
        systematic=sources.systematic,
        trust=judgement.trust,
        names=tuple(radius),
        radius=np.array(list(radius.values())),
        attained=attained(validation, at_judges, radius.get("conformal")),
        honest=(
            float("nan")
            if belief is None
            else honest_share(
                belief, judge_q, target, judges_met, stream(seed, "statement", "honest", name)
            )
        ),
        inside=held_by(at_held_out.get("region"), setting),
        warnings=warnings_of(
            result,
            len(held_out),
            len(outliers),
            set_aside,
            shared,
            unseen_sources(bench, result, first, observations),
        ),
        strays=judgement.strays,
    )


def in_time(bench: Laboratory, first: Measurements, kept: Index) -> tuple[Index, Index]:
    """Place in time of the rows of the first visit, and of those kept (n,) of the held-out one.

    Both visits measure their poses in the order in which they were drawn, a random one. Those of a
    greedy set are in the order of being chosen, which raises no more false alarms (3 % of 180
    campaigns below .05). The held-out visit begins after the first visit of the largest trial.
    """
    scenario = bench.scenario
    begin = max(trial.poses for trial in scenario.trial) * rounds_per_visit(scenario)
    return np.arange(len(first)), begin + kept


def told_by(bench: Laboratory) -> str:
    """Source of the repeatability of joints, in words."""
    own = bench.scenario.truth.joint_repeatability_mdeg is None
    return "the robot's description" if own else "the scenario"


def beyond_sources(
    whole: Identification, belief: Belief | None, drifting: Drifting | None, q: Array, target: Array
) -> tuple[float, float, float]:
    """Uncertainty beyond the stated sources, 3-D at the tool, RMS over q (N, n) [m].

    Noise larger than stated, if repeats or angles show it; drift; and the largest hidden misfit.
    """
    if belief is None:
        return 0.0, 0.0, 0.0

    def variance(covariance: Array) -> float:
        """Mean variance of the tool point."""
        return float(np.mean(tool_statement(whole.model, q, covariance, target=target).point ** 2))

    slow = None if drifting is None else drifting.covariance
    drift = 0.0 if slow is None else variance(slow)
    parameters = variance(belief.covariance)
    noise = 0.0
    if belief.misfit.larger_noise > 1 or belief.turned:
        noise = parameters - drift - variance(whole.full_covariance)
    every = float(np.mean(belief.regions(q, target=target).point ** 2))
    parts = noise, drift, every - parameters
    larger, slowly, hidden = (float(np.sqrt(max(part, 0.0))) for part in parts)
    return larger, slowly, hidden


def summary(played: Bootstrap) -> Replayed:
    """The figures of a bootstrap that are kept."""
    worst = played.ratio[np.argmax(np.abs(played.ratio - 1))]
    bias = played.bias[np.argmax(np.abs(played.bias))]
    return Replayed(played.replicates, played.agrees, float(worst), float(bias), played.sentence)


def sound_held_out(result: Identification, validation: Measurements, used: Measurements) -> Index:
    """Rows of the held-out observations without gross errors.

    Rows are set aside only with a robust loss, by which gross errors are to be expected.
    """
    if result.loss == "squared" or len(validation) < FEWEST:
        return np.arange(len(validation))
    errors = held_out(result.model, result.full_covariance, validation, used.q)
    size = mahalanobis_squared(errors.error, errors.predicted + errors.measured)
    return np.flatnonzero(~gross(size))


def sound_rows(result: Identification, visits: Measurements) -> Measurements:
    """All visits of poses and points; with a robust loss without rows with gross errors."""
    visits = visits.rows(~visits.is_distance)
    if result.loss == "squared" or len(visits) < FEWEST:
        return visits
    residual = predict(result.model, visits).residual[:, :3]
    return visits.rows(~gross(mahalanobis_squared(residual, visits.covariance[:, :3, :3])))


def gross(size: Array) -> Bool:
    """Which of m squared sizes are gross errors; none if there would be too many.

    Sizes are relative to the median, since misfit at all poses is not a gross error.
    """
    usual = max(float(np.median(size)) / float(chdtri(3, 0.5)), 1.0)
    found = size > usual * chdtri(3, SET_ASIDE / len(size))
    return np.asarray(found & (found.mean() <= MOST_OUTLIERS))
