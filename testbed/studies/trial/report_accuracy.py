"""The headline table, and the sections on accuracy and on intervals."""

import numpy as np

from calib.arrays import Array
from calib.measurement.accuracy import Accuracy
from testbed.report.page import Block, Figure, Points, Section, Table, Text, heads
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.compare import held_by_repeats
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.studies.trial.verdict import judge, tested
from testbed.units import (
    DEG,
    MM,
    counted,
    fixed,
    millimetres,
    percent,
    probability,
    significant,
)

NONE = "–"
SHORT = {"whitened": "default", "paper": "paper"}
"""Estimators in the columns of tables."""
OF_FIT = {"paper": ", covariance of the unweighted fit"}
"""Whose intervals they are, where the paper states others."""


def headline_table(campaign: Campaign) -> Table:
    """One row per trial and estimator: errors on held-out poses and what was stated of them."""
    first = campaign.trials[0].estimates[0].comparison
    rows = [("nominal model", "", "", *_statistics(first.accuracy_before), *[NONE] * 8)]
    for trial in campaign.trials:
        for k, estimate in enumerate(trial.estimates):
            found, seen = estimate.identification, estimate.comparison
            verdict = judge(trial, estimate)
            rows.append(
                (
                    trial.name if k == 0 else "",
                    set_in_words(trial) if k == 0 else "",
                    SHORT[estimate.mode],
                    *_statistics(seen.accuracy_after),
                    millimetres(estimate.stated_u, 2),
                    percent(float(estimate.inside.mean())),
                    significant(found.chi_square / found.dof, 3) if tested(found) else NONE,
                    probability(found.p_value) if tested(found) else NONE,
                    significant(found.reduction.condition, 3),
                    str(found.rank),
                    significant(seen.nees, 3),
                    "yes" if verdict.believable else "NO" if verdict.contradicted else "?",
                )
            )
    return Table(
        caption=f"Tool position error on {counted(len(first.before), 'held-out pose')} against the "
        "noise-free truth, and what is stated of it",
        head=heads(
            "trial, pose set, estimator, mean mm, rms mm, p95 mm, max mm, u mm, "
            "inside 95 %, χ²/dof, p, cond., rank, NEES, believe"
        ),
        rows=tuple(rows),
        align="lllrrrrrrrrrrrl",
        strong=(1,),
        size="small",
        note="mean, rms, p95, max: distance between true and predicted tool point. u: 3-D standard "
        "uncertainty (k = 1) of the mean tool point, root mean square over the held-out poses, as "
        "it is believed: a misfit up to its limit is in it. Of the paper's unweighted rows it is "
        "s² = RSS / (12 m − f) times the inverse normal matrix, which the paper does not state (it "
        "states the scatter of repeats, type A, judged below). inside 95 %: share of held-out "
        "poses whose true tool point lies in the 95 % region (3-D) of that kind. χ²/dof "
        "and p: residuals against the stated noise (p < 0.001 is an alarm). cond.: of the scaled "
        "Jacobian of the kept parameters, each estimator in its own rows. rank: parameters "
        "estimated. NEES: squared parameter error in units of the stated covariance; expected "
        "value = rank, less the numbers that have no true value of their own. default: whitened "
        "rows, all free parameters that can be told apart. paper: 24 parameters with base and "
        "tool taken as known, twelve unweighted rows.",
    )


def _statistics(error: Accuracy) -> tuple[str, ...]:
    """Mean, rms, p95 and maximum in mm."""
    values = (error.mean, error.rms, error.p95, error.maximum)
    return tuple(fixed(value * MM, 4) for value in values)


def set_in_words(trial: Trial) -> str:
    """How many poses and how they were chosen."""
    number = counted(len(trial.selection.indices), "pose")
    method = trial.method.replace("_", " ")
    return f"{number}, {method if method == 'random' else f'{method} {trial.selection.criterion}'}"


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
            *((distributions(campaign),) if len(campaign.trials) > 1 else ()),
            table,
        ),
    )


def distributions(campaign: Campaign, *, first: bool = False) -> Figure:
    """Held-out errors before and after, of the first trial or of all that figures show."""
    trials = campaign.trials[:1] if first else plots.shown(campaign)
    who = campaign.trials[0].name if first else "Every trial"
    return Figure(
        f"{who}: share of the held-out poses whose tool point errs by no more than so much, "
        "against noise-free truth, before and after"
        f"{'' if first else plots.only(campaign.trials)}.",
        plots.error_distributions(trials),
    )


def belief_section(campaign: Campaign) -> Section:
    """Whether the stated intervals hold the truth, estimator by estimator."""
    rows = [_belief_row(campaign, trial, estimate) for trial, estimate in campaign.estimates]
    said = [intervals_in_words(trial, estimate) for trial, estimate in campaign.estimates]
    table = Table(
        caption="95 % intervals and regions against the truth",
        head=heads(
            "trial, estimator, type A: parameters inside, type A: tool points inside, "
            "fit: parameters inside, fit: tool points inside, replications, mean NEES / rank, "
            "honest band, parameter coverage, tool coverage, stated / true sd, "
            "believed: tool coverage"
        ),
        rows=tuple(rows),
        align="llrrrrrrrrrrr",
        size="small",
        note="type A: stated is the scatter of repeated calibrations, with independent numbers, as "
        "in Wen et al. 2022. fit: stated is the covariance of the fit, the parameters alone, for "
        "the paper's estimator that of unweighted rows, which the paper does not state; so are all "
        "columns behind but the last: regions as large as the believed one, about each replicated "
        "point. "
        "parameters and tool points inside: this one calibration (one robot, one noise draw; "
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
    return Section("belief", "What the truth says of intervals and regions", tuple(blocks))


def _belief_row(campaign: Campaign, trial: Trial, estimate: Estimate) -> tuple[str, ...]:
    """One row of the table of intervals."""
    seen, played = estimate.comparison, estimate.replications
    (numbers, points), judged = held_by_repeats(campaign.setting, estimate), estimate.judged
    f = len(judged)
    inside = (numbers[judged], points, seen.parameter_inside[judged], seen.inside)
    held = (f"{int(hits.sum())} of {len(hits)}" for hits in inside)
    here = (trial.name, SHORT[estimate.mode], *held)
    if played is None:
        return (*here, "0", *[NONE] * 6)
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
        NONE if played.region_coverage is None else percent(float(played.region_coverage.mean())),
    )


def span(shares: Array) -> str:
    """The smallest and the largest share."""
    return f"{percent(float(shares.min()))} to {percent(float(shares.max()))}"


def intervals_in_words(trial: Trial, estimate: Estimate) -> str:
    """Whether the intervals of one estimate hold, and which parameters say otherwise."""
    who = f"{trial.name}, {plots.NAMES[estimate.mode]}{OF_FIT.get(estimate.mode, '')}"
    played = estimate.replications
    if played is None:
        share = percent(float(estimate.comparison.inside.mean()))
        return (
            f"{who}: no replications were played; {share} of the held-out points lie inside the "
            "regions of the parameters alone."
        )
    low, high = played.coverage_band
    names, covered = estimate.identification.names, played.parameter_coverage
    worst = np.argsort(covered, kind="stable")
    below = [i for i in worst if covered[i] < low]
    above = int((covered > high).sum())
    nees_low, nees_high = played.nees_band
    honest = nees_low <= played.nees.mean() <= nees_high
    if not below and not above and honest:
        return (
            f"{who}: the intervals of the parameters hold. Every parameter's 95 % interval held "
            f"the truth in {span(covered)} of replications (an honest one stays within "
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
    return f"{who}: the intervals of the parameters fail: {'; '.join(said)}."
