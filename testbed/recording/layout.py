"""The layout of the screens: a cell, words, bar of phases, charts and planes, for each window."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.geometry.frames import rot_z
from testbed.recording.chart import ROOT, SIZE
from testbed.recording.story import Chapter, Panel, Story, Window
from testbed.recording.timeline import Timeline

FRAMES_PER_SECOND = 24.0
WIDTHS = (1.5, 1.0), (1.0, 1.05, 1.55)
"""Of cell and texts, and of both beside a tall plane."""
ROWS = (5.45, 0.9, 3.65)
"""Heights of cell, bar of phases and charts: in a window of 1280 by 720 all words have room."""
TEXTS, BELOW_NAMES, FEWER_TEXTS = (0.82, 1.97, 2.66), (0.82, 2.12, 2.51), (0.82, 4.63)
"""Of the line, the words of now and, unless it stands beside the charts, the summary; the second
where the names of windows take some height."""
ASIDE, AT_TRACKER, AT_ROBOT = np.radians(140.0), (0.13, 3.12), (0.0, 2.2)
"""Camera: turned so far from the tracker's direction; where it looks and how far off it is, with a
tracker in view and without one."""
OPENING, ASPECT, TALL_ASPECT, FILLED = np.radians(55.0), 1.4, 1.05, 0.92
"""The viewer's angle of view from bottom to top, the cell's width over its height (less beside a
tall plane), and the part of both in which the axes of bodies stay: the bodies are thicker."""


def blueprint(story: Story, timeline: Timeline) -> Any:
    """Layout of the viewer, embedded in the recording: the cell and what is said of it above.

    Below are the bar of phases, the charts of the phase, and planes or else the summary.
    """
    import rerun.blueprint as rrb

    screens = [_screen(story, timeline, window) for window in story.screens]
    return rrb.Blueprint(
        screens[0] if len(screens) == 1 else rrb.Tabs(*screens, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="step", fps=FRAMES_PER_SECOND),
        auto_views=False,
    )


def _screen(story: Story, timeline: Timeline, window: Window) -> Any:
    """All that one window shows: its cell, words, charts and planes."""
    import rerun.blueprint as rrb

    chapters, at = story.chapters_in(window), window.words
    panels = [chapter.panel for chapter in reversed(chapters) if chapter.panel is not None]
    tall = [_plane(panel) for panel in panels if panel.tall]
    low = [_plane(panel) for panel in panels if not panel.tall]
    line, now, summary = (
        rrb.TextDocumentView(origin=f"/{at}{name}", name=name.capitalize(), titlebar=False)
        for name in ("line", "now", "summary")
    )
    few = bool(tall) or not low  # beside a tall plane the words of now need all the room
    whole = BELOW_NAMES if story.windows else TEXTS
    texts, heights = ([line, now], FEWER_TEXTS) if few else ([line, now, summary], whole)
    low = [summary, *low] if few else low
    above = [cell(story, timeline, window), rrb.Vertical(*texts, row_shares=heights)]
    charts = [_chart(at), *_curves(chapters, timeline, window)]
    return rrb.Vertical(
        rrb.Horizontal(*above, *_stacked(tall), column_shares=WIDTHS[bool(tall)]),
        rrb.StateTimelineView(origin="/phase", name="Phase", titlebar=False),
        rrb.Horizontal(rrb.Tabs(*charts, active_tab=0), *_stacked(low)),
        row_shares=ROWS,
        name=window.name,
    )


def _stacked(views: Sequence[Any]) -> list[Any]:
    """Views on top of each other; none where there are none."""
    import rerun.blueprint as rrb

    return [rrb.Tabs(*views, active_tab=0)] if len(views) > 1 else list(views)


def cell(story: Story, timeline: Timeline, window: Window) -> Any:
    """The robot's cell, the robot in front and the tracker in the background.

    What is of one window only, the others do not show.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    contents = [
        "+ /world/**",
        *(f"- /{one.root}/**" for one in story.windows if one.root),
        *(f"- /{path}" for path in window.hidden),
        *([f"+ /{window.root}/**"] if window.root else []),
    ]

    moving = story.moving(timeline.q)
    beside = [story.station] if story.has_tracker else []
    drawn = np.vstack([moving, *beside, *([story.reach] if story.chain is None else [])])
    tall = any(one.panel is not None and one.panel.tall for one in story.chapters)
    middle = story.reach.mean(axis=0)
    base = middle if story.chain is None else story.chain.T_world_base[:3, 3]
    aspect = TALL_ASPECT if tall else ASPECT
    look = AT_TRACKER if story.has_tracker else AT_ROBOT
    position, target = camera(story.reach, base, story.station, drawn, aspect, look)
    return rrb.Spatial3DView(
        origin="/world",
        contents=contents,
        name="Cell",
        titlebar=False,
        background=[246, 247, 249],
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=0.25,
            plane=rr.components.Plane3D.XY.with_distance(story.floor),
            color=[120, 130, 140, 70],
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=(0, 0, 1)
        ),
    )


def camera(
    reach: Array,
    base: Array,
    station: Array,
    drawn: Array,
    aspect: float = ASPECT,
    look: tuple[float, float] = AT_TRACKER,
) -> tuple[Array, Array]:
    """Eye and the point it looks at (3,), so that workspace, robot and tracker are in view [m].

    Parameters
    ----------
    reach : (N, 3) array
        Tool positions.
    base, station : (3,) array
        The robot's base and the tracker.
    drawn : (k, 3) array
        Where bodies and tools are at any step, and whatever else must be in view.
    aspect : float
        Width of the window over its height.
    look : (float, float)
        Part of the way to the tracker at which the eye looks, and how far off it is at least, in
        sizes of the workspace.
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
    target = middle + look[0] * away - [0, 0, 1.5 * look[0] * radius]
    back = 2.9 * side + np.array([0, 0, 1.15])
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(back, right), back]) @ (drawn - target).T
    # a point is in view if it is nearer to the line of sight than its share of its depth
    depth = np.maximum(np.abs(x) / aspect, np.abs(y)) / (FILLED * np.tan(OPENING / 2)) + z
    return target + max(look[1] * radius, float(depth.max())) * back, target


def _plane(panel: Panel) -> Any:
    """The window of a panel, all of it in view."""
    import rerun.blueprint as rrb

    return rrb.Spatial2DView(
        origin=f"/{panel.origin}",
        name=panel.title,
        visual_bounds=rrb.VisualBounds2D(x_range=panel.x, y_range=panel.y),
    )


def _chart(words: str) -> Any:
    """The window of the charts of the phase that is played."""
    import rerun.blueprint as rrb

    width, height = SIZE
    return rrb.Spatial2DView(
        origin=f"/{words}{ROOT}",
        name="Chart",
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, width), y_range=(0.0, height)),
    )


def _curves(chapters: Sequence[Chapter], timeline: Timeline, window: Window) -> list[Any]:
    """The same curves over the steps of their phases, one behind the other, to read numbers off."""
    import rerun as rr
    import rerun.blueprint as rrb

    bound, views = rr.TimeRangeBoundary.absolute, []
    for chapter, phase in zip(chapters, timeline.phases, strict=True):
        words = window.words if window.owns(chapter) else ""
        stretch = rr.TimeRange(start=bound(seq=phase.start), end=bound(seq=phase.stop - 1))
        views += [
            rrb.TimeSeriesView(
                origin=f"/{words}{chart.origin}",
                name=f"{chart.origin.replace('/', ', ')} by step",
                plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=True),
                axis_x=rrb.TimeAxis(view_range=stretch),
            )
            for chart in chapter.charts
        ]
    return views
