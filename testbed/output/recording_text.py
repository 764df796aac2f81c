"""Texts in a recording: the summary, and in every phase what is on the screen."""

import numpy as np

from testbed.output import recording_compensation, recording_coverage
from testbed.output.recording_errors import Factors
from testbed.output.recording_story import PhaseName, Story
from testbed.output.recording_writer import Writer
from testbed.output.results import SIMULATED
from testbed.records import Campaign

PHASE_COLORS: dict[PhaseName, tuple[int, int, int]] = {
    "select": (128, 104, 98),
    "measure": (52, 128, 196),
    "identify": (58, 140, 72),
    "evaluate": (204, 146, 62),
    "compensate": (24, 140, 140),
    "coverage": (140, 92, 170),
}


def draw_texts(
    writer: Writer, campaign: Campaign, verdict: str, factor: Factors, ghost: int
) -> None:
    """The summary at all times, the explanation of each phase when it begins."""
    import rerun as rr

    markdown = rr.MediaType.MARKDOWN
    writer.static("summary", rr.TextDocument(summary(campaign, verdict), media_type=markdown))
    writer.static(
        "phase",
        rr.StateConfiguration(
            values=[phase.name for phase in writer.story.phases],
            colors=[PHASE_COLORS[phase.name] for phase in writer.story.phases],
        ),
    )
    for phase in writer.story.phases:
        study = recording_compensation.shown(campaign.compensation, campaign.scenario)
        if phase.name == "coverage":
            text = recording_coverage.words(campaign.coverage)
        elif phase.name == "compensate" and study is not None:
            text = recording_compensation.words(study)
        else:
            text = explanation(writer.story, phase.name, factor, ghost)
        writer.at(phase.start, "now", rr.TextDocument(text, media_type=markdown))
        writer.at(phase.start, "phase", rr.StateChange(state=phase.name))


def summary(campaign: Campaign, verdict: str) -> str:
    """Verdict first, then one row per trial and estimator."""
    scenario = campaign.scenario
    lines = [
        f"#### {scenario.title or scenario.name}",
        f"**{SIMULATED}** ({scenario.name}, seed {scenario.seed})",
        "",
        verdict,
        "",
        "| trial | estimator | before | after | 95 % | chi2/dof |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for trial in campaign.trials:
        for estimate in trial.estimates:
            judged, found = estimate.comparison, estimate.identification
            held = f"{int(judged.inside.sum())}/{len(judged.inside)}"
            ratio = found.chi_square / found.dof if found.dof > 0 else np.nan
            lines.append(
                f"| {trial.name} | {estimate.mode} "
                f"| {judged.accuracy_before.mean * 1e3:.3f} "
                f"| {judged.accuracy_after.mean * 1e3:.3f} "
                f"| {held} | {'-' if np.isnan(ratio) else f'{ratio:.2f}'} |"
            )
    lines += [
        "",
        "before, after: mean error on held-out poses [mm]; 95 %: regions that hold the truth",
    ]
    return "\n".join(lines)


def explanation(story: Story, phase: PhaseName, factor: Factors, ghost: int) -> str:
    """What is on the screen in a phase, in a few lines."""
    trial, setting = story.trial, story.setting
    judged, found = story.estimate.comparison, story.estimate.identification
    ghostly = f"- red ghost: the true robot, its deviation drawn {ghost} times"
    if phase == "select":
        lines = [
            f"#### 1 Select: {trial.method}, {trial.selection.criterion}",
            f"- gray: {len(setting.pool_q)} candidate tool positions of {setting.n_drawn} drawn",
            "- pale red: refused inside the box (collision, sight)",
            f"- blue, at the end: the {len(trial.selection.indices)} chosen poses",
            "- the robot leafs through the candidates",
            ghostly,
        ]
    elif phase == "measure":
        lines = [
            "#### 2 Measure",
            f"- the tracker measures {trial.measurements.n_poses} poses",
            "- dots: poses measured, dark to bright with growing error",
            f"- red arrows: seen minus nominal, drawn {factor.arrows} times",
            ghostly,
        ]
    elif phase == "identify":
        lines = [
            f"#### 3 Identify: {story.estimate.mode}",
            f"- {found.parameters.n_free} numbers from {len(found.residual)} equations",
            f"- {found.status.value}",
            "- the ghost closes in on what the model cannot know",
            "- parameters: error over stated uncertainty moves into the gray 95 % band",
        ]
    else:
        count = len(judged.inside)
        lines = [
            f"#### 4 Evaluate: {count} held-out poses",
            f"- red, green: error before and after, both drawn {factor.arrows} times",
            f"- ellipsoids: stated 95 % regions, drawn {factor.regions} times, "
            "with the error as a thin arrow; blue holds the truth, orange does not",
            f"- {int(judged.inside.sum())} of {count} regions hold the truth",
            f"- ghost: what is left of the deviation, drawn {ghost} times",
        ]
    return "\n".join(lines)
