"""The recording of a calibration: measured poses, the fit, held-out poses, and the verdict."""

from dataclasses import replace

import numpy as np

from calib.arrays import Index
from testbed.identify.recording_cell import (
    ShownCalibration,
    draw_cell,
    draw_judged,
    draw_measured,
    draw_sight,
    show,
)
from testbed.identify.records import Calibration
from testbed.identify.words import headline_rows, mark, mm, notice, verdict
from testbed.recording import style
from testbed.recording.curves import draw_curve, draw_fit
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter, Story
from testbed.recording.timeline import Phase, spread, visit
from testbed.robots.robot import Robot
from testbed.units import counted

IDENTIFY_FRAMES = 48
AHEAD = np.array([3.0, 0.0, 0.0])
"""Without a tracker in sight the arm is looked at from its front [m]."""


def calibration_story(calibration: Calibration, robot: Robot) -> Story:
    """What the recording of a calibration holds, in the base frame of the identified robot.

    Parameters
    ----------
    calibration : Calibration
        Finished; nothing is computed again but poses of known models.
    robot : Robot
        Whose parts are drawn.
    """
    source, shown = calibration.source, show(calibration)
    return Story(
        identity=f"{source.name}-calibration-{calibration.split.seed}",
        name=f"{source.name}, calibration of {source.robot}",
        summary=summary(calibration),
        robot=robot,
        chain=replace(robot.model.chain, T_world_base=np.eye(4)),
        reach=shown.seen,
        station=shown.station[:3, 3] if shown.has_tracker else AHEAD,
        draw=lambda pen: draw_cell(shown, robot.base_offset, pen),
        chapters=(_measure(shown), _identify(shown), _evaluate(shown)),
    )


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


def _measure(shown: ShownCalibration) -> Chapter:
    """Training poses, and their errors before and after."""
    total = int(shown.calibration.is_used.sum())

    def draw(pen: Pen, phase: Phase) -> None:
        draw_sight(shown, pen, phase)
        draw_measured(shown, pen, phase)
        _draw_errors(shown, pen, phase, shown.measured)

    return Chapter(
        name="measure",
        local="pose",
        color=style.MEASURE_PHASE,
        motion=visit(shown.calibration.measurements.q[shown.measured]),
        text=(
            f"#### 1 Measured: {counted(total, 'row')} to identify from",
            _part_shown(len(shown.measured), total),
            "- dots: where the target was seen, dark to bright with growing error",
            f"- red arrows: what the nominal links miss, drawn {shown.factor} times; base and tool "
            "are fitted already",
            "- triad: the target on the tool",
        ),
        draw=draw,
        plots={"measure": "1 Training poses mm: red before, green after"},
    )


def _identify(shown: ShownCalibration) -> Chapter:
    """How the fit went."""
    calibration = shown.calibration
    found = calibration.fit.identification
    last = calibration.measurements.q[shown.measured[-1:]]
    return Chapter(
        name="identify",
        local="iteration",
        color=style.IDENTIFY_PHASE,
        motion=spread(len(found.trace), IDENTIFY_FRAMES, last),
        text=(
            f"#### 2 Identify: {calibration.choice.chosen}",
            f"- {found.parameters.n_free} numbers from {len(found.residual)} equations",
            f"- {found.status.value}",
            f"- {calibration.choice.sentence}",
        ),
        draw=lambda pen, phase: draw_fit(pen, phase, found.trace, found.dof),
        plots={"identify": "2 log10(sum of squares / dof)"},
    )


def _evaluate(shown: ShownCalibration) -> Chapter:
    """Poses that judge the calibration, and their errors before and after."""
    calibration = shown.calibration
    judged, held = int(calibration.is_judged.sum()), calibration.split.is_test.any()
    ball = calibration.proof.conformal
    within = f"- 95 % of new poses like these lie within {mm(ball.radius)} mm" if ball else ""

    def draw(pen: Pen, phase: Phase) -> None:
        draw_sight(shown, pen, phase)
        draw_judged(shown, pen, phase)
        _draw_errors(shown, pen, phase, shown.judged)

    return Chapter(
        name="evaluate",
        local="test",
        color=style.EVALUATE_PHASE,
        motion=visit(calibration.measurements.q[shown.judged]),
        text=(
            f"#### 3 {'Held out' if held else 'Again, none held out'}: {counted(judged, 'row')}",
            _part_shown(len(shown.judged), judged),
            f"- red, green: error before and after, both drawn {shown.factor} times",
            "- dots: all of them, dark to bright with growing error after",
            within,
        ),
        draw=draw,
        plots={"evaluate": "3 Held-out mm: red before, green after"},
    )


def _part_shown(shown: int, total: int) -> str:
    """How many of the rows the robot goes to, unless it goes to all."""
    return "" if shown == total else f"- {shown} of them, evenly spread, are shown"


def _draw_errors(shown: ShownCalibration, pen: Pen, phase: Phase, rows: Index) -> None:
    """Errors of the poses shown, before and after [mm]."""
    before, after = shown.calibration.before_misses, shown.calibration.fit.misses
    draw_curve(pen, f"{phase.name}/before", phase, before.position[rows] * 1e3, style.RED)
    draw_curve(pen, f"{phase.name}/after", phase, after.position[rows] * 1e3, style.GREEN)
