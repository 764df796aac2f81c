"""The statement of a calibration: what may be said of the tool point, and what to believe.

All of it comes from what the tracker measured; only `attained`, which `compare` adds, is the
truth's.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index
from calib.identification.identify import Identification
from calib.identification.joint_models import shared_waves
from calib.identification.lack_of_fit import LackOfFit
from calib.identification.outlier_search import search_outliers
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.discrepancy import FEWEST
from calib.uncertainty.judgement import Judgement, judge
from calib.uncertainty.tool_point import ToolStatement, tool_statement
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.streams import stream
from testbed.studies.trial.compare import attained
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.statement.linear import linear_check
from testbed.studies.trial.statement.outliers import outlier_sentences, without_gross_errors
from testbed.studies.trial.statement.records import LEVEL, Replayed, Statement, Validation
from testbed.studies.trial.statement.sources import (
    full_covariance,
    systematic_reach,
    uncertainty_sources,
    unmodelled_effects,
)


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
    outliers = np.sort(search.rows)
    robust = result.loss != "squared"
    sources = uncertainty_sources(
        bench, result, first, outliers if robust else outliers[:0], setting.test_q
    )
    total = full_covariance(result, result.covariance + sources.systematic)
    linear, worst = linear_check(
        result, total, setting.test_q, setting.target, stream(seed, "statement", "linear", name)
    )
    lack = lack_of_fit(estimator, result, visits)
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
    regions = tool_regions(result, judgement, sources.systematic, validation.judge_q, target)
    radius = {kind: region.mean_radius for kind, region in regions.items()}
    shared = systematic_reach(result, sources.systematic, validation.judge_q, target)
    if judgement.conformal is not None:
        radius["conformal"] = judgement.conformal.radius + shared
    return Statement(
        model="extended" if estimator.extended else "geometric",
        why=estimator.why,
        log_evidence=estimator.log_evidence,
        outliers=outlier_sentences(search, first),
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
        warnings=(
            *too_few(len(held_out)),
            *gross_error_warnings(result, len(outliers), set_aside),
            *limits(result, shared if judgement.conformal is not None else 0.0),
        ),
    )


def tool_regions(
    result: Identification,
    judgement: Judgement,
    systematic: Array,
    q: Array,
    target: Array | None,
) -> dict[str, ToolStatement]:
    """Regions of the tool point at postures q (N, n): by the model, bootstrap and discrepancy.

    Parameters
    ----------
    result : Identification
        What was identified.
    judgement : Judgement
        With or without a bootstrap and a discrepancy.
    systematic : (f, f) array
        Covariance that the tracker's systematic errors leave in the estimate.
    q : (N, n) array
        Postures [rad, m].
    target : (3,) array or None
        The point on the tool [m]; None for the origin of its frame.
    """
    total = full_covariance(result, result.covariance + systematic)
    regions = {"model": tool_statement(result.model, q, total, target=target)}
    if judgement.bootstrap is not None:
        played = full_covariance(result, judgement.bootstrap.empirical + systematic)
        regions["bootstrap"] = tool_statement(result.model, q, played, target=target)
    if judgement.discrepancy is not None:
        regions["discrepancy"] = tool_statement(
            result.model, q, total, target=target, discrepancy=judgement.discrepancy
        )
    return regions


def lack_of_fit(
    estimator: Estimator, result: Identification, visits: list[Measurements]
) -> LackOfFit | None:
    """All visits fitted together, to see whether the model misses more than repeats scatter."""
    if result.loss != "squared" or len(visits) < 2:
        return None
    return estimator.fit(joined(visits), result.parameters).lack_of_fit


def summary(played: Bootstrap) -> Replayed:
    """The figures of a bootstrap that are kept."""
    worst = played.ratio[np.argmax(np.abs(played.ratio - 1))]
    bias = played.bias[np.argmax(np.abs(played.bias))]
    return Replayed(played.replicates, played.agrees, float(worst), float(bias), played.sentence)


def too_few(n: int) -> tuple[str, ...]:
    """What n held-out poses are too few to state.

    A warning, not an error: the calibration itself is as good as before.
    """
    need = fewest_poses(LEVEL)
    warnings = []
    if n < need:
        warnings.append(
            f"too few held-out poses were measured ({n}) for a {100 * LEVEL:g} % radius that needs "
            f"no model of the error: {need} are the fewest; write [test] poses = {need} or more"
        )
    if n < FEWEST:
        warnings.append(
            f"too few held-out poses were measured ({n}) to show a discrepancy: {FEWEST} are the "
            "fewest for a covariance"
        )
    return tuple(warnings)


def gross_error_warnings(
    result: Identification, outliers: int, set_aside: Index
) -> tuple[str, ...]:
    """What to do about gross errors, where some are in the fit or were set aside."""
    warnings = []
    if outliers and result.loss == "squared":
        some = "a shot" if outliers == 1 else f"{outliers} shots"
        warnings.append(
            f"{some} of the calibration may pull at the result; measure again what does not fit, "
            'or write loss = "cauchy" in [identification]'
        )
    if len(set_aside):
        poses = ", ".join(str(pose) for pose in set_aside)
        warnings.append(
            f"the shots of held-out poses {poses} were grossly wrong and are set aside; measure "
            "them again"
        )
    return tuple(warnings)


def limits(result: Identification, shared: float) -> tuple[str, ...]:
    """What a reader must know of the statements; `shared` [m] was added to the conformal radius."""
    warnings = []
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
