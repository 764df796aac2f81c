"""The statement of a calibration: what may be said of the tool point, and what to believe.

Weighed are sources of uncertainty, observations that do not fit, whether linear propagation holds
at the tool point, and errors at held-out poses. All of it comes
from what the tracker measured; only `attained`, which `compare` adds, is the truth's.
"""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Index
from calib.identification.fit_statistics import MOST_OUTLIERS
from calib.identification.identify import Identification
from calib.identification.joint_models import shared_waves
from calib.identification.outlier_search import search_outliers
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.discrepancy import FEWEST, Discrepancy
from calib.uncertainty.held_out import held_out
from calib.uncertainty.judgement import Judgement, judge
from calib.uncertainty.regions import mahalanobis_squared
from calib.uncertainty.tool_point import ToolStatement, tool_statement
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.streams import stream
from testbed.studies.trial.compare import attained
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.statement.linear_check import linear_check
from testbed.studies.trial.statement.records import LEVEL, Replayed, Statement, Validation
from testbed.studies.trial.statement.sources import (
    systematic_reach,
    uncertainty_sources,
    unmodelled_effects,
)

SET_ASIDE = 0.05
"""Chance that any observation of a sound validation visit is set aside."""


def state(
    bench: Laboratory,
    estimator: Estimator,
    result: Identification,
    visits: list[Measurements],
    validation: Validation,
    name: str,
) -> Statement:
    """Weigh what may be said of the tool point after one calibration.

    Parameters
    ----------
    bench : Laboratory
        The laboratory.
    estimator : Estimator
        What was fitted.
    result : Identification
        From the first visit.
    visits : list of Measurements
        All visits of the trial's poses.
    validation : Validation
        The held-out poses, measured.
    name : str
        Of the trial: the bootstrap and the Monte Carlo draw from streams named after it.
    """
    first, setting, seed = visits[0], bench.setting, bench.scenario.seed
    search = search_outliers(estimator.nominal, result, first)
    outliers, misfits = np.sort(search.rows), search.outliers.sentences(first)
    if search.too_many:
        misfits = (
            f"{len(search.suspects)} of {len(first)} shots do not fit: that many are no gross "
            "errors; the model or the stated noise is wrong",
        )
    robust = result.loss != "squared"
    sources = uncertainty_sources(
        bench, result, first, outliers if robust else outliers[:0], setting.test_q
    )
    whole = replace(result, covariance=result.covariance + sources.systematic)
    linear, worst = linear_check(
        whole, setting.test_q, setting.target, stream(seed, "statement", "linear", name)
    )
    lack = None
    if not robust and len(visits) > 1:
        # all visits fitted together: does the model miss more than repeats scatter?
        lack = estimator.fit(joined(visits), result.parameters).lack_of_fit
    observations, set_aside = without_gross_errors(result, validation.seen, first)
    judgement = judge(
        replace(result, lack_of_fit=lack),
        observations,
        train=first,
        probability=LEVEL,
        rng=stream(seed, "statement", "bootstrap", name),
        rejected_too=True,
        linear=linear,
        unmodelled=unmodelled_effects(bench, sources.combined),
    )
    held_out, discrepancy, played = judgement.held_out, judgement.discrepancy, judgement.bootstrap
    assert held_out is not None  # the tracker measures poses or points, never distances
    target = setting.target if setting.target.any() else None
    regions = tool_regions(whole, judgement, sources.systematic, validation.judge_q, target)
    radius, shared = {kind: region.mean_radius for kind, region in regions.items()}, 0.0
    if judgement.conformal is not None:
        shared = systematic_reach(result, sources.systematic, validation.judge_q, target)
        radius["conformal"] = judgement.conformal.radius + shared
    return Statement(
        model="extended" if estimator.extended else "geometric",
        why=estimator.why,
        log_evidence=estimator.log_evidence,
        outliers=misfits,
        outlier_poses=first.pose_id[outliers],
        set_aside=set_aside,
        lack_of_fit=lack,
        held_out=held_out,
        discrepancy=discrepancy,
        conformal=judgement.conformal,
        bootstrap=None if played is None else summary(played),
        linear=linear,
        linear_pose=worst,
        sources=sources.names,
        source_u=sources.at_tool,
        combined_u=sources.combined,
        discrepancy_u=(
            float("nan")
            if discrepancy is None
            else float(np.sqrt(np.trace(discrepancy.covariance)))
        ),
        systematic=sources.systematic,
        trust=judgement.trust,
        names=tuple(radius),
        radius=np.array(list(radius.values())),
        attained=attained(validation, tuple(regions.values()), radius.get("conformal")),
        warnings=warnings_of(result, len(held_out), len(outliers), set_aside, shared),
    )


def tool_regions(
    whole: Identification,
    judgement: Judgement,
    systematic: Array,
    q: Array,
    target: Array | None,
) -> dict[str, ToolStatement]:
    """Regions of the tool point at postures q (N, n): by the model, bootstrap and discrepancy.

    Parameters
    ----------
    whole : Identification
        What was identified; its covariance has the systematic part.
    judgement : Judgement
        With or without a bootstrap and a discrepancy.
    systematic : (f, f) array
        Covariance that the tracker's systematic errors leave in the estimate.
    q : (N, n) array
        Postures [rad, m].
    target : (3,) array or None
        The point on the tool [m]; None for the origin of its frame.
    """
    made: dict[str, tuple[Identification, Discrepancy | None]] = {"model": (whole, None)}
    if judgement.bootstrap is not None:
        played = judgement.bootstrap.empirical + systematic
        made["bootstrap"] = (replace(whole, covariance=played), None)
    if judgement.discrepancy is not None:
        made["discrepancy"] = (whole, judgement.discrepancy)
    return {
        name: tool_statement(
            one.model, q, one.full_covariance, target=target, discrepancy=discrepancy
        )
        for name, (one, discrepancy) in made.items()
    }


def summary(played: Bootstrap) -> Replayed:
    """The figures of a bootstrap that are kept."""
    worst = played.ratio[np.argmax(np.abs(played.ratio - 1))]
    bias = played.bias[np.argmax(np.abs(played.bias))]
    return Replayed(played.replicates, played.agrees, float(worst), float(bias), played.sentence)


def warnings_of(
    result: Identification, held_out: int, outliers: int, set_aside: Index, shared: float
) -> tuple[str, ...]:
    """What a reader must know of the statements, and what to do about it.

    Too few held-out poses are a warning, not an error: the calibration itself is as good as before.
    Gross errors count where some are in the fit or were set aside; `shared` [m] was added to the
    conformal radius.
    """
    need, warnings = fewest_poses(LEVEL), []
    if held_out < need:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) for a {100 * LEVEL:g} % radius "
            f"that needs no model of the error: {need} are the fewest; write [test] poses = {need} "
            "or more"
        )
    if held_out < FEWEST:
        warnings.append(
            f"too few held-out poses were measured ({held_out}) to show a discrepancy: {FEWEST} "
            "are the fewest for a covariance"
        )
    if outliers and result.loss == "squared":
        some = "a shot" if outliers == 1 else f"{outliers} shots"
        warnings.append(
            f"{some} of the calibration may pull at the result; measure again what does not fit, "
            'or write loss = "cauchy" in [identification]'
        )
    if len(set_aside):
        poses = ", ".join(map(str, set_aside))
        warnings.append(
            f"the shots of held-out poses {poses} were grossly wrong and are set aside; measure "
            "them again"
        )
    if shared > 0:
        warnings.append(
            "what the tracker gets wrong the same way in both visits shows at no held-out pose: "
            f"{1e6 * shared:.0f} um for it are added to the conformal radius in the table"
        )
    if result.prior is not None:
        warnings.append(
            "the estimate rests on a prior as well: its intervals hold over robots like those that "
            "the prior describes, not over repeats of one"
        )
    return (*warnings, *shared_waves(result))


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
