"""The report on the tool point: the paper's |P| beside three dimensions, and its clouds."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from calib.information.propagation import point_uncertainty
from testbed.report.page import Block, Figure, Section, Table, Text
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.cloud.draws import Cloud, clouds_of, ranges_of
from testbed.studies.wen2022.cloud.plots import zero_pose_clouds
from testbed.studies.wen2022.records import OURS_BEST, ToolPointStudy, tool_point_of
from testbed.studies.wen2022.summary import reexamination_of
from testbed.units import MM, fixed, percent


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
    apart = float(np.abs(drawn / closed - 1).max())
    for trial, u in zip(study.trials, closed, strict=True):
        label = f"{trial}, full covariance"
        rows.append((label, NONE, NONE, fixed(u[0], 4), NONE, NONE, fixed(u[1:].mean(), 4)))
    return Table(
        caption="Standard uncertainty of the tool point [mm]",
        head=(
            *("uncertainties from", "zero pose |P|, printed", "|P|, ours", "3-D, ours"),
            *("held-out mean |P|, printed", "|P|, ours", "3-D, ours"),
        ),
        rows=tuple(rows),
        size="small",
        note=f"{study.draws} draws. |P|: distance of the tool point to the base, which sees the "
        "radial part alone. Independent draws ignore correlations and inflate the spread. Full "
        f"covariance: linear; Monte Carlo differs by at most {percent(apart)}.",
    )


def of_set(study: ToolPointStudy, source: str) -> str:
    """A source of uncertainties with the set behind it."""
    return f"{source} ({study.trials[0]})" if source == OURS_BEST else source


def inflation(study: ToolPointStudy, campaign: Campaign) -> str:
    """How much smaller |P| and how much larger independent draws make u, in one campaign."""
    said = []
    for k, source in enumerate(study.source):
        if source in (paper.TABLE3_BEST, OURS_BEST):
            ratio = study.spatial[k, 0] / study.distance_sd[k, 0]
            said.append(f"{fixed(float(ratio), 1)} times ({of_set(study, source)})")
    text = (
        "The paper draws independent numbers and evaluates |P|; at the zero pose the same draws "
        f"scatter {' and '.join(said)} as much in three dimensions. "
        if said
        else ""
    )
    trial = next(t for t in campaign.trials if t.name == study.trials[0])
    u = point_uncertainty(trial.estimates[0].comparison.covariance).mean() * MM
    return text + (
        f"By the full covariance {study.trials[0]} has a mean u of {fixed(float(u), 4)} mm over "
        "the held-out poses, from noise alone."
    )


def tool_section(campaign: Campaign) -> Section | None:
    """The tool-point study."""
    study = tool_point_of(campaign)
    if study is None:
        return None
    clouds = clouds_of(campaign)
    blocks: list[Block] = [Text(inflation(study, campaign)), tool_table(study)]
    if clouds:
        ours = f"; ours of {study.trials[0]}" if len(clouds) > 1 else ""
        caption = (
            "The paper's Figure 7 again: tool point at the zero pose, from nominal, by independent "
            f"draws (dots) and their range (boxes){ours}. {ranges(clouds)}"
        )
        size: Literal["full", "half"] = "half" if len(clouds) == 1 else "full"
        blocks.append(Figure(caption, zero_pose_clouds(clouds), size))
    many = reexamination_of(campaign) is not None
    return Section(
        "tool", "Uncertainty of the tool point", tuple(blocks), part="detail", on_paper=not many
    )


def ranges(clouds: Mapping[str, tuple[Cloud, Cloud]]) -> str:
    """Number of ranges that are as wide as expected from the number of draws, in words."""
    found = ranges_of(clouds)
    good = sum(one.good for one in found)
    printed = ", the one printed range in our sources among them" * any(
        one.printed and one.good for one in found
    )
    return (
        f"{good} of {len(found)} ranges are as wide as linear propagation predicts for so many "
        f"draws{printed}."
    )
