"""Further trials in the recording: a window each, in which everything is their own."""

from dataclasses import replace
from functools import partial

from calib.arrays import Array
from testbed.recording import style
from testbed.recording.cell import draw_arm
from testbed.recording.pen import Pen
from testbed.recording.story import Window, floor_height
from testbed.recording.timeline import Timeline, glide, resting
from testbed.robots.robot import Robot
from testbed.studies.trial import recording_cell as cell
from testbed.studies.trial.recording_cell import ShownTrial, show
from testbed.studies.trial.recording_select import shown_stops
from testbed.studies.trial.records import Campaign

MOST_OTHERS = 3
"""Trials beside the first: windows that have room for their names."""


def other_windows(campaign: Campaign, first: ShownTrial, robot: Robot) -> tuple[Window, ...]:
    """A window for each of the next trials, by the factors of the first: to be compared."""
    stations = len(first.estimate.identification.model.fixtures.stations)
    trackers = [cell.TRACKER, *(f"{cell.TRACKER}{k + 2}" for k in range(stations))]
    own = (cell.CHOSEN, cell.LEAVES, cell.MEASURED, cell.HELD_OUT, first.error_name, cell.BEAM)
    names = (*own, cell.ROBOT, *trackers, cell.ANCHORS)
    hidden = (f"{first.ghost_path}/**", *(f"{cell.WORLD}/{name}/**" for name in names))
    windows = [Window(first.trial.name)]
    for trial in campaign.trials[1 : 1 + MOST_OTHERS]:
        shown = replace(show(campaign, trial), arrows=first.arrows, regions=first.regions)
        root = f"{cell.WORLD}/trials/{trial.name}"
        windows.append(Window(trial.name, root, hidden, partial(draw_other, shown, robot, root)))
    return tuple(windows) if len(windows) > 1 else ()


def own_timeline(shown: ShownTrial, timeline: Timeline) -> Timeline:
    """The timeline with a trial's own poses in phases that are as long as those of the first.

    Held-out poses are the same for all.
    """
    table, q = shown.trial.measurements, timeline.q.copy()
    ways: dict[str, Array] = {
        "select": shown_stops(shown), "measure": table.q, "identify": table.q[-1:]
    }  # fmt: skip
    for name, stops in ways.items():
        steps = timeline.phase(name).steps
        q[steps] = glide(stops, len(steps))
    phases = (
        resting(phase, len(table)) if phase.name == "measure" else phase
        for phase in timeline.phases
    )
    return Timeline(tuple(phases), q)


def draw_other(shown: ShownTrial, robot: Robot, root: str, pen: Pen) -> None:
    """Its set, its robot and trackers on the way through its poses, and what they measured.

    All held-out errors and regions are there at once: to be compared.
    """
    import rerun as rr

    setting, own = shown.setting, Pen(pen.stream, own_timeline(shown, pen.timeline))
    chain = setting.nominal.chain
    draw_arm(own, f"{root}/{cell.ROBOT}", robot, own.timeline.q, (chain,))
    cell.draw_instruments(shown, floor_height(chain, robot), own, root)
    places = setting.pool_nominal[shown.trial.selection.indices, :3, 3]
    dots = rr.Points3D(places, radii=0.009, colors=style.CHOSEN_COLOR)
    pen.at(pen.timeline.phase("select").start, f"{root}/{cell.CHOSEN}", dots)
    pen.clear(pen.timeline.phase("identify").stop, f"{root}/{cell.CHOSEN}")
    cell.draw_measured(shown, own, own.timeline.phase("measure"), root)
    phase = pen.timeline.phase("evaluate")
    drawn = cell.held_out(shown, f"{root}/{cell.HELD_OUT}")
    for path, (archetype, values, look) in drawn.items():
        pen.at(phase.start, path, archetype(**values, **look))
    leaves = pen.timeline.moves_on(phase.stop)
    if leaves is not None:
        pen.clear(leaves, *drawn)
