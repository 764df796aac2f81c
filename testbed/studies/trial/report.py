"""The report on a trial: its first words, accuracy before and after, do the intervals hold."""

import numpy as np

from calib.identification.identify import Identification, Status
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.regions import coverage_factor
from testbed.report.page import Block, Figure, Points, Section, Table, Text, Verdict
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.records import Campaign, Comparison, Estimate, Trial
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.studies.trial.verdict import ALARM, judge
from testbed.units import (
    DEG,
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
            u = np.sqrt(np.mean(point_uncertainty(seen.covariance) ** 2))
            rows.append(
                (
                    trial.name if k == 0 else "",
                    set_in_words(trial) if k == 0 else "",
                    SHORT[estimate.mode],
                    *_statistics(seen.accuracy_after),
                    millimetres(u, 2),
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
        head=(
            "trial",
            "pose set",
            "estimator",
            "mean mm",
            "rms mm",
            "p95 mm",
            "max mm",
            "stated u mm",
            "inside 95 %",
            "χ²/dof",
            "p",
            "cond.",
            "rank",
            "NEES",
            "believe",
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
    if (
        invalid
        and statement is not None
        and len(statement.outlier_poses)
        and found.loss == "squared"
    ):
        return (
            f"{counted(len(statement.outlier_poses), 'shot')} of the calibration do not fit the "
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
    u = float(np.sqrt(np.mean(point_uncertainty(seen.covariance) ** 2)))
    return (
        f"{permission(trial, estimate)}: the tool point of poses like the held-out ones with "
        f"rms u = {millimetres(u, 2)} mm (3-D, k = 1) and the 95 % ellipsoid of each pose "
        f"(k = {coverage_factor(3):.2f} along its axes). {more_poses(estimate.statement)}"
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
    if statement is None:
        return "Four times the poses would halve u."
    noise = np.isin(statement.sources, NOISE)
    rest = statement.combined_u**2 - float((statement.source_u[noise] ** 2).sum())
    if rest < 0.01 * statement.combined_u**2:
        return "Four times the poses would halve u."
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


def accuracy_section(campaign: Campaign, every_trial: Table | None = None) -> Section:
    """Before and after, on held-out and on calibration poses; `every_trial` if not said before."""
    rows = []
    # one reflector does not see the tool's rotation about itself
    turns = campaign.scenario.tracker.measures == "pose"
    for trial in campaign.trials:
        for estimate in trial.estimates:
            seen = estimate.comparison
            rows.append(
                (
                    trial.name,
                    SHORT[estimate.mode],
                    millimetres(seen.identification_before.mean),
                    millimetres(seen.identification_after.mean),
                    millimetres(seen.accuracy_before.mean),
                    millimetres(seen.accuracy_after.mean),
                    significant(float(seen.accuracy_before.mean / seen.accuracy_after.mean), 2),
                    *(
                        significant(float(angle.mean() * DEG), 2) if turns else "–"
                        for angle in (seen.rotation_before, seen.rotation_after)
                    ),
                )
            )
    table = Table(
        caption="Mean errors before and after calibration",
        head=(
            "trial",
            "estimator",
            "calibration poses before mm",
            "after mm",
            "held-out before mm",
            "after mm",
            "gain",
            "rotation before deg",
            "after deg",
        ),
        rows=tuple(rows),
        align="llrrrrrrr",
        note="At the calibration poses the distance is to what the tracker measured, noise "
        "included, and the model was fitted to just these poses: only the held-out columns say how "
        "good the calibration is. gain: held-out before divided by after.",
    )
    return Section(
        "accuracy",
        "Before and after",
        (
            *((every_trial,) if every_trial else ()),
            Figure(
                "Position error at the held-out poses, against noise-free truth; "
                f"these poses were never used for identification{plots.only(campaign.trials)}.",
                plots.held_out_errors(campaign),
            ),
            table,
            Figure(
                "Position error at the calibration poses, against the measured tool points"
                f"{plots.only(campaign.trials)}.",
                plots.calibration_errors(campaign),
            ),
        ),
    )


def belief_section(campaign: Campaign) -> Section:
    """Whether the stated intervals hold the truth, estimator by estimator."""
    rows, sentences = [], []
    for trial in campaign.trials:
        for estimate in trial.estimates:
            rows.append(_belief_row(trial, estimate))
            sentences.append(intervals_in_words(trial, estimate))
    table = Table(
        caption="Stated 95 % intervals and regions against the truth",
        head=(
            "trial",
            "estimator",
            "parameters inside",
            "tool points inside",
            "replications",
            "mean NEES / rank",
            "honest band",
            "parameter coverage",
            "tool coverage",
            "stated / true sd",
        ),
        rows=tuple(rows),
        align="llrrrrrrrr",
        size="small",
        note="parameters and tool points inside: this one calibration (one robot, one noise draw; "
        "its poses share one parameter error, so the share may be far from 95 % by chance). "
        "Replications measure and identify the same poses again with fresh noise. honest band: "
        "where mean NEES / rank stays with 99.9 % probability if the stated covariance is true. "
        "parameter coverage: smallest to largest share of replications whose interval held a "
        "parameter. stated / true sd: smallest to largest ratio of the stated to the experimental "
        "standard deviation; 1 is honest about noise, and says nothing about bias.",
    )
    blocks: list[Block] = [table, Points(tuple(sentences[: plots.MOST_PANELS]))]
    if len(sentences) > plots.MOST_PANELS:
        blocks.append(Text(f"The other {len(sentences) - plots.MOST_PANELS} are in the table."))
    blocks.append(
        Figure(
            "Every parameter of the first trial: its error in units of its own stated standard "
            "uncertainty, and how often its interval held the true value.",
            plots_uncertainty.parameter_errors(campaign.trials[0]),
        )
    )
    return Section("belief", "Can the stated uncertainty be believed?", tuple(blocks))


def _belief_row(trial: Trial, estimate: Estimate) -> tuple[str, ...]:
    """One row of the table of intervals."""
    seen, played = estimate.comparison, estimate.replications
    f, t = len(seen.parameter_inside), len(seen.inside)
    here = (
        trial.name,
        SHORT[estimate.mode],
        f"{int(seen.parameter_inside.sum())} of {f}",
        f"{int(seen.inside.sum())} of {t}",
    )
    if played is None:
        return (*here, "0", *[NONE] * 5)
    low, high = played.nees_band / f
    covered = played.parameter_coverage
    return (
        *here,
        str(played.count),
        significant(float(played.nees.mean()) / f, 3),
        f"{low:.2f} to {high:.2f}",
        f"{percent(float(covered.min()))} to {percent(float(covered.max()))}",
        percent(float(played.tool_coverage.mean())),
        f"{fixed(float(played.sd_ratio.min()), 2)} to {fixed(float(played.sd_ratio.max()), 2)}",
    )


def intervals_in_words(trial: Trial, estimate: Estimate) -> str:
    """Whether the intervals of one estimate hold, and which parameters say otherwise."""
    who = f"{trial.name}, {plots.mode_name(estimate)}"
    played = estimate.replications
    if played is None:
        share = percent(float(estimate.comparison.inside.mean()))
        return f"{who}: no replications were played; {share} of the held-out points lie inside."
    low, high = played.coverage_band
    names, covered = estimate.identification.names, played.parameter_coverage
    worst = np.argsort(covered, kind="stable")
    below = [i for i in worst if covered[i] < low]
    above = int((covered > high).sum())
    nees_low, nees_high = played.nees_band
    honest = nees_low <= played.nees.mean() <= nees_high
    if not below and not above and honest:
        return (
            f"{who}: the intervals hold. Every parameter's 95 % interval held the truth in "
            f"{percent(float(covered.min()))} to {percent(float(covered.max()))} of replications "
            f"(an honest one stays within {percent(float(low))} to {percent(float(high))})."
        )
    said = []
    if below:
        listed = ", ".join(f"{names[i]} {percent(float(covered[i]))}" for i in below[:5])
        more = f" and {len(below) - 5} more" if len(below) > 5 else ""
        said.append(f"too narrow for {len(below)} of {len(covered)} parameters ({listed}{more})")
    if above:
        said.append(f"too wide for {above} of {len(covered)}")
    if not honest:
        said.append(
            f"mean NEES {significant(float(played.nees.mean()), 3)} instead of "
            f"{significant(float(nees_low), 3)} to {significant(float(nees_high), 3)}"
        )
    return f"{who}: the intervals fail: {'; '.join(said)}."
