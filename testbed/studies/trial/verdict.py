"""The verdict: how good a calibration is, whether what is stated can be believed, what to do."""

from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.uncertainty.outlying.poses import Strays
from testbed.report.page import Verdict
from testbed.studies.trial.records import Campaign, Estimate, Replications, Trial
from testbed.studies.trial.statement.records import Statement
from testbed.units import MM, NARROW, counted, p_equals, percent, significant

ALARM = RED
"""Chi-square p-value below which the residuals contradict the stated noise."""
GOOD = "✓ The stated uncertainty can be believed"
NOTHING = "✗ Nothing about the tool point can be believed"
BAD = "✗ The stated uncertainty must not be believed"
OPEN = "? The stated uncertainty was not tested against the truth"
JUDGES = "further poses, used for nothing else"
GROSS = 0.5
"""Share of one robot's poses below which the covariance of a fit has failed, by itself."""


def judge(trial: Trial, estimate: Estimate) -> Verdict:
    """Judge one estimate of one trial: what is stated of it, and what the truth says to that.

    What is believed follows from what a real laboratory has too. Judged it is by what only a
    simulation knows: the true tool points at further poses, and in replications.
    """
    against, beside = truth_says(estimate)
    found, seen, statement = estimate.identification, estimate.comparison, estimate.statement
    size = (
        f"{trial.name} brings the mean tool error on held-out poses from "
        f"{seen.accuracy_before.mean * MM:.3f} to {seen.accuracy_after.mean * MM:.3f} mm"
    )
    reasons = (*against, *_lacking(estimate, against), *measured_says(estimate), *beside)
    if statement is None:
        return _of_covariance(estimate, size, against, reasons)
    if statement.point is None:
        why = statement.trust.sentences[0].rstrip(".")
        first = f"{why[:1].lower()}{why[1:]}" if found.status is Status.CONVERGED else _end(found)
        return Verdict(False, True, f"{size}; {first}.", reasons, NOTHING)
    stated = f"{size}; {statement.point.sentence}"
    if against:
        words = f"{stated}, which must not be believed: {against[0]}."
        return Verdict(False, True, words, reasons, BAD)
    return Verdict(True, False, f"{stated}, and this can be believed.", reasons, GOOD)


def _lacking(estimate: Estimate, against: list[str]) -> tuple[str, ...]:
    """Why a statement can be believed whose model the readings contradict; nothing else."""
    found, statement = estimate.identification, estimate.statement
    if against or statement is None or statement.point is None or not tested(found):
        return ()
    if min(found.p_value, statement.held_out.p_value) >= ALARM:
        return ()
    if found.p_value >= ALARM and (strays := strays_of(statement)) is not None:
        return (
            f"{counted(len(strays.poses), 'held-out pose')} "
            f"{'stands' if len(strays.poses) == 1 else 'stand'} out where all others agree, so a "
            "reading is wrong or the model fails there; the stated region allows for either",
        )
    return (
        "the model lacks something, as the next lines show; the stated region allows for it, and "
        "this region is what the truth judges",
    )


def _of_covariance(
    estimate: Estimate, size: str, against: list[str], reasons: tuple[str, ...]
) -> Verdict:
    """Verdict on an unweighted fit, of which nothing but its covariance is stated."""
    u = f"(3-D, k = 1: rms u {estimate.comparison.stated_u * MM:.4f} mm)"
    claimed = f"the uncertainty that the covariance of its unweighted fit claims {u}"
    if estimate.identification.status is not Status.CONVERGED:
        against = [_end(estimate.identification), *against]
    if against:
        words = f"{size}; {claimed} must not be believed: {against[0]}."
        return Verdict(False, True, words, reasons, BAD)
    if estimate.replications is not None:
        return Verdict(True, False, f"{size}; {claimed} can be believed.", reasons, GOOD)
    words = (
        f"{size}; {claimed} was not tested against the truth: play the scenario with [uncertainty] "
        "replications = 200."
    )
    return Verdict(False, False, words, reasons, OPEN)


def _end(found: Identification) -> str:
    """That a fit did not end in a minimum."""
    return f"the fit {found.status.value}"


def truth_says(estimate: Estimate) -> tuple[list[str], list[str]]:
    """What the truth says against what is stated, and what it says beside that.

    Intervals of the parameters alone are no part of what is believed of a weighted fit; where they
    fail, that stands beside it.
    """
    against: list[str] = []
    beside: list[str] = []

    def say(good: bool, sentence: str) -> None:
        (beside if good else against).append(sentence)

    statement, played = estimate.statement, estimate.replications
    if statement is not None and statement.belief is not None:
        share = float(statement.attained[statement.names.index("region")])
        say(
            share >= statement.honest,
            f"the believed region contains the true mean tool point at {_percent(share)} of "
            f"{JUDGES} (an honest region: at {_percent(statement.honest)} or more, on 999 of 1000 "
            "robots)",
        )
    if played is None:
        if statement is None:
            share = float(estimate.comparison.inside.mean())
            # one robot's poses share its parameter error: only a gross failure can be told from one
            say(
                share >= GROSS,
                f"{_percent(share)} of the held-out points lie inside their 95 % regions",
            )
        return against, beside
    if played.region_coverage is not None:
        share = float(played.region_coverage.mean())
        say(
            bool(share >= played.coverage_band[0]),
            "regions as large as the believed one contained the true mean tool point in "
            f"{_percent(share)} of all replications and held-out poses",
        )
    for good, sentence in parameters_alone(played):
        if statement is None:
            say(good, sentence)
        else:
            beside.append(f"the parameters alone: {sentence}")
    return against, beside


def parameters_alone(played: Replications) -> tuple[tuple[bool, str], ...]:
    """What replications say of intervals from the covariance of the fit, and whether it is good."""
    low, high = played.nees_band
    nees = float(played.nees.mean())
    shown = significant(float(f"{nees:.3g}"))  # thousands are rounded too
    first = (
        bool(low <= nees <= high),
        f"mean NEES of {played.count} replications is {shown}; an honest statement "
        f"gives {significant(low)} to {significant(high)}",
    )
    low, high = played.coverage_band
    covered = played.parameter_coverage
    outside = int(((covered < low) | (covered > high)).sum())
    text = (
        f"95 % intervals contained the true parameter in {_percent(covered.min())} to "
        f"{_percent(covered.max())} of {played.count} replications"
    )
    if outside:
        text += f"; {outside} of {len(covered)} lie outside {_percent(low)} to {_percent(high)}"
    share = float(played.tool_coverage.mean())
    third = (
        f"95 % regions contained the true tool point in {_percent(share)} of all replications and "
        "held-out poses"
    )
    return first, (outside == 0, text), (bool(low <= share), third)


def measured_says(estimate: Estimate) -> tuple[str, ...]:
    """What residuals, repeats and measured held-out poses say of the parameters alone."""
    found, statement = estimate.identification, estimate.statement
    if found.mode != "whitened":
        return ("unweighted rows have no chi-square test: no warning if the model is wrong",)
    said = [
        f"chi-square per degree of freedom is {found.chi_square / found.dof:.2f} "
        f"(p {p_equals(found.p_value)}): the residuals {_speak(found.p_value)}"
    ]
    if statement is not None:
        seen, lack = statement.held_out, statement.lack_of_fit
        said.append(
            f"errors at {len(seen)} measured held-out poses {_speak(seen.p_value)} (chi-square "
            f"per degree of freedom {seen.chi_square / (3 * len(seen)):.2f}, "
            f"p {p_equals(seen.p_value)})"
        )
        if lack is not None and lack.p_value < ALARM:
            said.append(
                "the errors of the model exceed the scatter of repeats "
                f"(F = {lack.ratio:.1f}, p < 0.001)"
            )
    return tuple(said)


def _speak(p: float) -> str:
    """Whether something contradicts the noise; where nothing does, that is no proof."""
    return "contradict the stated noise" if p < ALARM else "do not contradict the stated noise"


def trial_verdict(campaign: Campaign) -> Verdict:
    """Verdict on the first estimate of the first trial: what most reports open with."""
    trial = campaign.trials[0]
    return judge(trial, trial.estimates[0])


def _percent(share: float) -> str:
    """A share in percent, in plain text."""
    return percent(share).replace(NARROW, " ")


def tested(found: Identification) -> bool:
    """Whether the residuals can be tested: the noise is known, and equations are left over."""
    return found.mode == "whitened" and found.dof > 0


def strays_of(statement: Statement | None) -> Strays | None:
    """Held-out poses that stand out where all others agree with the calibration."""
    strays = None if statement is None else statement.strays
    return None if strays is None or strays.moved else strays
