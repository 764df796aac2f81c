"""The headline table, and the sections on accuracy and on intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.measurement.accuracy import Accuracy
from testbed.report.page import Block, Figure, Section, Table, heads, printed
from testbed.report.svg import on_phone
from testbed.studies.trial import plots
from testbed.studies.trial.records import Campaign, Estimate, Replications, Trial
from testbed.studies.trial.statement.report import statement_blocks
from testbed.studies.trial.verdict import judge, tested
from testbed.units import DEG, MM, counted, decimals, fixed, listed, percent, significant

NONE = "–"
SHORT = {"whitened": "default", "paper": "paper"}
"""Estimators in the columns of tables."""
PAPER = (
    " default: weighted rows, all distinguishable numbers. paper: 24 numbers, base and tool "
    "assumed known, unweighted rows; u is what that fit claims."
)
"""What the two estimators are."""
NAMED = 3
"""Numbers named in a cell."""
CLEARLY = 1.05
"""Ratio of two mean errors from which one is called smaller: fifty poses tell hardly less."""


def headline_table(campaign: Campaign) -> Table:
    """One row per trial and estimator: errors on held-out poses and what was stated of them."""
    first = campaign.trials[0].estimates[0].comparison
    found = [first.accuracy_before]
    found += [estimate.comparison.accuracy_after for _, estimate in campaign.estimates]
    places = max(decimals(min(one.mean for one in found) * MM, 2), 1)
    # one reflector does not see the tool's rotation about itself
    turns = campaign.scenario.tracker.measures == "pose"
    turned = [significant(float(first.rotation_before.mean() * DEG), 2)] * turns
    start = _statistics(first.accuracy_before, places)
    rows = [("nominal model", "", "", *start, *turned, *[NONE] * 4)]
    for trial, estimate in campaign.estimates:
        fit, seen = estimate.identification, estimate.comparison
        turned = [significant(float(seen.rotation_after.mean() * DEG), 2)] * turns
        verdict = judge(trial, estimate)
        rows.append(
            (
                trial.name if estimate is trial.estimates[0] else "",
                SHORT[estimate.mode],
                str(len(trial.selection.indices)) if estimate is trial.estimates[0] else "",
                *_statistics(seen.accuracy_after, places),
                *turned,
                fixed(estimate.stated_u * MM, places),
                percent(float(estimate.inside.mean())),
                significant(fit.chi_square / fit.dof, 3) if tested(fit) else NONE,
                "yes" if verdict.believable else "NO" if verdict.contradicted else "?",
            )
        )
    rotation = "rotation deg, " * turns
    by_paper = any(estimate.mode == "paper" for _, estimate in campaign.estimates)
    return Table(
        caption=f"Tool position error on {counted(len(first.before), 'held-out pose')} against the "
        "noise-free truth, and the uncertainty that is stated",
        head=heads(
            f"trial, estimator, poses, mean mm, p95 mm, max mm, {rotation}u mm, "
            "inside 95 %, χ²/dof, believable"
        ),
        rows=tuple(rows),
        align="ll" + "r" * (len(rows[0]) - 3) + "l",
        strong=(1,),
        on_paper=printed(len(rows)),
        note="u: believed u of the mean tool point (3-D, k = 1). inside: share of true points in "
        "the 95 % region. χ²/dof: residuals against the stated noise." + PAPER * by_paper,
    )


def accuracy_is_not_belief(campaign: Campaign) -> str:
    """Why an estimate whose statement is refuted may come closer than a believed one beside it.

    Nothing where no trial has such a pair.
    """
    for trial in campaign.trials:
        found = [(judge(trial, estimate), estimate) for estimate in trial.estimates]
        believed = [estimate for verdict, estimate in found if verdict.believable]
        for verdict, one in found:
            mean = one.comparison.accuracy_after.mean
            clearly = CLEARLY * mean
            worse = [e for e in believed if e.comparison.accuracy_after.mean > clearly]
            if verdict.contradicted and worse:
                other = worse[0].comparison.accuracy_after.mean
                held = float(one.inside.mean())
                share = f"only {percent(held)}" if held else "none"
                return (
                    f"With {trial.name} the {SHORT[one.mode]} estimator has the smaller mean error "
                    f"({mean * MM:.4f} against {other * MM:.4f} mm), but its 95 % regions contain "
                    f"{share} of the true points."
                )
    return ""


def _statistics(error: Accuracy, places: int) -> tuple[str, ...]:
    """Mean, p95 and maximum in mm."""
    values = (error.mean, error.p95, error.maximum)
    return tuple(fixed(value * MM, places) for value in values)


def set_in_words(trial: Trial) -> str:
    """How many poses and how they were chosen."""
    number = counted(len(trial.selection.indices), "pose")
    method = trial.method.replace("_", " ")
    return f"{number}, {method if method == 'random' else f'{method} {trial.selection.criterion}'}"


def accuracy_section(campaign: Campaign, every_trial: Table | None = None) -> Section | None:
    """Held-out errors before and after, and `every_trial` if not said before."""
    others = campaign.trials[1 if every_trial is None else 0 :]
    blocks: list[Block] = [] if every_trial is None else [every_trial]
    if others:
        # print leaves the figure out where a table has the means, p95 and largest of all
        blocks.append(replace(distributions(others), on_paper=every_trial is None))
    return Section("accuracy", "Errors before and after", tuple(blocks)) if blocks else None


def distributions(trials: Sequence[Trial]) -> Figure:
    """Held-out errors before and after."""
    return Figure(
        f"{listed([trial.name for trial in trials[: plots.MOST_PANELS]])}: share of held-out poses "
        f"with a tool point error up to each size{plots.only(trials)}.",
        plots.error_distributions(trials[: plots.MOST_PANELS]),
        phone=on_phone(plots.error_distributions, trials) if len(trials) == 1 else "",
    )


def belief_section(campaign: Campaign) -> Section:
    """What is stated, why, and whether the stated intervals hold the truth."""
    return Section(
        "believe",
        "Uncertainty, and whether it holds",
        (*statement_blocks(campaign), truth_table(campaign)),
    )


def truth_table(campaign: Campaign) -> Table:
    """Intervals and regions of every estimate against the truth."""
    rows = [_belief_row(trial, estimate) for trial, estimate in campaign.estimates]
    played = [e.replications for _, e in campaign.estimates if e.replications is not None]
    runs = f" and in {played[0].count} replications" if played else ""
    head = "trial, estimator, points inside, numbers inside"
    if played:
        head += ", NEES / rank, tool coverage, believed: tool coverage, intervals too narrow"
    rows = [row if played else row[:4] for row in rows]
    return Table(
        caption=f"95 % statements against the truth, in this calibration{runs}",
        head=heads(head),
        rows=tuple(rows),
        align="llrrrrrl"[: len(rows[0])],
        size="small",
        on_paper=printed(len(rows)),
        note="From the covariance of the fit alone, except believed. NEES / rank: 1 is expected. "
        "too narrow: numbers whose intervals contained the truth less often than in 999 of 1000 "
        "honest studies; the worst are named.",
    )


def _belief_row(trial: Trial, estimate: Estimate) -> tuple[str, ...]:
    """One row of the table of intervals."""
    seen, played, judged = estimate.comparison, estimate.replications, estimate.judged
    inside = (seen.inside, seen.parameter_inside[judged])
    held = (f"{int(hits.sum())} of {len(hits)}" for hits in inside)
    here = (trial.name, SHORT[estimate.mode], *held)
    if played is None:
        return (*here, *[NONE] * 4)
    return (
        *here,
        significant(float(played.nees.mean()) / len(judged), 3),
        percent(float(played.tool_coverage.mean())),
        NONE if played.region_coverage is None else percent(float(played.region_coverage.mean())),
        too_narrow(estimate.identification.names, played),
    )


def too_narrow(names: Sequence[str], played: Replications) -> str:
    """How many intervals held the truth too rarely, the worst of them by name."""
    covered, (low, high) = played.parameter_coverage, played.coverage_band
    worst = [names[i] for i in np.argsort(covered, kind="stable") if covered[i] < low]
    above = int((covered > high).sum())
    said = f"{len(worst)} of {len(covered)}" if worst else "none"
    if worst:
        said += f": {', '.join(worst[:NAMED])}{', …' if len(worst) > NAMED else ''}"
    return f"{said}; {above} too wide" if above else said
