"""The choice of a trial's poses in the recording: exchange after exchange, as the record has it."""

from itertools import pairwise

import numpy as np

from calib.arrays import Array, Index
from calib.design import Selection
from testbed.recording import style
from testbed.recording.chart import Chart, Series, level
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter, numbered
from testbed.recording.timeline import Motion, Phase, spread, visit
from testbed.studies.trial.plots import unit_factor, unit_of_criterion
from testbed.studies.trial.recording_cell import CHOSEN, LEAVES, WORLD, ShownTrial
from testbed.studies.trial.set_records import RandomSets
from testbed.units import significant

FRAMES, MOST_FRAMES = 4, 144
"""For each exchange, and about for all of them: the chapter is short."""
FEWEST_FRAMES = 24
"""Where nothing was exchanged."""


def sets_on_the_way(selection: Selection) -> tuple[Index, Array]:
    """Sets (w, m) in turn, the chosen one last, and their figures (w,)."""
    way, figures = selection.way, selection.way_figures
    if way is None or figures is None:  # drawn, grown, or a record of an older version
        return selection.indices[None], np.array([selection.value])
    return way, figures


def exchanged(sets: Index) -> tuple[list[Index], list[Index]]:
    """What left and what came in with each set; with the first one nothing did."""
    none = np.zeros(0, dtype=np.int64)
    pairs = list(pairwise(sets))
    left = [np.setdiff1d(one, two) for one, two in pairs]
    return [none, *left], [none, *(np.setdiff1d(two, one) for one, two in pairs)]


def select_chapter(shown: ShownTrial, sets: RandomSets | None) -> Chapter:
    """The pool and the set, exchange after exchange; the robot shows a pose that comes in."""
    selection, pool = shown.trial.selection, shown.setting.pool_q
    way, figures = sets_on_the_way(selection)
    criterion, count = selection.criterion, len(way)
    unit = unit_of_criterion(shown.trial)
    factor, axis = unit_factor(unit, criterion)
    figures = factor * figures
    curves = [Series(criterion, figures, style.BLUE, "the set")]
    if sets is not None and sets.best is not None:
        name = f"best of {sets.drawn} random sets"
        curves.append(level("random", count, factor * sets.best, style.MUTED_COLOR, name))
    says = (f"{criterion} {significant(figure, 5)}{' µm' * (unit == 'm')}" for figure in figures)
    return Chapter(
        name="select",
        local="exchange",
        color=style.SEARCH_PHASE,
        motion=_motion(shown_stops(shown)),
        text=(
            f"#### 1 Select: {shown.trial.method}, {criterion}",
            f"- gray: {len(pool)} candidates; blue: the set of {len(selection.indices)} poses",
            *(
                ("- vermilion: poses that leave the set; the robot shows those that enter",)
                if count > 1
                else ()
            ),
            *(
                (f"- a first search, then the better results of {selection.searches} searches",)
                if count > 1
                else ()
            ),
            shown.ghost_words,
        ),
        draw=lambda pen, phase: draw_exchanges(shown, pen, phase),
        lines=numbered("set", count, says),
        charts=(Chart("select", f"{axis} of the set, by exchange", curves),),
    )


def shown_stops(shown: ShownTrial) -> Array:
    """Joints (w, n) at which the robot shows what comes in, exchange after exchange [rad, m]."""
    way, _ = sets_on_the_way(shown.trial.selection)
    came = [new if len(new) else one[:1] for one, new in zip(way, exchanged(way)[1], strict=True)]
    return np.asarray(shown.setting.pool_q[[one[0] for one in came]])


def _motion(stops: Array) -> Motion:
    """From pose to pose, as slowly as there is time for."""
    if len(stops) == 1:  # nothing is searched: the set is there at once
        return spread(1, FEWEST_FRAMES, stops)
    return visit(stops, max(1, min(FRAMES, MOST_FRAMES // len(stops))))


def draw_exchanges(shown: ShownTrial, pen: Pen, phase: Phase) -> None:
    """Candidate tool positions, the set at every exchange, and what leaves it."""
    import rerun as rr

    places = shown.setting.pool_nominal[:, :3, 3]
    if shown.root == WORLD:  # the pool is the same for all
        pool = rr.Points3D(places, radii=0.0028, colors=style.CANDIDATE_COLOR)
        pen.static(f"{WORLD}/pool", pool)
    way, _ = sets_on_the_way(shown.trial.selection)
    left, _ = exchanged(way)
    chosen = rr.Points3D.columns(positions=places[way.ravel()])
    set_path, left_path = f"{shown.root}/{CHOSEN}", f"{shown.root}/{LEAVES}"
    pen.rows(set_path, phase, chosen.partition(np.full(len(way), way.shape[1])))
    pen.static(set_path, rr.Points3D.from_fields(radii=0.009, colors=style.CHOSEN_COLOR))
    pen.clear(pen.timeline.phase("identify").stop, set_path)
    if len(way) > 1:
        gone = rr.Points3D.columns(positions=places[np.concatenate(left)])
        pen.rows(left_path, phase, gone.partition([len(one) for one in left]))
        pen.static(left_path, rr.Points3D.from_fields(radii=0.016, colors=style.VERMILION))
        pen.clear(phase.stop, left_path)
