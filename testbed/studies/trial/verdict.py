"""The verdict: how good a calibration is, whether its uncertainty can be believed; what to do."""

import re
from collections.abc import Callable

import numpy as np

from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.uncertainty.conformal import fewest_poses
from calib.uncertainty.regions import coverage_factor
from testbed.report.page import Verdict
from testbed.studies.trial.records import Campaign, Comparison, Estimate, Trial
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.units import (
    MM,
    NARROW,
    UM,
    counted,
    micrometres,
    millimetres,
    percent,
    probability,
    significant,
)

ALARM = RED
"""Chi-square p-value below which the residuals contradict the model."""
GOOD = "✓ The stated uncertainty can be believed"
INVALID = "✗ The model-based interval is not valid here"
BAD = "✗ The stated uncertainty must not be believed"
OPEN = "? The stated uncertainty was not tested against the truth"
NOISE = ("tracker noise", "joint repeatability", "gross errors")
"""Sources that more poses average out."""


def judge(trial: Trial, estimate: Estimate) -> Verdict:
    """Judge one estimate of one trial by all that speaks for and against what it states.

    Residuals, repeats and measured held-out poses are what a real laboratory has too, and decide
    which statement is to be believed; the share inside and the replications need the truth.
    """
    found, seen, played = estimate.identification, estimate.comparison, estimate.replications
    failed: list[str] = []
    passed: list[str] = []

    def say(good: bool, sentence: str) -> None:
        (passed if good else failed).append(sentence)

    if found.mode == "whitened":
        ratio, p = found.chi_square / found.dof, found.p_value
        said = f"chi-square per degree of freedom is {ratio:.2f} (p {_chance(p)})"
        say(
            p >= ALARM,
            f"{said}: the residuals "
            + ("agree with the model" if p >= ALARM else "contradict the model"),
        )
    else:
        passed.append("unweighted rows have no chi-square test: no warning if the model is wrong")
    if estimate.statement is not None:
        _measured(estimate.statement, say)
        if not failed and not estimate.statement.trust.model_valid:
            say(False, estimate.statement.trust.sentences[0])
    if played is not None:
        low, high = played.nees_band
        nees = float(played.nees.mean())
        say(
            bool(low <= nees <= high),
            f"mean NEES of {played.count} replications is {nees:.2f}; an honest statement gives "
            f"{low:.2f} to {high:.2f}",
        )
        low, high = played.coverage_band
        covered = played.parameter_coverage
        outside = int(((covered < low) | (covered > high)).sum())
        say(
            outside == 0,
            f"95 % intervals held the true parameter in {_percent(covered.min())} to "
            f"{_percent(covered.max())} "
            f"of {played.count} replications"
            + (
                f"; {outside} of {len(covered)} lie outside {_percent(low)} to {_percent(high)}"
                * (outside > 0)
            ),
        )
        share = float(played.tool_coverage.mean())
        say(
            bool(low <= share),
            f"95 % regions held the true tool point in {_percent(share)} of all replications and "
            "held-out poses",
        )
    else:
        share = float(seen.inside.mean())
        # one robot's poses share its parameter error: only a gross failure can be told from one
        say(share >= 0.5, f"{_percent(share)} of the held-out points lie inside their 95 % regions")
    if found.status is not Status.CONVERGED:
        failed.insert(0, f"the fit {found.status.value}")
    size = (
        f"{trial.name} brings the mean tool error on held-out poses from "
        f"{seen.accuracy_before.mean * MM:.3f} to {seen.accuracy_after.mean * MM:.3f} mm"
    )
    u = f"(rms u {seen.stated_u * MM:.4f} mm)"
    stated = f"its stated uncertainty {u}"
    if found.mode == "paper":  # the paper states the scatter of repeats
        stated = f"the uncertainty that the covariance of its unweighted fit claims {u}"
    believable = played is not None and not failed
    valid = estimate.statement is None or estimate.statement.trust.model_valid
    if estimate.statement is not None and not valid:
        why, advice = against(estimate.statement), instead(estimate.statement)
        sentence, mark = f"{why}. {size}; {advice}.", INVALID
    elif failed:
        sentence, mark = f"{size}, but {stated} must not be believed: {failed[0]}.", BAD
    elif believable:
        sentence, mark = f"{size}, and {stated} can be believed.", GOOD
    else:
        sentence, mark = f"{size}; {stated} {_untested(estimate)}.", OPEN
    return Verdict(believable, bool(failed), sentence, (*failed, *passed), mark)


def _measured(statement: Statement, say: Callable[[bool, str], None]) -> None:
    """What measured held-out poses, repeats and Monte Carlo say of the model-based interval."""
    seen, lack = statement.held_out, statement.lack_of_fit
    good = seen.p_value >= ALARM
    say(
        good,
        f"errors at {len(seen)} measured held-out poses are "
        + ("what it says" if good else "larger than it says")
        + f" (chi-square per degree of freedom {seen.chi_square / (3 * len(seen)):.2f}, "
        f"p {_chance(seen.p_value)})",
    )
    if lack is not None and lack.p_value < ALARM:
        say(False, f"the model misses more than repeats scatter (F = {lack.ratio:.1f}, p < 0.001)")


def against(statement: Statement) -> str:
    """Why the model-based interval is not valid, without the figures."""
    return re.sub(r" \([^)]*\)", "", statement.trust.sentences[0])


def instead(statement: Statement) -> str:
    """What to believe where the model-based interval is not valid."""
    believe = statement.trust.believe
    if believe not in statement.names:
        return "no statement about the tool point can be believed"
    radius = f"{statement.radius[statement.names.index(believe)] * UM:.0f} um"
    if believe == "conformal":
        return f"believe the conformal radius, {radius} at {100 * LEVEL:.0f} %"
    if believe == "discrepancy":
        return f"believe the interval with discrepancy as an approximation, {radius} on average"
    return f"believe the replicates of the bootstrap, {radius} on average"


def _untested(estimate: Estimate) -> str:
    """What to do about a statement that no replication has tested."""
    if estimate.identification.prior is not None:
        return (
            "rests on a prior, which no replication of one robot can test; residuals and held-out "
            "poses do not contradict it"
        )
    if estimate.statement is not None and estimate.statement.systematic.any():
        return (
            "has a part that the tracker gets wrong all campaign long, which no replication can "
            "test; residuals and held-out poses do not contradict it"
        )
    return (
        "was not tested against the truth: play the scenario with [uncertainty] replications = 200"
    )


def trial_verdict(campaign: Campaign) -> Verdict:
    """Verdict on the first estimate of the first trial: what most reports open with."""
    trial = campaign.trials[0]
    return judge(trial, trial.estimates[0])


def _percent(share: float) -> str:
    """A share in percent, in plain text."""
    return percent(share).replace(NARROW, " ")


def _chance(p: float) -> str:
    """A p-value after the letter p."""
    return probability(p) if p < ALARM else f"= {probability(p)}"


def tested(found: Identification) -> bool:
    """Whether the residuals can be tested: the noise is known, and equations are left over."""
    return found.mode == "whitened" and found.dof > 0


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
    may = "The stated uncertainty may be used"
    if not judge(trial, estimate).believable:
        may = "Nothing speaks against the stated uncertainty, but not all of it was tested"
    return (
        f"{may}: the tool point of poses like the held-out ones with "
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
