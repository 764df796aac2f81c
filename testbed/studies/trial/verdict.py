"""The verdict: how good a calibration is, and whether its stated uncertainty can be believed."""

import re
from collections.abc import Callable

from calib.identification.fit_statistics import RED
from calib.identification.identify import Status
from testbed.report.page import Verdict
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.units import MM, NARROW, UM, percent, probability

ALARM = RED
"""Chi-square p-value below which the residuals contradict the model."""
GOOD = "✓ The stated uncertainty can be believed"
INVALID = "✗ The model-based interval is not valid here"
BAD = "✗ The stated uncertainty must not be believed"
OPEN = "? The stated uncertainty was not tested against the truth"


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
    stated = f"its stated uncertainty (rms u {seen.stated_u * MM:.4f} mm)"
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
