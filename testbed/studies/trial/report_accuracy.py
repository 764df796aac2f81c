"""The report's sections on accuracy before and after, and on whether the intervals hold."""

import numpy as np

from calib.arrays import Array
from testbed.report.page import Block, Figure, Points, Section, Table, Text, heads
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.trial.report import NONE, SHORT
from testbed.units import DEG, fixed, millimetres, percent, significant


def accuracy_section(campaign: Campaign, every_trial: Table | None = None) -> Section:
    """Before and after, on held-out and on calibration poses; `every_trial` if not said before."""
    rows: list[tuple[str, ...]] = []
    # one reflector does not see the tool's rotation about itself
    turns = campaign.scenario.tracker.measures == "pose"
    for trial, estimate in campaign.estimates:
        seen = estimate.comparison
        before, after = seen.accuracy_before.mean, seen.accuracy_after.mean
        lengths = (seen.identification_before.mean, seen.identification_after.mean, before, after)
        angles = (seen.rotation_before, seen.rotation_after)
        rows.append(
            (
                trial.name,
                SHORT[estimate.mode],
                *map(millimetres, lengths),
                significant(float(before / after), 2),
                *(significant(float(a.mean() * DEG), 2) if turns else NONE for a in angles),
            )
        )
    table = Table(
        caption="Mean errors before and after calibration",
        head=heads(
            "trial, estimator, calibration poses before mm, after mm, held-out before mm, "
            "after mm, gain, rotation before deg, after deg"
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
    rows = [_belief_row(trial, estimate) for trial, estimate in campaign.estimates]
    said = [intervals_in_words(trial, estimate) for trial, estimate in campaign.estimates]
    table = Table(
        caption="Stated 95 % intervals and regions against the truth",
        head=heads(
            "trial, estimator, parameters inside, tool points inside, replications, "
            "mean NEES / rank, honest band, parameter coverage, tool coverage, stated / true sd"
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
    blocks: list[Block] = [table, Points(tuple(said[: plots.MOST_PANELS]))]
    if len(said) > plots.MOST_PANELS:
        blocks.append(Text(f"The other {len(said) - plots.MOST_PANELS} are in the table."))
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
    f, inside = len(seen.parameter_inside), (seen.parameter_inside, seen.inside)
    held = (f"{int(hits.sum())} of {len(hits)}" for hits in inside)
    here = (trial.name, SHORT[estimate.mode], *held)
    if played is None:
        return (*here, "0", *[NONE] * 5)
    low, high = played.nees_band / f
    covered = played.parameter_coverage
    return (
        *here,
        str(played.count),
        significant(float(played.nees.mean()) / f, 3),
        f"{low:.2f} to {high:.2f}",
        span(covered),
        percent(float(played.tool_coverage.mean())),
        f"{fixed(float(played.sd_ratio.min()), 2)} to {fixed(float(played.sd_ratio.max()), 2)}",
    )


def span(shares: Array) -> str:
    """The smallest and the largest share."""
    return f"{percent(float(shares.min()))} to {percent(float(shares.max()))}"


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
            f"{span(covered)} of replications (an honest one stays within "
            f"{span(played.coverage_band)})."
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
