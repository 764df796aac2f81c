"""The words of a calibration's recording: the summary, and what each phase shows."""

from testbed.output.calibration_words import (
    headline_rows,
    mark,
    mm,
    notice,
    verdict,
)
from testbed.output.quantities import counted
from testbed.output.recording_calibration_story import (
    CalibrationPhase,
    CalibrationPhaseName,
    CalibrationStory,
)
from testbed.output.recording_writer import Color, Pen
from testbed.records_calibration import Calibration

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
