"""The tool point at the zero pose in the recording: two clouds fill up, their ranges grow."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from calib.arrays import Array, Index
from testbed.laboratory.truth.setting import Setting
from testbed.recording import style
from testbed.recording.cell import box_edges
from testbed.recording.chart import Chart, Series
from testbed.recording.pen import Pen, first
from testbed.recording.story import Chapter
from testbed.recording.style import Color
from testbed.recording.timeline import Motion, Phase, glide, spread
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.cloud.draws import SHOWN, Cloud, clouds_of, mean_half_width
from testbed.studies.wen2022.records import tool_point_of
from testbed.units import MM, fixed


@dataclass(frozen=True, slots=True)
class Look:
    """How a cloud and what belongs to it are drawn."""

    name: str
    short: str
    """In a legend."""
    color: Color
    """Of dots, box and curve."""
    label: Color
    """Of the words, which stand on gray."""
    dot: float
    """Radius of a dot on the screen [points]."""
    side: int
    """Where the words stand: above the clouds, or below."""


LOOKS = (
    Look("optimal set", "optimal", style.BLUE, (205, 225, 255), 1.7, 1),
    Look("random sets", "random", style.ORANGE, (255, 225, 185), 1.1, -1),
)
FEWEST, STAGES = 10, 24
"""Draws at first, and the steps in which they become all of them."""
CLOUD_SIZE = 0.35
"""Longest drawn range to one side [m]: seen beside the arm."""
GO, REST, FRAMES = 14, 10, 96
"""Frames of a way, at the zero pose, and for each pair of clouds."""


def chapter(campaign: Campaign) -> Chapter | None:
    """The draws at the zero pose, for each pair of budgets in turn; None where none were drawn."""
    clouds, study = clouds_of(campaign), tool_point_of(campaign)
    if not clouds or study is None:
        return None
    times = factor(clouds)
    fill = spread(STAGES * len(clouds), FRAMES * len(clouds))
    way = to_the_zero_pose_and_aside(campaign.setting)
    at_rest = np.repeat(way[-1:], fill.steps, axis=0)
    spreads = (
        f"- {whose}: u of x {fixed(best.u[0] * MM, 4)} and {fixed(random.u[0] * MM, 3)} mm"
        for whose, (best, random) in clouds.items()
    )
    return Chapter(
        name="draw",
        local="stage",
        color=(176, 96, 40),
        motion=Motion(len(way) + fill.steps, len(way) + fill.at, np.vstack([way, at_rest])),
        text=(
            "#### Draw: the tool point at the zero pose",
            f"- {study.draws} draws of independent numbers, as in Figure 7 of the paper",
            f"- blue: optimal set, orange: random sets, both drawn {times} times larger than life",
            f"- dots: the first {SHOWN} draws; boxes: ranges so far; ours of {study.trials[0]}",
            *spreads,
        ),
        draw=partial(_draw, clouds),
        lines=[
            f"{whose}: {count} draws"
            for whose, (best, _) in clouds.items()
            for count in stages(len(best.points))
        ],
        charts=charts(clouds),
    )


def charts(clouds: Mapping[str, tuple[Cloud, Cloud]]) -> tuple[Chart, ...]:
    """How the range of x grows with the draws, of each pair of clouds beside normal numbers."""
    found = []
    for k, (whose, pair) in enumerate(clouds.items()):
        local = np.arange(STAGES * k, STAGES * (k + 1))
        curves = []
        for cloud, look in zip(pair, LOOKS, strict=True):
            counts = stages(len(cloud.points))
            reach = [np.ptp(cloud.points[:count, 0]) / 2 / cloud.u[0] for count in counts]
            key = cloud.source.replace(" ", "_")
            curves.append(Series(key, np.array(reach), look.color, look.short, local))
        counts = stages(len(pair[0].points))
        expected = mean_half_width(counts.tolist())
        curves.append(Series(f"normal_{k}", expected, style.MUTED_COLOR, "normal", local))
        places = np.tile(np.log10(counts), len(clouds))
        found.append(Chart("draw", f"Half range of x / u by log10(draws): {whose}", curves, places))
    return tuple(found)


def to_the_zero_pose_and_aside(setting: Setting) -> Array:
    """Joint values (s, n): the robot shows the zero pose, then leaves the view to the clouds."""
    q = setting.test_q
    lowest = q[setting.nominal.poses(q)[:, 2, 3].argmin()]
    zero = np.zeros((1, q.shape[1]))
    there, aside = (
        glide(np.vstack(stops), 2 * GO)[GO:] for stops in ((q[-1], zero), (zero, lowest))
    )
    return np.vstack([there, np.repeat(zero, REST, axis=0), aside])


def factor(clouds: Mapping[str, tuple[Cloud, Cloud]]) -> int:
    """How many times larger than life all clouds are drawn."""
    size = max(float(np.abs(one.ends).max()) for pair in clouds.values() for one in pair)
    return style.nice_factor(CLOUD_SIZE, size)


def stages(draws: int) -> Index:
    """Numbers of draws (`STAGES`,) that have been made at each stage."""
    return np.round(np.geomspace(min(FEWEST, draws), draws, STAGES)).astype(np.int64)


def _draw(clouds: Mapping[str, tuple[Cloud, Cloud]], pen: Pen, phase: Phase) -> None:
    """One pair of clouds after the other, far larger than life."""
    times = factor(clouds)
    for k, (whose, pair) in enumerate(clouds.items()):
        local = np.arange(STAGES * k, STAGES * (k + 1))
        end = phase.at[local[-1] + 1] if k + 1 < len(clouds) else phase.stop
        away = 1.5 * times * float(np.abs(pair[1].ends[2]).max())
        for cloud, look in zip(pair, LOOKS, strict=True):
            source, words = cloud.source.replace(" ", "_"), f"{look.name}, {whose}"
            path = f"world/zero_pose_x{times}/{source}"
            _draw_cloud(pen, path, phase, local, cloud, times, look)
            place = cloud.nominal + np.array([0, 0, look.side * away])
            _draw_label(pen, f"{path}/label", int(phase.at[local[0]]), place, words, look.label)
            pen.clear(int(end), path, f"{path}/range", f"{path}/label")


def _draw_cloud(
    pen: Pen, path: str, phase: Phase, local: Index, cloud: Cloud, times: int, look: Look
) -> None:
    """A cloud that fills up, and the box of the draws so far."""
    import rerun as rr

    counts = stages(len(cloud.points))
    lengths = np.minimum(counts, len(cloud.shown))
    points = cloud.nominal + times * cloud.shown
    columns = rr.Points3D.columns(positions=first(points, lengths)).partition(lengths)
    pen.rows(path, phase, columns, local)
    pen.static(
        path, rr.Points3D.from_fields(radii=rr.Radius.ui_points(look.dot), colors=look.color)
    )
    boxes = np.array([_box(cloud, count, times) for count in counts])
    strips = rr.LineStrips3D.columns(strips=boxes.reshape(-1, 2, 3)).partition([12] * len(counts))
    pen.rows(f"{path}/range", phase, strips, local)
    pen.static(f"{path}/range", rr.LineStrips3D.from_fields(radii=0.0008, colors=look.color))


def _box(cloud: Cloud, count: int, times: int) -> Array:
    """Edges (12, 2, 3) of the box of the first draws, larger than life [m]."""
    low, high = (end(cloud.points[:count], axis=0) for end in (np.min, np.max))
    return box_edges(cloud.nominal + times * (low + high) / 2, times * (high - low))


def _draw_label(pen: Pen, path: str, step: int, place: Array, text: str, color: Color) -> None:
    """Words in the cell."""
    import rerun as rr

    # a label has the color of its point, and stands on gray
    pen.at(
        step, path, rr.Points3D([place], labels=[text], radii=1e-4, colors=color, show_labels=True)
    )
