"""Further trials in the recording: a window each, in which everything is their own."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from calib.arrays import Array
from testbed.recording.cell import draw_arm
from testbed.recording.pen import Pen
from testbed.recording.story import Window, floor_height
from testbed.recording.timeline import Timeline, glide, resting
from testbed.robots.robot import Robot
from testbed.studies.trial import recording_cell as cell
from testbed.studies.trial.recording import chapters
from testbed.studies.trial.recording_cell import ShownTrial, show
from testbed.studies.trial.recording_ghost import draw_ghost
from testbed.studies.trial.recording_select import sets_on_the_way, shown_stops
from testbed.studies.trial.records import Campaign

MOST_OTHERS = 3
"""Trials beside the first: windows that have room for their names."""


def other_windows(
    campaign: Campaign, first: ShownTrial, robot: Robot, summaries: Mapping[str, str]
) -> tuple[Window, ...]:
    """A window for each of the next trials, by the factors of the first: to be compared.

    Parameters
    ----------
    campaign : Campaign
        With the first trial and the next ones.
    first : ShownTrial
        That which the story tells.
    robot : Robot
        Whose parts are drawn.
    summaries : mapping of str to str
        What is summed up where a trial is shown, by its name.
    """
    stations = len(first.estimate.identification.model.fixtures.stations)
    trackers = [cell.TRACKER, *(f"{cell.TRACKER}{k + 2}" for k in range(stations))]
    own = (cell.CHOSEN, cell.LEAVES, cell.MEASURED, cell.HELD_OUT, first.error_name, cell.BEAM)
    names = (*own, cell.ROBOT, *trackers, cell.ANCHORS)
    hidden = (f"{first.ghost_path}/**", *(f"{cell.WORLD}/{name}/**" for name in names))
    windows = [Window(first.trial.name)]
    for trial in campaign.trials[1 : 1 + MOST_OTHERS]:
        below = f"trials/{trial.name}"
        shown = replace(
            show(campaign, trial),
            arrows=first.arrows,
            regions=first.regions,
            ghost=first.ghost,
            root=f"{cell.WORLD}/{below}",
            words=f"{below}/",
        )
        windows.append(
            Window(
                trial.name,
                shown.root,
                hidden,
                partial(draw_other, shown, robot),
                shown.words,
                summaries[trial.name],
                chapters(shown, campaign.random_sets),
                partial(own_timeline, shown),
            )
        )
    return tuple(windows) if len(windows) > 1 else ()


def own_timeline(shown: ShownTrial, timeline: Timeline) -> Timeline:
    """The timeline with a trial's own items in phases that are as long as those of the first.

    Held-out poses are the same for all.
    """
    table, q = shown.trial.measurements, timeline.q.copy()
    ways: dict[str, Array] = {
        "select": shown_stops(shown), "measure": table.q, "identify": table.q[-1:]
    }  # fmt: skip
    for name, stops in ways.items():
        steps = timeline.phase(name).steps
        q[steps] = glide(stops, len(steps))
    items = {
        "select": len(sets_on_the_way(shown.trial.selection)[0]),
        "measure": len(table),
        "identify": len(shown.estimate.identification.trace),
    }
    phases = (
        resting(phase, items[phase.name]) if phase.name in items else phase
        for phase in timeline.phases
    )
    return Timeline(tuple(phases), q)


def draw_other(shown: ShownTrial, robot: Robot, pen: Pen) -> None:
    """Its robot with its ghost, and its trackers, on the way through its poses."""
    chain = shown.setting.nominal.chain
    draw_arm(pen, f"{shown.root}/{cell.ROBOT}", robot, pen.timeline.q, (chain,))
    draw_ghost(shown, robot, pen)
    cell.draw_instruments(shown, floor_height(chain, robot), pen)
