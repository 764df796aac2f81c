"""The screen of a recording: cell, texts, parameters, phase bar and one plot window per phase."""

from typing import Any

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import rot_z
from testbed.recording.curves import parameter_bounds
from testbed.recording.story import Phase, PhaseName, Story
from testbed.studies.coverage import recording as recording_coverage
from testbed.studies.coverage.records import MODELS

FRAMES_PER_SECOND = 24.0
ASIDE, TOWARD_TRACKER = np.radians(140.0), 0.13
"""Camera: turned so far from the tracker's direction, aimed at this part of the way to it."""
PLOTS: dict[PhaseName, tuple[tuple[str, str], ...]] = {
    "select": (("select", "1 Index, best so far (gray: best random)"),),
    "measure": (("measure", "2 Seen mm: red before, green after"),),
    "identify": (("identify", "3 log10(sum of squares / dof)"),),
    "evaluate": (("evaluate", "4 Held-out mm: red before, green after"),),
    "compensate": (("compensate", "5 AP µm: red before, green after, gray noise floor"),),
    "coverage": tuple((f"coverage/{m}", f"5 Inside %: {m}") for m in MODELS),
}
"""Root and title of the curve windows of each phase."""


def blueprint(story: Story, floor: float, kinds: int = 0) -> Any:
    """Layout of the viewer, embedded in the recording.

    Parameters
    ----------
    story : Story
        What is told.
    floor : float
        Its height in the world [m].
    kinds : int
        Kinds of robots in the coverage study, which gets a window beside the parameters.
    """
    import rerun.blueprint as rrb

    numbers = parameters(story)
    if kinds:
        numbers = rrb.Tabs(recording_coverage.panel(kinds), numbers, active_tab=0)
    top = rrb.Horizontal(
        cell(story, floor),
        rrb.Vertical(
            rrb.TextDocumentView(origin="/summary", name="Summary"),
            rrb.TextDocumentView(origin="/now", name="Now"),
            row_shares=[1.35, 1],
        ),
        numbers,
        column_shares=[1.5, 1, 1.7] if kinds else [2.5, 1.2, 1],
    )
    bar = rrb.StateTimelineView(origin="/phase", name="Phase")
    plots = rrb.Horizontal(*(view for phase in story.phases for view in plot(phase)))
    return rrb.Blueprint(
        rrb.Vertical(top, bar, plots, row_shares=[6.5, 1.05, 2.4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="step", fps=FRAMES_PER_SECOND),
        auto_views=False,
    )


def cell(story: Story, floor: float) -> Any:
    """The robot's cell, the robot in front and the tracker in the background."""
    setting = story.setting
    pool, chain = setting.pool_nominal[:, :3, 3], setting.nominal.chain
    return cell_view(
        *camera(pool, chain.T_world_base[:3, 3], setting.T_world_tracker[:3, 3]), floor
    )


def cell_view(position: Array, target: Array, floor: float) -> Any:
    """A view of the world from `position` (3,) toward `target` (3,), with a floor at a height."""
    import rerun as rr
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="/world",
        name="Cell",
        background=[246, 247, 249],
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=0.25,
            plane=rr.components.Plane3D.XY.with_distance(floor),
            color=[120, 130, 140, 70],
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=position,
            look_target=target,
            eye_up=(0, 0, 1),
        ),
    )


def camera(pool: Array, base: Array, station: Array) -> tuple[Array, Array]:
    """Eye and the point it looks at (3,), so that workspace and tracker are both in view [m].

    Parameters
    ----------
    pool : (N, 3) array
        Tool positions.
    base, station : (3,) array
        The robot's base and the tracker.
    """
    middle = (pool.mean(axis=0) + base) / 2
    radius = float(np.quantile(np.linalg.norm(pool - middle, axis=1), 0.95))
    away = station - middle
    away[2] = 0.0
    distance = float(np.linalg.norm(away))
    ahead = away / distance if distance > 0 else np.array([1.0, 0.0, 0.0])
    front = pool.mean(axis=0) - base
    sides = [rot_z(sign * ASIDE)[:3, :3] @ ahead for sign in (1, -1)]
    side = max(sides, key=lambda direction: float(direction @ front))
    target = middle + TOWARD_TRACKER * away - [0, 0, 0.2 * radius]
    return target + radius * (2.9 * side + np.array([0, 0, 1.15])), target


def plot(phase: Phase) -> tuple[Any, ...]:
    """The curve windows of a phase, held on the phase's stretch of the timeline."""
    return tuple(
        plot_over(origin, name, phase.start, phase.stop) for origin, name in PLOTS[phase.name]
    )


def plot_over(origin: str, name: str, start: int, stop: int) -> Any:
    """A curve window held on the steps from `start` to before `stop`."""
    import rerun as rr
    import rerun.blueprint as rrb

    boundary = rr.TimeRangeBoundary
    hidden = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(
        origin=f"/{origin}",
        name=name,
        plot_legend=hidden,
        axis_x=rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=boundary.absolute(seq=start), end=boundary.absolute(seq=stop - 1)
            )
        ),
    )


def parameters(story: Story) -> Any:
    """The parameter plot, all rows in view."""
    import rerun.blueprint as rrb

    x, y = parameter_bounds(story.estimate.identification.parameters.n_free)
    return rrb.Spatial2DView(
        origin="/parameters",
        name="Parameter error / stated u",
        visual_bounds=rrb.VisualBounds2D(x_range=x, y_range=y),
    )
