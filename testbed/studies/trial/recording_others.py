"""Further trials in the recording: a window each, with what differs from the first one."""

from dataclasses import replace
from functools import partial

from testbed.recording import style
from testbed.recording.pen import Pen
from testbed.recording.story import Window
from testbed.studies.trial.recording_cell import (
    CHOSEN,
    HELD_OUT,
    LEAVES,
    MEASURED,
    SEEN_COLOR,
    ShownTrial,
    held_out,
    predicted_places,
    seen_places,
    show,
)
from testbed.studies.trial.records import Campaign

MOST_OTHERS = 3
"""Trials beside the first: windows that have room for their names."""


def other_windows(campaign: Campaign, first: ShownTrial) -> tuple[Window, ...]:
    """A window for each of the next trials, by the factors of the first: to be compared."""
    own = (CHOSEN, LEAVES, MEASURED, HELD_OUT, first.error_path, first.ghost_path, "world/beam")
    hidden = tuple(f"{path}/**" for path in own)
    windows = [Window(first.trial.name)]
    for trial in campaign.trials[1 : 1 + MOST_OTHERS]:
        shown = replace(show(campaign, trial), arrows=first.arrows, regions=first.regions)
        root = f"world/trials/{trial.name}"
        windows.append(Window(trial.name, root, hidden, partial(draw_other, shown, root)))
    return tuple(windows) if len(windows) > 1 else ()


def draw_other(shown: ShownTrial, root: str, pen: Pen) -> None:
    """Its poses, all that it measured there, and all held-out errors and regions at once.

    The robot is that of the first trial, which goes to the same held-out poses.
    """
    import rerun as rr

    chosen, measured, measure, evaluate = (
        f"{root}/{name}" for name in ("chosen", "measured", "error", "held_out")
    )
    measured_at, fit = pen.timeline.phase("measure"), pen.timeline.phase("identify")
    places = shown.setting.pool_nominal[shown.trial.selection.indices, :3, 3]
    dots = rr.Points3D(places, radii=0.009, colors=style.CHOSEN_COLOR)
    pen.at(pen.timeline.phase("select").start, chosen, dots)
    table = shown.trial.measurements
    seen = seen_places(shown.estimate.identification.model, table)
    points = predicted_places(shown.setting.nominal, table)
    pen.at(measured_at.start, measured, rr.Points3D(seen, radii=0.010, colors=SEEN_COLOR))
    vectors = shown.arrows * (seen - points)
    arrows = rr.Arrows3D(origins=points, vectors=vectors, radii=0.0032, colors=style.BEFORE_COLOR)
    pen.at(measured_at.start, measure, arrows)
    pen.clear(fit.stop, chosen, measured, measure)
    phase = pen.timeline.phase("evaluate")
    drawn = held_out(shown, evaluate)
    for path, (archetype, values, look) in drawn.items():
        pen.at(phase.start, path, archetype(**values, **look))
    leaves = pen.timeline.moves_on(phase.stop)
    if leaves is not None:
        pen.clear(leaves, *drawn)
