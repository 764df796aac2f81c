"""The report's sections on pose sets (pool, indices, searches) and on what they can identify."""

from collections.abc import Sequence

import numpy as np

from calib.identification.fit_statistics import chi_square_notes
from calib.information.observability import CRITERIA
from testbed.report.apart import left_nominal
from testbed.report.page import Block, Figure, Points, Section, Table, heads, printed, rejections
from testbed.studies.trial import plots
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import set_in_words
from testbed.studies.trial.report_rounds import round_tables
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets
from testbed.units import NARROW, counted, micrometres, sentence, significant, typeset

ROWS = {
    "paper": "paper: twelve rows, mm and rad.",
    "whitened": "whitened: of the numbers that the default estimator keeps, L = 0.3 m.",
}
"""Kinds of rows, within which alone indices are compared."""


def index_table(campaign: Campaign) -> Table:
    """Observability indices of every trial's set, per pose, in the rows that sets were chosen by.

    The paper's twelve rows exist for full poses only.
    """
    scenario, many = campaign.scenario, len(campaign.trials) > plots.MOST_PANELS
    poses = scenario.tracker.measures == "pose" and scenario.fixtures is None and not many
    chosen = {trial.rows for trial in campaign.trials if trial.method != "random"}
    rows = []
    for trial in campaign.trials:
        kinds = [("paper", trial.observability)] if poses and "paper" in chosen else []
        if "whitened" in chosen or not kinds:
            kinds.append(("whitened", trial.whitened_observability))
        for k, (name, seen) in enumerate(kinds):
            values = (significant(getattr(seen.per_pose, c), 3) for c in CRITERIA)
            head = f"{trial.name}, {set_in_words(trial)}" if k == 0 else ""
            rows.append((head, name, *values))
    return Table(
        caption="Observability indices per pose; larger is better",
        head=("set", "rows", "O1", "O2", "O3", "O4", "O5"),
        rows=tuple(rows),
        align="llrrrrr",
        size="small",
        on_paper=printed(len(rows)),
        note=f"{' '.join(text for kind, text in ROWS.items() if any(kind in row for row in rows))} "
        "O3 to O5 are divided by the root of the number of poses; O5 is the reciprocal of the "
        "printed sum.",
    )


def design_section(campaign: Campaign) -> Section:
    """Pool, indices, random sets, number of poses, and what they can identify."""
    setting = campaign.setting
    counts = (setting.n_drawn, setting.rejection_names, setting.rejection_counts)
    said = [rejections(*counts, len(setting.pool_q))]
    few = len(campaign.random_sets) <= plots.MOST_VIEWS
    if few:
        said += [beaten(one) for one in campaign.random_sets]
    if campaign.pose_count is not None:
        said.append(settling(campaign.pose_count))
    blocks: list[Block] = [
        Points(tuple(said)),
        Figure(
            "The pool (gray) and the chosen poses. Blue dots: designed sets. Vermilion triangles: "
            f"random sets{plots.only(campaign.trials, plots.MOST_VIEWS)}.",
            plots.pose_space(campaign),
            "half" if len(campaign.trials) == 1 else "full",
        ),
        *round_tables(campaign),
        index_table(campaign),
    ]
    if not few:
        blocks.append(beaten_table(campaign.random_sets))
    # where all random sets were calibrated, a figure shows their indices beside their errors
    if campaign.random_sets and not campaign.scenario.studies.paper_budget:
        blocks.append(
            Figure(
                f"{campaign.random_sets[0].drawn} random sets of the same size (histogram) "
                "and the designed one (line)"
                f"{plots.only(campaign.random_sets, plots.MOST_VIEWS)}.",
                plots.random_sets(campaign.random_sets),
            )
        )
    if campaign.pose_count is not None:
        text = "Index of random sets against their size (rows in mm and rad)."
        blocks.append(Figure(text, plots.pose_count(campaign.pose_count)))
    return Section(
        "poses", "Poses, and what they can identify", (*blocks, *identifiable_blocks(campaign))
    )


def beaten(one: RandomSets) -> str:
    """How many random sets a designed set beats in its own figure."""
    all_of_them = "all" if one.beaten == one.drawn else str(one.beaten) + " of"
    own, mean, best = figures(one)
    side = "above" if one.larger_is_better else "below"
    if not len(one.values):
        return (
            f"{one.trial} ({counted(one.n_poses, 'pose')}) determines all numbers, as none of "
            f"{one.drawn} random sets does: {one.criterion} = {own}."
        )
    theirs = f"theirs: mean {mean}, best {best}"
    if one.undetermined:
        theirs += f", but for {one.undetermined} that leave a number undetermined"
    return (
        f"{one.trial} ({counted(one.n_poses, 'pose')}) beats {all_of_them} {one.drawn} "
        f"random sets in its own {'index' if one.unit == '1' else 'uncertainty'}, {one.criterion} "
        f"= {own}; {theirs}. It is {significant(ahead(one), 2)} standard deviations {side} "
        "their mean."
    )


def beaten_table(sets: Sequence[RandomSets]) -> Table:
    """The same of many sets."""
    rows = [
        (
            one.trial,
            one.criterion,
            *figures(one),
            f"{one.beaten} of {one.drawn}",
            significant(ahead(one), 2),
        )
        for one in sets
    ]
    return Table(
        caption="Each designed set against random sets of the same size, by its own criterion",
        head=heads("trial, criterion, this set, random: mean, best, beaten, ahead by sd"),
        rows=tuple(rows),
        align="llrrrrr",
        on_paper=printed(len(rows)),
        note="D (O1), E (O3), O2, O4, O5: an index, larger is better. A, V, G: a standard "
        "uncertainty, smaller is better. ahead by sd: distance from the mean of the random sets in "
        "their standard deviations, positive if this set is better.",
    )


def figures(one: RandomSets) -> tuple[str, ...]:
    """Figure of the set, and the mean and the best of the random ones."""
    values = (one.chosen_value, one.mean, one.best)
    return tuple("-" if v is None else figure(one.unit, v) for v in values)


def figure(unit: str, value: float) -> str:
    """Figure of a criterion with its unit; lengths in um."""
    return f"{micrometres(value, 4)} µm" if unit == "m" else significant(value, 4)


def ahead(one: RandomSets) -> float:
    """How many standard deviations a set is better than the mean of random sets."""
    # a set as large as the pool has no rivals: all values are equal
    if one.mean is None or np.ptp(one.values) == 0:
        return 0.0
    sign = 1.0 if one.larger_is_better else -1.0
    return sign * (one.chosen_value - one.mean) / float(one.values.std(ddof=1))


def settling(study: PoseCountStudy) -> str:
    """What the pose-count rule chose."""
    first, second = study.chosen
    k = int(np.flatnonzero(study.counts >= (first or study.counts[len(study.counts) // 2]))[0])
    last = study.counts[-1]
    names = ", ".join(
        f"{name} {significant(float(study.mean[i, -1] / study.mean[i, k]), 3)}"
        for i, name in enumerate(study.names)
    )
    stops = [
        f"{counted(chosen, 'pose')} for {name}"
        if chosen is not None
        else f"nowhere up to {last} poses for {name}"
        for name, chosen in (("O1", first), ("O2", second))
    ]
    return (
        f"The paper's rule (means of ten values differ by less than 0.5{NARROW}%) stops at "
        f"{', '.join(stops)}; from {study.counts[k]} to {last} poses the printed indices change by "
        f"the factors {names}."
    )


def identifiable_blocks(campaign: Campaign) -> tuple[Block, ...]:
    """What the measurements can tell apart, in words."""
    said: list[str] = []
    for estimate in campaign.trials[0].estimates:
        fit = estimate.identification
        found, name = fit.reduction, plots.NAMES[estimate.mode].capitalize()
        free = len(found.kept) + len(found.dropped)
        said.append(
            f"{name}: {counted(free, 'number')} free, {len(fit.parameters.names) - free} held; "
            f"rank {found.rank}, condition {significant(found.condition, 3)}."
        )
        said += left_nominal(found)
        # that of chi-square is among the reasons of the verdict
        smaller = fit.loss == "squared"
        said_there = chi_square_notes(
            fit.chi_square, fit.dof_effective, fit.p_value, smaller=smaller
        )
        said += [sentence(note) for note in fit.notes_of_fit if note not in said_there]
    return (Points(tuple(map(typeset, said))),)
