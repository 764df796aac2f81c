"""The recording of a plan: candidates by leverage, the budget, the tour and beams, the goal."""

from pathlib import Path
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.plan.recording_cell import draw_candidates, draw_cell, draw_goal, draw_texts, draw_tour
from testbed.plan.recording_story import PlanPhase, PlanPhaseName, PlanStory, tell_plan
from testbed.plan.records import Plan
from testbed.recording.cell import floor_height
from testbed.recording.curves import draw_curve
from testbed.recording.layout import FRAMES_PER_SECOND, camera, cell_view, plot_over
from testbed.recording.pen import Color, Pen, open_stream, strict_mode
from testbed.robots.catalog import Robot

BLUE, VERMILION, GRAY, AMBER = (92, 150, 240), (232, 100, 60), (150, 156, 164), (232, 163, 61)


def write_plan_recording(plan: Plan, robot: Robot, path: str | Path) -> None:
    """Write a plan as a Rerun recording.

    Parameters
    ----------
    plan : Plan
        Finished; nothing is computed again but nominal poses.
    robot : Robot
        Whose parts are drawn.
    path : path
        File to write, replaced if it is there.

    Raises
    ------
    MachineError
        If the file cannot be written.
    """
    story = tell_plan(plan)
    scenario = plan.scenario
    floor = floor_height(plan.nominal.chain, robot)
    identity = f"{scenario.name}-plan-{scenario.seed}"
    name = f"{scenario.name}, plan, seed {scenario.seed}"
    with (
        strict_mode(),
        open_stream(Path(path), identity, name, plan_blueprint(story, floor)) as stream,
    ):
        writer = Pen(stream, story)
        draw_texts(writer)
        draw_cell(writer, robot, floor)
        draw_candidates(writer)
        draw_tour(writer)
        draw_goal(writer)
        _draw_curves(writer)


def plan_blueprint(story: PlanStory, floor: float) -> Any:
    """Layout of the viewer, embedded in the recording."""
    import rerun.blueprint as rrb

    plan = story.plan
    base = plan.nominal.chain.T_world_base[:3, 3]
    eye = camera(plan.pool.T[:, :3, 3], base, plan.T_world_tracker[:3, 3])
    top = rrb.Horizontal(
        cell_view(*eye, floor),
        rrb.Vertical(
            rrb.TextDocumentView(origin="/summary", name="Summary"),
            rrb.TextDocumentView(origin="/now", name="Now"),
            row_shares=[1.4, 1],
        ),
        column_shares=[2.5, 1.3],
    )
    names: dict[PlanPhaseName, str] = {
        "budget": "2 U in um by number: designed, bound, random",
        "tour": "3 U in um after each pose",
        "goal": "4 U in um at each goal pose",
    }
    plots = rrb.Horizontal(
        *(
            plot_over(phase.name, names[phase.name], phase.start, phase.stop)
            for phase in story.phases
            if phase.name in names
        )
    )
    bar = rrb.StateTimelineView(origin="/phase", name="Phase")
    return rrb.Blueprint(
        rrb.Vertical(top, bar, plots, row_shares=[6.5, 1.05, 2.4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="step", fps=FRAMES_PER_SECOND),
        auto_views=False,
    )


def _draw_curves(writer: Pen[PlanStory]) -> None:
    """Uncertainty by number of poses, after each pose of the tour, and at the goal [um]."""
    story, plan = writer.story, writer.story.plan
    k, curve = plan.scenario.plan.coverage * 1e6, plan.curve
    budget, tour, goal = story.phase("budget"), story.phase("tour"), story.phase("goal")
    top = 4.0 * k * float(np.median(curve.u))
    for name, values, color in (
        ("designed", curve.u, BLUE),
        ("no_set_below", curve.bound, VERMILION),
        ("random", curve.random, GRAY),
    ):
        _draw_below(writer, f"budget/{name}", budget, k * values, top, color)
    if curve.target is not None:
        target = np.full(len(curve.counts), k * curve.target)
        draw_curve(writer, "budget/target", budget, target, AMBER)
    measured = np.cumsum([role == "identify" for role in plan.tour.roles])
    # a held-out pose teaches nothing: the curve stays where it was
    after = np.concatenate([[np.nan], plan.u_of_step])[measured]
    known = after[np.isfinite(after)]
    limit = 4.0 * k * float(np.median(known)) if len(known) else 1.0
    _draw_below(writer, "tour/U", tour, k * after, limit, BLUE)
    draw_curve(writer, "goal/U", goal, k * plan.u[story.goals], BLUE)
    draw_curve(writer, "goal/mean", goal, np.full(len(story.goals), k * plan.u_mean), GRAY)


def _draw_below(
    writer: Pen[PlanStory], path: str, phase: PlanPhase, values: Array, top: float, color: Color
) -> None:
    """A curve without what is far too large or not there."""
    shown = np.flatnonzero(values <= top)
    draw_curve(writer, path, phase, values[shown], color, local=shown)
