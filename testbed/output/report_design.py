"""The report's section on pose sets: the pool, the indices, the searches, the number of poses."""

import numpy as np

from calib.information.observability import CRITERIA
from testbed.output import plots
from testbed.output.quantities import counted, significant
from testbed.output.report_headline import set_in_words
from testbed.output.report_parts import Block, Figure, Section, Table, Text
from testbed.records import Campaign, PoseCountStudy, RandomSets


def pool_table(campaign: Campaign) -> Table:
    """Candidates that were drawn, refused by reason, and kept."""
    setting = campaign.setting
    counts = [int(count) for count in setting.rejection_counts]
    rows = [("drawn", str(setting.n_drawn), "100 %")]
    share = [f"{100 * count / max(setting.n_drawn, 1):.1f} %" for count in counts]
    rows += [
        (f"refused: {name}", str(count), part)
        for name, count, part in zip(setting.rejection_names, counts, share, strict=True)
    ]
    kept = setting.n_drawn - sum(counts)
    rows.append(("feasible", str(kept), f"{100 * kept / max(setting.n_drawn, 1):.1f} %"))
    size = len(setting.pool_q)
    return Table(
        caption=f"Candidate poses: a pool of {size}",
        head=("candidates", "number", "share"),
        rows=tuple(rows),
        align="lrr",
        note="Each candidate is counted under the first reason that applies. "
        + (f"The first {size} feasible ones are the pool." if kept > size else ""),
    )


def index_table(campaign: Campaign) -> Table:
    """Observability indices of every trial's set, in two kinds of rows."""
    rows = []
    poses = campaign.scenario.tracker.measures == "pose"
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
        note="Every index but O1 depends on the units of rows and columns: compare only within one "
        "kind of rows. printed: eq. (6) of the paper. per pose: O3, O4, O5 divided by the root of "
        "the number of poses, O5 as the reciprocal of the printed sum.",
    )


def design_section(campaign: Campaign) -> Section:
    """Pool, indices, searches, random sets, number of poses."""
    blocks: list[Block] = [
        pool_table(campaign),
        Figure(
            "The pool (gray) and the chosen poses: designed sets as blue dots, random sets as "
            f"vermilion triangles{plots.only(campaign.trials, plots.MOST_VIEWS)}.",
            plots.pose_space(campaign),
        ),
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
        blocks.append(Text(" ".join(beaten(one) for one in campaign.random_sets)))
        blocks.append(
            Figure(
                "The index of each designed set (line) beside "
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
    """How many random sets a designed set beats in its own index."""
    count = int((one.values < one.chosen_value).sum())
    spread = float(one.values.std(ddof=1))
    # a set as large as the pool has no rivals: all values are equal
    above = (one.chosen_value - float(one.values.mean())) / spread if spread > 0 else 0.0
    all_of_them = "all" if count == len(one.values) else str(count) + " of"
    return (
        f"{one.trial} ({counted(one.n_poses, 'pose')}) beats {all_of_them} {len(one.values)} "
        f"random sets in its own index: {one.criterion} = {significant(one.chosen_value, 4)} "
        f"against a mean of {significant(float(one.values.mean()), 4)} and a best of "
        f"{significant(float(one.values.max()), 4)}, {significant(above, 2)} standard "
        "deviations above the mean."
    )


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
