"""The screen of a recording: cell, texts, panels, phase bar and the curve windows of each phase."""

from typing import Any

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import rot_z
from testbed.recording.story import Panel, Story
from testbed.recording.timeline import Phase, Timeline

FRAMES_PER_SECOND = 24.0
ASIDE, TOWARD_TRACKER = np.radians(140.0), 0.13
"""Camera: turned so far from the tracker's direction, aimed at this part of the way to it."""


def blueprint(story: Story, timeline: Timeline) -> Any:
    """Layout of the viewer, embedded in the recording."""
    import rerun.blueprint as rrb

    texts = rrb.Vertical(
        rrb.TextDocumentView(origin="/summary", name="Summary"),
        rrb.TextDocumentView(origin="/now", name="Now"),
        row_shares=[1.4, 1],
    )
    panels = [chapter.panel for chapter in reversed(story.chapters) if chapter.panel is not None]
    planes = [_plane(panel) for panel in panels]
    beside = [rrb.Tabs(*planes, active_tab=0)] if len(planes) > 1 else planes
    widths = panels[0].columns if panels else (2.5, 1.3)
    plots = (
        _curves(origin, title, phase)
        for chapter, phase in zip(story.chapters, timeline.phases, strict=True)
        for origin, title in chapter.plots.items()
    )
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(_cell(story), texts, *beside, column_shares=widths),
            rrb.StateTimelineView(origin="/phase", name="Phase"),
            rrb.Horizontal(*plots),
            row_shares=[6.5, 1.05, 2.4],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="step", fps=FRAMES_PER_SECOND),
        auto_views=False,
    )


def _cell(story: Story) -> Any:
    """The robot's cell, the robot in front and the tracker in the background."""
    import rerun as rr
    import rerun.blueprint as rrb

    position, target = camera(story.reach, story.chain.T_world_base[:3, 3], story.station)
    return rrb.Spatial3DView(
        origin="/world",
        name="Cell",
        background=[246, 247, 249],
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=0.25,
            plane=rr.components.Plane3D.XY.with_distance(story.floor),
            color=[120, 130, 140, 70],
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=position,
            look_target=target,
            eye_up=(0, 0, 1),
        ),
    )


def camera(reach: Array, base: Array, station: Array) -> tuple[Array, Array]:
    """Eye and the point it looks at (3,), so that workspace and tracker are both in view [m].

    Parameters
    ----------
    reach : (N, 3) array
        Tool positions.
    base, station : (3,) array
        The robot's base and the tracker.
    """
    middle = (reach.mean(axis=0) + base) / 2
    radius = float(np.quantile(np.linalg.norm(reach - middle, axis=1), 0.95))
    away = station - middle
    away[2] = 0.0
    distance = float(np.linalg.norm(away))
    ahead = away / distance if distance > 0 else np.array([1.0, 0.0, 0.0])
    front = reach.mean(axis=0) - base
    sides = [rot_z(sign * ASIDE)[:3, :3] @ ahead for sign in (1, -1)]
    side = max(sides, key=lambda direction: float(direction @ front))
    target = middle + TOWARD_TRACKER * away - [0, 0, 0.2 * radius]
    return target + radius * (2.9 * side + np.array([0, 0, 1.15])), target


def _plane(panel: Panel) -> Any:
    """The window of a panel, all of it in view."""
    import rerun.blueprint as rrb

    return rrb.Spatial2DView(
        origin=f"/{panel.origin}",
        name=panel.title,
        visual_bounds=rrb.VisualBounds2D(x_range=panel.x, y_range=panel.y),
    )


def _curves(origin: str, title: str, phase: Phase) -> Any:
    """A curve window held on the steps of a phase."""
    import rerun as rr
    import rerun.blueprint as rrb

    start = rr.TimeRangeBoundary.absolute(seq=phase.start)
    end = rr.TimeRangeBoundary.absolute(seq=phase.stop - 1)
    return rrb.TimeSeriesView(
        origin=f"/{origin}",
        name=title,
        plot_legend=rrb.PlotLegend(visible=False),
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end)),
    )
