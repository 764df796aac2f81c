"""The corrected program in a recording: five poses run as written, then corrected, as read."""

import numpy as np

from calib.arrays import Array
from testbed.recording.curves import GREEN, MUTED_COLOR, RED, draw_curve
from testbed.recording.pen import AFTER_COLOR, ARROW_SIZE, BEFORE_COLOR, Color, Writer, first
from testbed.recording.story import Phase, nice_factor
from testbed.scenario.read import Scenario
from testbed.studies.compensation.records import FIGURES, VARIANTS, CompensationStudy
from testbed.units import UM

BEFORE, CHOSEN = VARIANTS.index("before"), VARIANTS.index("chosen")
AP = FIGURES.index("AP")
MARK_COLOR = (70, 90, 200)
"""Of the commanded points."""


def shown(studies: tuple[CompensationStudy, ...], scenario: Scenario) -> CompensationStudy | None:
    """The kind of robots whose first one is shown: the scenario's own kind, else the first."""
    own = (study for study in studies if study.truth == scenario.truth.preset)
    return next(own, studies[0] if studies else None)


def program(study: CompensationStudy) -> Array:
    """Joint targets (2p, n) of the first robot: as written, then corrected [rad, m]."""
    return np.vstack([study.targets[BEFORE, 0], study.targets[CHOSEN, 0]])


def draw_compensation(writer: Writer, study: CompensationStudy, phase: Phase) -> None:
    """Readings of both runs around the commanded points, far larger than life, and AP per pose."""
    import rerun as rr

    command, count = study.T[:, :3, 3], len(study.T)
    times = factor(study)
    marks = rr.Points3D(command, radii=0.008, colors=MARK_COLOR)
    writer.at(phase.start, "world/program/commanded", marks)
    numbers = [f"P{number}" for number in study.pose_id]
    # a label has the color of its point, and stands on gray
    labels = rr.Points3D(command, radii=1e-4, colors=(255,) * 3, labels=numbers, show_labels=True)
    writer.at(phase.start, "world/program/numbers", labels)
    for part, (variant, color) in enumerate(((BEFORE, BEFORE_COLOR), (CHOSEN, AFTER_COLOR))):
        path = f"world/program/{VARIANTS[variant]}_x{times}"
        readings = command[:, None] + times * study.readings[variant]
        _draw_readings(writer, path, readings, command, phase, part * count, color)
    index, values = np.arange(2 * count), study.figures[:, AP, 0, 0]
    value = UM * np.concatenate([values[BEFORE], values[CHOSEN]])
    floor = UM * np.concatenate([study.figures[v, AP, 2, 0] for v in (BEFORE, CHOSEN)])
    early, late = index[:count], index[count:]
    draw_curve(writer, "compensate/before", phase, value[early], RED, "AP before", early)
    draw_curve(writer, "compensate/after", phase, value[late], GREEN, "AP after", late)
    draw_curve(writer, "compensate/floor", phase, floor, MUTED_COLOR, "noise floor")


def factor(study: CompensationStudy) -> int:
    """How many times larger than life the readings are drawn."""
    size = np.linalg.norm(study.readings[[BEFORE, CHOSEN]], axis=-1)
    return nice_factor(ARROW_SIZE, float(size.max()))


def _draw_readings(
    writer: Writer,
    path: str,
    readings: Array,
    command: Array,
    phase: Phase,
    begin: int,
    color: Color,
) -> None:
    """Clouds (p, c, 3) that come in pose by pose, and an arrow from the command to their middle."""
    import rerun as rr

    count, cycles = readings.shape[:2]
    index = begin + np.arange(count)
    lengths = np.arange(1, count + 1)
    writer.rows(
        f"{path}/readings",
        phase,
        rr.Points3D.columns(positions=first(readings.reshape(-1, 3), cycles * lengths)).partition(
            cycles * lengths
        ),
        index,
    )
    writer.static(f"{path}/readings", rr.Points3D.from_fields(radii=0.0025, colors=color))
    writer.rows(
        f"{path}/mean",
        phase,
        rr.Arrows3D.columns(
            origins=first(command, lengths),
            vectors=first(readings.mean(axis=1) - command, lengths),
        ).partition(lengths),
        index,
    )
    writer.static(f"{path}/mean", rr.Arrows3D.from_fields(radii=0.0035, colors=color))


def words(study: CompensationStudy) -> str:
    """What is on the screen in this phase."""
    ap = UM * study.figures[:, AP, 0, 0].mean(axis=-1)
    floor = UM * float(study.figures[CHOSEN, AP, 2, 0].mean())
    return "\n".join(
        [
            f"#### Compensate: a program on a {study.truth} robot",
            f"- another robot of that kind, calibrated with {study.poses} poses, runs five poses "
            f"{study.cycles} times: as written, then with corrected joint targets",
            "- blue: commanded points of the cube of ISO 9283",
            f"- red, green: what the tracker reads before and after, drawn {factor(study)} times",
            f"- mean AP {ap[BEFORE]:.0f} to {ap[CHOSEN]:.1f} µm; {floor:.1f} µm is noise alone",
        ]
    )
