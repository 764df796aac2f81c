"""The corrected program in a recording: five poses run as written, then corrected, as read."""

from functools import partial

import numpy as np

from testbed.recording import style
from testbed.recording.chart import Chart, Series
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter
from testbed.recording.timeline import Phase, visit
from testbed.scenario.scenario import Scenario
from testbed.studies.compensation.study import FIGURES, STUDY, VARIANTS, CompensationStudy
from testbed.studies.trial.records import Campaign
from testbed.units import UM

BEFORE, CHOSEN = VARIANTS.index("before"), VARIANTS.index("chosen")
AP = FIGURES.index("AP")
MARK_COLOR = (30, 34, 40)
"""Of the commanded points."""
FRAMES = 144
"""Length of the phase."""


def shown(studies: tuple[CompensationStudy, ...], scenario: Scenario) -> CompensationStudy:
    """The kind of robots whose first one is shown: the scenario's own kind, else the first."""
    own = (study for study in studies if study.truth == scenario.truth.preset)
    return next(own, studies[0])


def chapter(campaign: Campaign) -> Chapter:
    """The program run as written, then with corrected joint targets."""
    study = shown(STUDY.of(campaign), campaign.scenario)
    targets = np.vstack([study.targets[BEFORE, 0], study.targets[CHOSEN, 0]])
    ap = UM * study.figures[:, AP, 0, 0].mean(axis=-1)
    floor = UM * float(study.figures[CHOSEN, AP, 2, 0].mean())
    return Chapter(
        name="compensate",
        local="visit",
        color=(24, 140, 140),
        motion=visit(targets, FRAMES // len(targets)),
        text=(
            f"#### Compensate: a program on a {study.truth} robot",
            f"- another robot of that kind, calibrated with {study.poses} poses, runs five poses "
            f"{study.cycles} times: as written, then with corrected joint targets",
            "- black: commanded points of the cube of ISO 9283",
            f"- vermilion, blue: readings before and after, drawn {factor(study)} times",
            f"- mean AP {ap[BEFORE]:.0f} to {ap[CHOSEN]:.1f} µm; {floor:.1f} µm is noise alone",
        ),
        draw=partial(_draw, study),
        lines=_lines(study),
        charts=(_chart(study),),
    )


def _draw(study: CompensationStudy, pen: Pen, phase: Phase) -> None:
    """Readings of both runs around the commanded points, far larger than life, and AP per pose."""
    import rerun as rr

    command, count = study.T[:, :3, 3], len(study.T)
    times = factor(study)
    marks = rr.Points3D(command, radii=0.008, colors=MARK_COLOR)
    pen.at(phase.start, "world/program/commanded", marks)
    numbers = [f"P{number}" for number in study.pose_id]
    # a label has the color of its point, and stands on gray
    labels = rr.Points3D(command, radii=1e-4, colors=(255,) * 3, labels=numbers, show_labels=True)
    pen.at(phase.start, "world/program/numbers", labels)
    runs = ((BEFORE, style.BEFORE_COLOR, 0), (CHOSEN, style.AFTER_COLOR, count))
    for variant, color, begin in runs:
        path, cycles = f"world/program/{VARIANTS[variant]}_x{times}", study.readings.shape[2]
        readings = command[:, None] + times * study.readings[variant]
        dots, look = {"positions": readings.reshape(-1, 3)}, {"radii": 0.0025, "colors": color}
        pen.grow(f"{path}/readings", phase, rr.Points3D, dots, look, begin=begin, each=cycles)
        mean = readings.mean(axis=1) - command
        pen.grow_arrows(f"{path}/mean", phase, command, mean, color, 0.0035, begin)


def _lines(study: CompensationStudy) -> list[str]:
    """Run, pose and its AP."""
    ap = UM * study.figures[:, AP, 0, 0]
    runs = (("as written", BEFORE), ("corrected", CHOSEN))
    return [
        f"{name}: P{number}, AP {value:.0f} µm"
        for name, variant in runs
        for number, value in zip(study.pose_id, ap[variant], strict=True)
    ]


def _chart(study: CompensationStudy) -> Chart:
    """AP of every pose, in the run as written and in the corrected one."""
    count = len(study.T)
    value, floor = UM * study.figures[:, AP, 0, 0], UM * study.figures[:, AP, 2, 0]
    floors = np.concatenate([floor[BEFORE], floor[CHOSEN]])
    curves = (
        Series("before", value[BEFORE], style.BEFORE_COLOR, "as written", np.arange(count)),
        Series("after", value[CHOSEN], style.AFTER_COLOR, "corrected", count + np.arange(count)),
        Series("floor", floors, style.MUTED_COLOR, "noise floor"),
    )
    # both runs over the same poses
    return Chart("compensate", "AP [µm] by pose", curves, np.tile(study.pose_id * 1.0, 2))


def factor(study: CompensationStudy) -> int:
    """How many times larger than life the readings are drawn."""
    size = np.linalg.norm(study.readings[[BEFORE, CHOSEN]], axis=-1)
    return style.nice_factor(style.ARROW_SIZE, float(size.max()))
