"""The report on the tool point: the paper's |P| beside three dimensions, and its clouds."""

from collections.abc import Mapping

import numpy as np

from calib.information.propagation import point_uncertainty
from testbed.report.page import Block, Figure, Section, Table, Text
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.wen2022 import paper, plots
from testbed.studies.wen2022.cloud.draws import Cloud, clouds_of
from testbed.studies.wen2022.cloud.plots import zero_pose_clouds
from testbed.studies.wen2022.records import OURS_BEST, ToolPointStudy, tool_point_of
from testbed.studies.wen2022.tables import range_table
from testbed.units import MM, fixed


def tool_table(study: ToolPointStudy) -> Table:
    """Uncertainty of the tool point: the paper's |P| beside three dimensions."""
    printed = {
        paper.TABLE3_BEST: (paper.U_ZERO_BEST_MM, paper.U_MEAN_BEST_MM),
        paper.TABLE3_RANDOM: (paper.U_ZERO_RANDOM_MM, paper.U_MEAN_RANDOM_MM),
    }
    rows = []
    for source, distance, spatial in zip(
        study.source, study.distance_sd, study.spatial, strict=True
    ):
        zero, mean = [fixed(mm, 4) for mm in printed.get(source, ())] or [NONE, NONE]
        at_zero = (zero, fixed(distance[0] * MM, 5), fixed(spatial[0] * MM, 4))
        held_out = (fixed(u[1:].mean() * MM, 4) for u in (distance, spatial))
        rows.append((f"{of_set(study, source)}, independent draws", *at_zero, mean, *held_out))
    drawn, closed = (
        np.sqrt(np.trace(C, axis1=2, axis2=3)) * MM for C in (study.covariance, study.linear)
    )
    for trial, mc, linear in zip(study.trials, drawn, closed, strict=True):
        for name, u in (("Monte Carlo", mc), ("linear", linear)):
            label = f"{trial}, full covariance, {name}"
            rows.append((label, NONE, NONE, fixed(u[0], 4), NONE, NONE, fixed(u[1:].mean(), 4)))
    return Table(
        caption="Standard uncertainty of the tool point [mm]",
        head=(
            *("uncertainties from", "zero pose |P|, printed", "|P|, ours", "3-D, ours"),
            *("held-out mean |P|, printed", "|P|, ours", "3-D, ours"),
        ),
        rows=tuple(rows),
        size="small",
        note=f"{study.draws} draws. |P| is the distance of the tool point to the base: it sees "
        "only the radial part of the error. Independent draws ignore the correlations of the "
        "parameters and inflate the spread; the full covariance keeps them.",
    )


def of_set(study: ToolPointStudy, source: str) -> str:
    """A source of uncertainties with the set behind it."""
    return f"{source} ({study.trials[0]})" if source == OURS_BEST else source


def inflation(study: ToolPointStudy, campaign: Campaign) -> str:
    """How much |P| hides and how much independent draws inflate, in one campaign."""
    said = []
    for k, source in enumerate(study.source):
        if source in (paper.TABLE3_BEST, OURS_BEST):
            ratio = study.spatial[k, 0] / study.distance_sd[k, 0]
            said.append(f"{fixed(float(ratio), 1)} times ({of_set(study, source)})")
    text = (
        "The paper draws independent parameters and looks at |P|. At the zero pose the same draws "
        f"spread in three dimensions {' and '.join(said)} as much as |P| does. "
        if said
        else ""
    )
    trial = next(t for t in campaign.trials if t.name == study.trials[0])
    u = point_uncertainty(trial.estimates[0].comparison.covariance).mean() * MM
    return text + (
        "The correct form draws from the full covariance of the calibration and reports all three "
        f"directions; for {study.trials[0]} it gives a mean u of {fixed(float(u), 4)} mm over the "
        "held-out poses. It is the uncertainty from noise alone: whether the model is right is "
        "another question, answered above."
    )


def tool_section(campaign: Campaign) -> Section | None:
    """The tool-point study."""
    study = tool_point_of(campaign)
    if study is None:
        return None
    blocks: list[Block] = [
        Text(inflation(study, campaign)),
        tool_table(study),
        *cloud_blocks(clouds_of(campaign), study.trials[0]),
        Figure(
            "95 % regions of the tool point at the zero pose, projected on three planes; ours of "
            f"{study.trials[0]}.",
            plots.zero_pose_regions(study),
        ),
    ]
    if study.source:
        caption = (
            "Standard uncertainty at the held-out poses: optimal against random, |P| against three "
            f"dimensions; ours of {study.trials[0]}."
        )
        blocks.append(Figure(caption, plots.held_out_uncertainty(study)))
    return Section("tool", "Uncertainty of the tool point", tuple(blocks), part="detail")


def cloud_blocks(clouds: Mapping[str, tuple[Cloud, Cloud]], trial: str) -> tuple[Block, ...]:
    """The clouds of Figure 7 and their ranges, ours of one trial; nothing where none were drawn."""
    if not clouds:
        return ()
    best, _ = next(iter(clouds.values()))
    caption = (
        "The paper's Figure 7, drawn again: tool point at the zero pose, from nominal, when the "
        "numbers are drawn independently with the uncertainties of each budget. Dots: the first "
        f"{len(best.shown)} of {len(best.points)} draws; boxes: smallest to largest of all. All "
        f"views have one scale; ours of {trial}."
    )
    return Figure(caption, zero_pose_clouds(clouds)), range_table(clouds)
