"""The first words of a report on trials: the headline table, and what to do next."""

import numpy as np

from calib.identification.identify import Identification, Status
from calib.measurement.accuracy import Accuracy
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.regions import coverage_factor
from testbed.report.page import Table, Verdict, heads
from testbed.studies.trial.records import Campaign, Comparison, Estimate, Trial
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.studies.trial.verdict import ALARM, judge
from testbed.units import (
    MM,
    counted,
    fixed,
    micrometres,
    millimetres,
    percent,
    probability,
    significant,
)

NONE = "–"
NOISE = ("tracker noise", "joint repeatability", "gross errors")
"""Sources that more poses average out."""
SHORT = {"whitened": "default", "paper": "paper"}
"""Estimators in the columns of tables."""


def headline_table(campaign: Campaign) -> Table:
    """One row per trial and estimator: errors on held-out poses and what was stated of them."""
    first = campaign.trials[0].estimates[0].comparison
    rows = [("nominal model", "", "", *_statistics(first.accuracy_before), *[NONE] * 8)]
    for trial in campaign.trials:
        for k, estimate in enumerate(trial.estimates):
            found, seen = estimate.identification, estimate.comparison
            rows.append(
                (
                    trial.name if k == 0 else "",
                    set_in_words(trial) if k == 0 else "",
                    SHORT[estimate.mode],
                    *_statistics(seen.accuracy_after),
                    millimetres(seen.stated_u, 2),
                    percent(float(seen.inside.mean())),
                    significant(found.chi_square / found.dof, 3) if tested(found) else NONE,
                    probability(found.p_value) if tested(found) else NONE,
                    significant(found.reduction.condition, 3),
                    str(found.rank),
                    significant(seen.nees, 3),
                    in_a_word(judge(trial, estimate)),
                )
            )
    return Table(
        caption=f"Tool position error on {counted(len(first.before), 'held-out pose')} against the "
        "noise-free truth, and what was stated",
        head=heads(
            "trial, pose set, estimator, mean mm, rms mm, p95 mm, max mm, stated u mm, "
            "inside 95 %, χ²/dof, p, cond., rank, NEES, believe"
        ),
        rows=tuple(rows),
        align="lllrrrrrrrrrrrl",
        strong=(1,),
        size="small",
        note="mean, rms, p95, max: distance between true and predicted tool point. stated u: root "
        "mean square over the held-out poses of the 3-D standard uncertainty (k = 1). inside 95 %: "
        "share of held-out poses whose true tool point lies in the stated 95 % ellipsoid. χ²/dof "
        "and p: residuals against the stated noise (p < 0.001 is an alarm). cond.: of the scaled "
        "Jacobian of the kept parameters, each estimator in its own rows. rank: parameters "
        "estimated. NEES: squared parameter error in units of the stated covariance; expected "
        "value = rank. default: whitened "
        "rows, all free parameters that can be told apart. paper: 24 parameters with base and "
        "tool taken as known, twelve unweighted rows.",
    )


def tested(found: Identification) -> bool:
    """Whether the residuals can be tested: the noise is known, and equations are left over."""
    return found.mode == "whitened" and found.dof > 0


def _statistics(error: Accuracy) -> tuple[str, ...]:
    """Mean, rms, p95 and maximum in mm."""
    values = (error.mean, error.rms, error.p95, error.maximum)
    return tuple(fixed(value * MM, 4) for value in values)


def set_in_words(trial: Trial) -> str:
    """How many poses and how they were chosen."""
    number = counted(len(trial.selection.indices), "pose")
    method = trial.method.replace("_", " ")
    return f"{number}, {method if method == 'random' else f'{method} {trial.selection.criterion}'}"


def next_step(campaign: Campaign) -> str:
    """What a person should do after reading the verdict on the first estimate."""
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    found, seen = estimate.identification, estimate.comparison
    errors = errors_in_words(seen)
    if found.status is not Status.CONVERGED:
        return f"The fit did not end in a minimum. {found.status.value}"
    statement = estimate.statement
    quoted = errors if statement is None else quotable(statement, errors)
    invalid = statement is not None and not statement.trust.model_valid
    outliers = 0 if statement is None else len(statement.outlier_poses)
    if invalid and outliers and found.loss == "squared":
        return (
            f"{counted(outliers, 'shot')} of the calibration do not fit the "
            "others (named below). Measure them again, or play the scenario with [identification] "
            f'loss = "cauchy". Until then quote {quoted} instead of the stated uncertainty.'
        )
    if tested(found) and found.p_value < ALARM:
        factor = np.sqrt(found.chi_square / found.dof)
        wider = (
            'Let the evidence decide about sag and harmonics ([identification] model = "choose"), '
            "and free what may have moved"
            if statement is None or statement.model == "geometric"
            else "Sag and harmonics are in the model already; look for play, warmth and frames "
            "held fixed that moved"
        )
        return (
            f"The residuals are {significant(float(factor), 2)} times what the noise explains, so "
            f"the model lacks something that the robot has. {wider}. Until then quote {quoted} "
            "instead of the stated uncertainty. More poses do not help: they shrink the stated "
            "uncertainty, not the error."
        )
    if invalid:
        return f"Do not quote the stated uncertainty; quote {quoted}."
    if judge(trial, estimate).contradicted:
        return f"Do not quote the stated uncertainty; quote {errors}."
    return (
        f"{permission(trial, estimate)}: the tool point of poses like the held-out ones with "
        f"rms u = {millimetres(seen.stated_u, 2)} mm (3-D, k = 1) and the 95 % ellipsoid of each "
        f"pose (k = {coverage_factor(3):.2f} along its axes). {more_poses(estimate.statement)}"
    )


def errors_in_words(seen: Comparison) -> str:
    """The errors at the held-out poses; no share of so few that it would say nothing."""
    count, largest = len(seen.after), f"{millimetres(seen.accuracy_after.maximum, 2)} mm"
    if count < fewest_poses(LEVEL):
        return f"only that the error at {counted(count, 'held-out pose')} reaches {largest}"
    return (
        f"the held-out errors (95 % of poses below {millimetres(seen.accuracy_after.p95, 2)} mm, "
        f"maximum {largest})"
    )


def permission(trial: Trial, estimate: Estimate) -> str:
    """How freely the stated uncertainty may be used."""
    if judge(trial, estimate).believable:
        return "The stated uncertainty may be used"
    return "Nothing speaks against the stated uncertainty, but not all of it was tested"


def more_poses(statement: Statement | None) -> str:
    """What four times the poses would make of u: they shrink noise, nothing else."""
    halved = "Four times the poses would halve u."
    if statement is None:
        return halved
    noise = np.isin(statement.sources, NOISE)
    rest = statement.combined_u**2 - float((statement.source_u[noise] ** 2).sum())
    if rest < 0.01 * statement.combined_u**2:
        return halved
    beyond = [n for n in statement.sources if n not in NOISE]
    if beyond == ["prior"]:
        return "How much more poses would help, only a fit without the prior can say."
    left = np.sqrt((statement.combined_u**2 + 3 * rest) / 4)
    return (
        f"Four times the poses would bring u to {millimetres(float(left), 2)} mm at best: "
        f"{percent(rest / statement.combined_u**2)} of its square is wrong the same way in all of "
        "them."
    )


def quotable(statement: Statement, errors: str) -> str:
    """What may be quoted instead of the model-based interval; the secret errors come last."""
    believe = statement.trust.believe
    if believe not in statement.names:
        return errors
    radius = micrometres(float(statement.radius[statement.names.index(believe)]), 3)
    words = {
        "conformal": f"the conformal radius, {radius} µm for 95 % of poses like the held-out ones",
        "discrepancy": f"the region with discrepancy, {radius} µm on average, as an approximation",
        "bootstrap": f"the replicates of the bootstrap, {radius} µm on average",
    }
    return words.get(believe, errors)


def in_a_word(verdict: Verdict) -> str:
    """Whether to believe, for a table."""
    return "yes" if verdict.believable else "NO" if verdict.contradicted else "?"
