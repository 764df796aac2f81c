"""A trial in the recording: error arrows, the summary, and the words of every phase."""

from dataclasses import dataclass

import numpy as np

from calib.measurement.accuracy import seen_minus_predicted, target_points
from calib.uncertainty.regions import ellipsoid
from testbed.recording.pen import AFTER_COLOR, ARROW_SIZE, BEFORE_COLOR, Writer, first, viridis
from testbed.recording.story import PhaseName, Story, growing, nice_factor
from testbed.report.page import SIMULATED
from testbed.robots.placements import quaternion_wxyz
from testbed.studies.compensation import recording as recording_compensation
from testbed.studies.coverage import recording as recording_coverage
from testbed.studies.trial.records import Campaign

REGION_SIZE = 0.07
"""Longest drawn error or semi-axis of a stated region [m]."""
INSIDE_COLOR, OUTSIDE_COLOR = (66, 112, 214, 120), (238, 136, 28, 150)


@dataclass(frozen=True, slots=True)
class Factors:
    """How many times larger than life things are drawn."""

    arrows: int
    regions: int


def factors(story: Story) -> Factors:
    """Exaggerations that keep the largest drawn thing below its size."""
    judged = story.estimate.comparison
    _, seen = seen_minus_predicted(story.setting.nominal, story.trial.measurements)
    before = max(float(judged.before.max()), float(np.linalg.norm(seen, axis=1).max()))
    axes, _ = ellipsoid(judged.covariance[:, :3, :3])
    return Factors(
        arrows=nice_factor(ARROW_SIZE, before),
        regions=nice_factor(REGION_SIZE, max(float(judged.after.max()), float(axes.max()))),
    )


def draw_measured(writer: Writer, factor: int) -> None:
    """What the tracker has seen so far, and its distance from the nominal prediction."""
    import rerun as rr

    story = writer.story
    phase, end = story.phase("measure"), story.phase("identify").stop
    points, vectors = seen_minus_predicted(story.setting.nominal, story.trial.measurements)
    size = np.linalg.norm(vectors, axis=1)
    lengths = growing(len(points))
    cloud, arrows = "world/measured", f"world/error_nominal_x{factor}"
    writer.rows(
        cloud,
        phase,
        rr.Points3D.columns(
            positions=first(points, lengths), colors=first(viridis(size, size.max()), lengths)
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(cloud, rr.Points3D.from_fields(radii=0.012))
    writer.rows(
        arrows,
        phase,
        rr.Arrows3D.columns(
            origins=first(points, lengths), vectors=first(factor * vectors, lengths)
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(arrows, rr.Arrows3D.from_fields(radii=0.0032, colors=BEFORE_COLOR))
    writer.clear(end, [cloud, arrows])


def draw_held_out(writer: Writer, factor: Factors) -> None:
    """Held-out poses: true minus nominal, true minus identified, and the stated 95 % regions.

    Before and after share one factor. Regions have a larger one, and so have the errors drawn from
    their centers: an arrow ends inside its ellipsoid exactly where the record says so.
    """
    import rerun as rr

    story = writer.story
    judged, setting = story.estimate.comparison, story.setting
    phase = story.phase("evaluate")
    true = target_points(setting.test_true, setting.target)
    nominal = target_points(setting.nominal.poses(setting.test_q), setting.target)
    stated = true - judged.error
    axes, turn = ellipsoid(judged.covariance[:, :3, :3])
    lengths = growing(len(true))
    arrows = {
        f"world/held_out/before_x{factor.arrows}": (nominal, factor.arrows, BEFORE_COLOR, 0.0024),
        f"world/held_out/after_x{factor.arrows}": (stated, factor.arrows, AFTER_COLOR, 0.004),
        f"world/held_out/after_x{factor.regions}": (stated, factor.regions, (30, 40, 90), 0.002),
    }
    for path, (origin, times, color, radius) in arrows.items():
        writer.rows(
            path,
            phase,
            rr.Arrows3D.columns(
                origins=first(origin, lengths), vectors=first(times * (true - origin), lengths)
            ).partition(lengths),
            lengths - 1,
        )
        writer.static(path, rr.Arrows3D.from_fields(radii=radius, colors=color))
    path = f"world/held_out/region_95_x{factor.regions}"
    colors = np.where(judged.inside[:, None], INSIDE_COLOR, OUTSIDE_COLOR).astype(np.uint8)
    writer.rows(
        path,
        phase,
        rr.Ellipsoids3D.columns(
            centers=first(stated, lengths),
            half_sizes=first(factor.regions * axes, lengths),
            quaternions=first(quaternion_wxyz(turn)[:, [1, 2, 3, 0]], lengths),
            colors=first(colors, lengths),
        ).partition(lengths),
        lengths - 1,
    )
    writer.static(path, rr.Ellipsoids3D.from_fields(fill_mode="solid"))
    if any(later.name == "compensate" for later in story.phases):
        writer.clear(phase.stop, [*arrows, path])


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
