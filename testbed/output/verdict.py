"""The verdict: how good a calibration is, and whether its stated uncertainty can be believed."""

from dataclasses import dataclass

import numpy as np

from calib.identification.identify import Status
from calib.information.propagation import point_uncertainty
from testbed.output.quantities import NARROW, percent, probability
from testbed.records import Campaign, Estimate, Trial

ALARM = 1e-3
"""Chi-square p-value below which the residuals contradict the model."""
MM = 1e3


@dataclass(frozen=True, slots=True)
class Verdict:
    """One estimate judged."""

    believable: bool
    """Whether the stated uncertainty passed every test, replications against the truth included."""
    contradicted: bool
    """Whether a test failed; a statement that was never tested is neither."""
    sentence: str
    """How good, and whether that can be believed."""
    reasons: tuple[str, ...]
    """One sentence per test, the failed ones first."""


def judge(trial: Trial, estimate: Estimate) -> Verdict:
    """Judge one estimate of one trial by its residuals, its held-out poses and its replications.

    Residuals are what a real laboratory has too; the other two need the truth.
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
    u = np.sqrt(np.mean(point_uncertainty(seen.covariance) ** 2))
    size = (
        f"{trial.name} brings the mean tool error on held-out poses from "
        f"{seen.accuracy_before.mean * MM:.3f} to {seen.accuracy_after.mean * MM:.3f} mm"
    )
    stated = f"its stated uncertainty (rms u {u * MM:.4f} mm)"
    believable = played is not None and not failed
    if failed:
        ending = f", but {stated} must not be believed: {failed[0]}."
    elif believable:
        ending = f", and {stated} can be believed."
    else:
        ending = (
            f"; {stated} was not tested against the truth: play the scenario with "
            "[uncertainty] replications = 200."
        )
    return Verdict(believable, bool(failed), size + ending, (*failed, *passed))


def headline_verdict(campaign: Campaign) -> Verdict:
    """Verdict on the first estimate of the first trial: what the report opens with."""
    trial = campaign.trials[0]
    return judge(trial, trial.estimates[0])


def _percent(share: float) -> str:
    """A share in percent, in plain text."""
    return percent(share).replace(NARROW, " ")


def _chance(p: float) -> str:
    """A p-value after the letter p."""
    return probability(p) if p < ALARM else f"= {probability(p)}"
