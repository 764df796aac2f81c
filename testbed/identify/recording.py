"""A calibration's recording and its words: the summary, and what each phase shows."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import inverse
from testbed.identify.recording_story import (
    MOST_POSES,
    CalibrationPhase,
    CalibrationPhaseName,
    CalibrationStory,
    tell_calibration,
)
from testbed.identify.records import Calibration
from testbed.identify.words import headline_rows, mark, mm, notice, verdict
from testbed.recording.cell import draw_arm, draw_beam, draw_station
from testbed.recording.curves import GREEN, LINE_COLOR, RED, draw_curve, fit
from testbed.recording.layout import FRAMES_PER_SECOND, camera, cell_view, plot_over
from testbed.recording.pen import (
    AFTER_COLOR,
    ARROW_SIZE,
    BEFORE_COLOR,
    Color,
    Pen,
    first,
    open_stream,
    strict_mode,
    viridis,
)
from testbed.recording.story import growing, nice_factor
from testbed.robots.catalog import Robot
from testbed.units import counted

TRACKER_AWAY = 0.8
"""A measuring frame nearer to the base than this [m] is no tracker's own."""
UPRIGHT = np.cos(np.radians(20.0))
"""A tracker stands upright within 20 deg."""
AXIS_LENGTH = 0.12
AXES_COLORS = ((214, 60, 60), (60, 160, 70), (60, 90, 214))
PLOTS: dict[CalibrationPhaseName, str] = {
    "measure": "1 Training poses mm: red before, green after",
    "identify": "2 log10(sum of squares / dof)",
    "evaluate": "3 Held-out mm: red before, green after",
}


def write_calibration_recording(calibration: Calibration, robot: Robot, path: str | Path) -> None:
    """Write a calibration as a Rerun recording, in the base frame of the identified robot.

    Parameters
    ----------
    calibration : Calibration
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        Whose parts are drawn.
    path : path
        File to write, replaced if it is there.

    Raises
    ------
    MachineError
        If the file cannot be written.
    """
    story = tell_calibration(calibration)
    source = calibration.source
    identity = f"{source.name}-calibration-{calibration.split.seed}"
    name = f"{source.name}, calibration of {source.robot}"
    with (
        strict_mode(),
        open_stream(Path(path), identity, name, layout(story, robot.base_offset)) as stream,
    ):
        pen = Pen(stream, story)
        factor = arrow_factor(story)
        draw_texts(pen, factor)
        draw_cell(pen, robot)
        draw_measured(pen, factor)
        draw_judged(pen, factor)
        draw_curves(pen)


def layout(story: CalibrationStory, floor: float) -> Any:
    """Layout of the viewer, embedded in the recording."""
    import rerun.blueprint as rrb

    # without a tracker in sight the arm is looked at from its front
    station = story.station[:3, 3] if has_tracker(story) else np.array([3.0, 0.0, 0.0])
    eye = camera(story.seen, np.zeros(3), station)
    top = rrb.Horizontal(
        cell_view(*eye, floor),
        rrb.Vertical(
            rrb.TextDocumentView(origin="/summary", name="Summary"),
            rrb.TextDocumentView(origin="/now", name="Now"),
            row_shares=[1.5, 1],
        ),
        column_shares=[2.4, 1.3],
    )
    bar = rrb.StateTimelineView(origin="/phase", name="Phase")
    plots = rrb.Horizontal(
        *(plot_over(p.name, PLOTS[p.name], p.start, p.stop) for p in story.phases)
    )
    return rrb.Blueprint(
        rrb.Vertical(top, bar, plots, row_shares=[6.5, 1.05, 2.4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="step", fps=FRAMES_PER_SECOND),
        auto_views=False,
    )


def has_tracker(story: CalibrationStory) -> bool:
    """Whether the measuring frame can be that of a tracker that stands beside the robot."""
    return bool(
        np.linalg.norm(story.station[:3, 3]) > TRACKER_AWAY and story.station[2, 2] > UPRIGHT
    )


def arrow_factor(story: CalibrationStory) -> int:
    """Exaggeration that keeps all but gross errors below their drawn size."""
    before = story.calibration.before_misses
    size = np.linalg.norm(before.vector, axis=1)
    return nice_factor(ARROW_SIZE, float(np.quantile(size, 0.98)))


def draw_cell(pen: Pen[CalibrationStory], robot: Robot) -> None:
    """The robot, its target, and the tracker with its beam where one stands."""
    import rerun as rr

    story = pen.story
    chain = replace(robot.model.chain, T_world_base=np.eye(4))
    steps = np.arange(story.n_steps)
    draw_arm(pen, "world/robot", robot, story.q, (chain,), np.zeros(story.n_steps, np.int64))
    model = story.calibration.fit.identification.model
    T = story.station @ model.poses(story.q)
    pen.transforms("world/target", T)
    pen.static(
        "world/target",
        rr.Arrows3D(vectors=AXIS_LENGTH * np.eye(3), radii=0.004, colors=AXES_COLORS),
    )
    flange = T @ inverse(model.chain.T_flange_tool)
    arm = [[[a, b]] for a, b in zip(flange[:, :3, 3], T[:, :3, 3], strict=True)]
    pen.every_step("world/holder", rr.LineStrips3D.columns(strips=arm), steps)
    pen.static("world/holder", rr.LineStrips3D.from_fields(radii=0.006, colors=(90, 96, 104)))
    if has_tracker(story):
        draw_station(pen, story.station, T[:, :3, 3], robot.base_offset)
        for name in ("measure", "evaluate"):
            phase = story.phase(name)
            draw_beam(pen, story.station, T[:, :3, 3], phase.start, phase.stop)


def draw_measured(pen: Pen[CalibrationStory], factor: int) -> None:
    """Training poses seen so far, and what the nominal links miss there."""
    import rerun as rr

    story = pen.story
    phase, end = story.phase("measure"), story.phase("identify").stop
    before = story.vectors(story.calibration.before_misses)[phase.rows]
    seen, size = story.seen[phase.rows], np.linalg.norm(before, axis=1)
    lengths = growing(len(seen))
    colors = viridis(size, float(np.quantile(size, 0.98)))
    cloud, arrows = "world/measured", f"world/error_before_x{factor}"
    pen.rows(
        cloud,
        phase,
        rr.Points3D.columns(
            positions=first(seen, lengths), colors=first(colors, lengths)
        ).partition(lengths),
        lengths - 1,
    )
    pen.static(cloud, rr.Points3D.from_fields(radii=0.010))
    _arrows(pen, arrows, phase, seen - before, factor * before, BEFORE_COLOR, 0.0032)
    pen.clear(end, [cloud, arrows])


def draw_judged(pen: Pen[CalibrationStory], factor: int) -> None:
    """Held-out poses: all of them as points, those visited with arrows before and after."""
    import rerun as rr

    story, calibration = pen.story, pen.story.calibration
    phase = story.phase("evaluate")
    judged = calibration.is_judged
    after = calibration.fit.misses.position
    colors = viridis(after[judged], float(np.quantile(after[judged], 0.98)))
    pen.at(
        phase.start,
        "world/held_out/all",
        rr.Points3D(
            story.seen[judged], radii=0.006 if judged.sum() < MOST_POSES else 0.0025, colors=colors
        ),
    )
    seen = story.seen[phase.rows]
    for name, misses, color, radius in (
        ("before", calibration.before_misses, BEFORE_COLOR, 0.0024),
        ("after", calibration.fit.misses, AFTER_COLOR, 0.0045),
    ):
        vectors = story.vectors(misses)[phase.rows]
        _arrows(
            pen, f"world/held_out/{name}_x{factor}", phase, seen - vectors, factor * vectors, color,
            radius,
        )  # fmt: skip


def _arrows(
    pen: Pen[CalibrationStory],
    path: str,
    phase: CalibrationPhase,
    origins: Array,
    vectors: Array,
    color: tuple[int, ...],
    radius: float,
) -> None:
    """Arrows (k, 3) that come one by one."""
    import rerun as rr

    lengths = growing(len(origins))
    pen.rows(
        path,
        phase,
        rr.Arrows3D.columns(
            origins=first(origins, lengths), vectors=first(vectors, lengths)
        ).partition(lengths),
        lengths - 1,
    )
    pen.static(path, rr.Arrows3D.from_fields(radii=radius, colors=color))


def draw_curves(pen: Pen[CalibrationStory]) -> None:
    """Errors of the poses shown, before and after, and how the fit went [mm]."""
    story, calibration = pen.story, pen.story.calibration
    for name in ("measure", "evaluate"):
        phase = story.phase(name)
        for what, misses, color in (
            ("before", calibration.before_misses, RED),
            ("after", calibration.fit.misses, GREEN),
        ):
            draw_curve(pen, f"{name}/{what}", phase, misses.position[phase.rows] * 1e3, color)
    found = calibration.fit.identification
    draw_curve(
        pen, "identify/fit", story.phase("identify"), fit(found.trace, found.dof), LINE_COLOR
    )


PHASE_COLORS: dict[CalibrationPhaseName, Color] = {
    "measure": (52, 128, 196),
    "identify": (58, 140, 72),
    "evaluate": (204, 146, 62),
}


def draw_texts(pen: Pen[CalibrationStory], factor: int) -> None:
    """The summary at all times, the explanation of each phase when it begins."""
    import rerun as rr

    markdown = rr.MediaType.MARKDOWN
    story = pen.story
    pen.static("summary", rr.TextDocument(summary(story.calibration), media_type=markdown))
    pen.static(
        "phase",
        rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values())),
    )
    for phase in story.phases:
        text = explanation(story, phase, factor)
        pen.at(phase.start, "now", rr.TextDocument(text, media_type=markdown))
        pen.at(phase.start, "phase", rr.StateChange(state=phase.name))


def summary(calibration: Calibration) -> str:
    """The verdict first, then the errors of every model."""
    lines = [
        f"#### {calibration.source.robot_title}: {calibration.source.name}",
        f"**{notice(calibration)}**",
        "",
        verdict(calibration),
        "",
        mark(calibration),
        "",
        "| model | mean | p95 | max mm | mean deg |",
        "|---|--:|--:|--:|--:|",
    ]
    lines += [
        f"| {row[0]} | {row[1]} | {row[4]} | {row[5]} | {row[6]} |"
        for row in headline_rows(calibration)
    ]
    return "\n".join(lines)


def explanation(story: CalibrationStory, phase: CalibrationPhase, factor: int) -> str:
    """What is on the screen in a phase, in a few lines."""
    calibration = story.calibration
    found = calibration.fit.identification
    if phase.name == "measure":
        total = int(calibration.is_used.sum())
        lines = [
            f"#### 1 Measured: {counted(total, 'row')} to identify from",
            _shown(len(phase.rows), total),
            "- dots: where the target was seen, dark to bright with growing error",
            f"- red arrows: what the nominal links miss, drawn {factor} times; base and tool are "
            "fitted already",
            "- triad: the target on the tool",
        ]
    elif phase.name == "identify":
        lines = [
            f"#### 2 Identify: {calibration.choice.chosen}",
            f"- {found.parameters.n_free} numbers from {len(found.residual)} equations",
            f"- {found.status.value}",
            f"- {calibration.choice.sentence}",
        ]
    else:
        judged = int(calibration.is_judged.sum())
        held = calibration.split.is_test.any()
        lines = [
            f"#### 3 {'Held out' if held else 'Again, none held out'}: {counted(judged, 'row')}",
            _shown(len(phase.rows), judged),
            f"- red, green: error before and after, both drawn {factor} times",
            "- dots: all of them, dark to bright with growing error after",
        ]
        conformal = calibration.proof.conformal
        if conformal is not None:
            lines.append(f"- 95 % of new poses like these lie within {mm(conformal.radius)} mm")
    return "\n".join(line for line in lines if line)


def _shown(shown: int, total: int) -> str:
    """How many of the rows the robot goes to."""
    return "" if shown == total else f"- {shown} of them, evenly spread, are shown"
