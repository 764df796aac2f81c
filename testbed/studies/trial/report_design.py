"""The report's sections on pose sets (pool, indices, searches) and on what they can identify."""

from collections.abc import Sequence

import numpy as np

from calib.information.observability import CRITERIA
from testbed.report.page import Block, Figure, Points, Section, Table, Text, heads, rejection_table
from testbed.studies.trial import plots
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import set_in_words
from testbed.studies.trial.report_rounds import round_tables
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets
from testbed.units import counted, micrometres, sentence, significant


def index_table(campaign: Campaign) -> Table:
    """Observability indices of every trial's set, in two kinds of rows; of many, in one."""
    rows = []
    few = len(campaign.trials) <= plots.MOST_PANELS
    scenario = campaign.scenario
    poses = scenario.tracker.measures == "pose" and scenario.fixtures is None and few
    for trial in campaign.trials:
        kinds = [("whitened, L = 0.3 m", trial.whitened_observability, "per_pose")]
        if poses:
            # the paper's twelve rows exist for full poses only
            kinds = [
                ("12 rows, mm, rad", trial.observability, "printed"),
                ("", trial.observability, "per_pose"),
                *kinds,
            ]
        for k, (name, seen, form) in enumerate(kinds):
            values = (significant(getattr(getattr(seen, form), c), 3) for c in CRITERIA)
            head = (trial.name, set_in_words(trial)) if k == 0 else ("", "")
            rows.append((*head, name, form.replace("_", " "), *values))
    return Table(
        caption="Observability indices; larger is better, except for the printed O5",
        head=("trial", "pose set", "rows and units", "form", "O1", "O2", "O3", "O4", "O5"),
        rows=tuple(rows),
        align="llllrrrrr",
        size="small",
        note=("" if few else "Whitened rows only, per pose: there are many trials. ")
        + "Every index but O1 depends on the units of rows and columns: compare only within one "
        "kind of rows. 12 rows: of the robot's set wen2022 where it has one; whitened: of the "
        "numbers the default estimator keeps. printed: eq. (6) of the paper. per pose: O3, O4, O5 "
        "divided by the root of "
        "the number of poses, O5 as the reciprocal of the printed sum.",
    )


def design_section(campaign: Campaign) -> Section:
    """Pool, indices, searches, random sets, number of poses."""
    setting = campaign.setting
    drawn = rejection_table(
        setting.n_drawn, setting.rejection_names, setting.rejection_counts, len(setting.pool_q)
    )
    blocks: list[Block] = [
        drawn,
        Figure(
            "The pool (gray) and the chosen poses: designed sets as blue dots, random sets as "
            f"vermilion triangles{plots.only(campaign.trials, plots.MOST_VIEWS)}.",
            plots.pose_space(campaign),
        ),
        *round_tables(campaign),
        index_table(campaign),
    ]
    searched = [t for t in campaign.trials if t.method == "detmax"]
    if searched:
        blocks.append(
            Figure(
                "DETMAX: the best index known after each local search"
                f"{plots.only(searched, plots.MOST_VIEWS)}.",
                plots.search_convergence(searched),
            )
        )
    if campaign.random_sets:
        few = len(campaign.random_sets) <= plots.MOST_VIEWS
        said = Text(" ".join(beaten(one) for one in campaign.random_sets))
        blocks.append(said if few else beaten_table(campaign.random_sets))
        blocks.append(
            Figure(
                "The figure of each designed set (line) beside "
                f"{len(campaign.random_sets[0].values)}"
                f" random sets of the same size (histogram)"
                f"{plots.only(campaign.random_sets, plots.MOST_VIEWS)}.",
                plots.random_sets(campaign.random_sets),
            )
        )
    if campaign.pose_count is not None:
        blocks += [
            Text(settling(campaign.pose_count)),
            Figure(
                "Observability index of random sets against the number of poses (rows in mm and "
                "rad); the dashed line is where the rule stops.",
                plots.pose_count(campaign.pose_count),
            ),
        ]
    return Section("poses", "Pose sets", tuple(blocks))


def beaten(one: RandomSets) -> str:
    """How many random sets a designed set beats in its own figure."""
    all_of_them = "all" if one.beaten == len(one.values) else str(one.beaten) + " of"
    own, mean, best = figures(one)
    side = "above" if one.larger_is_better else "below"
    return (
        f"{one.trial} ({counted(one.n_poses, 'pose')}) beats {all_of_them} {len(one.values)} "
        f"random sets in its own {'index' if one.unit == '1' else 'uncertainty'}: {one.criterion} "
        f"= {own} against a mean of {mean} and a best of {best}, "
        f"{significant(ahead(one), 2)} standard deviations {side} the mean."
    )


def beaten_table(sets: Sequence[RandomSets]) -> Table:
    """The same of many sets."""
    rows = [
        (
            one.trial,
            one.criterion,
            *figures(one),
            f"{one.beaten} of {len(one.values)}",
            significant(ahead(one), 2),
        )
        for one in sets
    ]
    return Table(
        caption="Each designed set beside random sets of the same size, in its own figure",
        head=heads("trial, criterion, this set, random: mean, best, beaten, ahead by sd"),
        rows=tuple(rows),
        align="llrrrrr",
        note="D (O1), E (O3), O2, O4, O5: an index, larger is better. A, V, G: a standard "
        "uncertainty, smaller is better. ahead by sd: distance from the mean of the random sets in "
        "their standard deviations, positive if this set is better.",
    )


def figures(one: RandomSets) -> tuple[str, ...]:
    """Figure of the set, and the mean and the best of the random ones."""
    return tuple(figure(one.unit, v) for v in (one.chosen_value, one.mean, one.best))


def figure(unit: str, value: float) -> str:
    """Figure of a criterion with its unit; lengths in um."""
    return f"{micrometres(value, 4)} µm" if unit == "m" else significant(value, 4)


def ahead(one: RandomSets) -> float:
    """How many standard deviations a set is better than the mean of random sets."""
    spread = float(one.values.std(ddof=1))
    # a set as large as the pool has no rivals: all values are equal
    sign = 1.0 if one.larger_is_better else -1.0
    return sign * (one.chosen_value - one.mean) / spread if spread > 0 else 0.0


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
        "The rule stops at the first number of poses where the mean of the next ten values differs "
        f"by less than 0.5 % from that of the previous ten: {', '.join(stops)}. From "
        f"{study.counts[k]} to {last} poses the printed indices change by the factors {names}."
    )


def identifiable_section(campaign: Campaign) -> Section:
    """What the measurements can tell apart, in words."""
    trial = campaign.trials[0]
    blocks: list[Block] = []
    for estimate in trial.estimates:
        found = estimate.identification.reduction
        free = len(found.kept) + len(found.dropped)
        fixed_count = len(estimate.identification.parameters.names) - free
        text = (
            f"{plots.NAMES[estimate.mode].capitalize()}: {counted(free, 'number')} free, "
            f"{fixed_count} held at their nominal values; rank {found.rank} (singular values above "
            f"{found.tolerance:.0e} of the largest count), condition "
            f"{significant(found.condition, 3)} of the kept columns. "
        )
        text += (
            "All free numbers can be told apart."
            if not found.dropped
            else f"{counted(len(found.dropped), 'number')} cannot be told from others and "
            f"{'is' if len(found.dropped) == 1 else 'are'} left nominal:"
        )
        blocks.append(Text(text))
        if found.sentences:
            blocks.append(Points(found.sentences))
        extra = estimate.identification.notes[len(found.sentences) :]
        if extra:
            blocks.append(Points(tuple(map(sentence, extra))))
    return Section("identifiable", "What can be identified", tuple(blocks))
