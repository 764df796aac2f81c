"""The figures of a calibration's report, one function each: the record in, one SVG element out."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array, evenly
from calib.geometry.frames import inverse
from calib.measurement.prediction import tool_poses
from testbed.identify.calibration import Calibration
from testbed.identify.errors import of_poses
from testbed.lengths import with_unit
from testbed.report.plots import (
    CUT_OFF,
    SHADES,
    VIEWS,
    Look,
    dots,
    error_axis,
    legend_above,
    log_ticks,
    marked_line,
    view_of,
)
from testbed.report.svg import DARK, HALF_WIDTH, INK, LIGHT, MIDDLE, SOFT, WIDTH, drawing, svg_of
from testbed.units import DEG, MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PALE = "#d9c7bb"
"""Before, where after lies over it."""
BINS = 14
"""Stretches along an axis over which a median is drawn, at most."""
BARS, FEW_BARS, FEWEST_BARS = 40, 12, 5
"""Bars of a histogram at most, of few rows, and over how many of even width most errors after
spread at least."""
IN_A_STRETCH, LEAST = 7, 21
"""Points of which a median is drawn, and of how many at least any is."""
MOST_DOTS = 800
"""Of more rows this many, evenly spread, are drawn; medians and maps count all."""
FEW = 60
"""Fewer points than this are drawn as markers."""
OUT_LOOK: Look = {"linestyle": "none", "marker": "x", "color": MIDDLE, "markersize": 5.0}


def histogram(calibration: Calibration) -> str:
    """How many poses miss by how much, before and after."""
    rows = calibration.is_judged
    turning = rows & calibration.measurements.is_pose
    panels = [("position", rows, MM, "mm")]
    if turning.any():
        panels.append(("rotation", turning, DEG, "deg"))
    with drawing(1, len(panels), height=2.3) as (figure, axes):
        for ax, (name, which, scale, unit) in zip(axes, panels, strict=True):
            before, after = (
                of_poses(getattr(errors, name), calibration.measurements, which) * scale
                for errors in (calibration.before_misses, calibration.fit.misses)
            )
            edges = bars(before, after)
            top = float(edges[-1])
            for values, color, label, alpha in (
                (before, PALE, "before", 1.0),
                (after, DARK, "after", 0.75),
            ):
                ax.hist(
                    np.clip(values, edges[0], top), bins=edges.tolist(), color=color, alpha=alpha,
                    label=label, linewidth=0,
                )  # fmt: skip
                ax.axvline(float(values.mean()), color=SOFT if label == "before" else DARK,
                           linewidth=1.0, linestyle="--")  # fmt: skip
            point = calibration.proof.point
            if name == "position" and point is not None and point.radius_mean * scale < top:
                text = f"R95 {with_unit(point.radius_mean)}".replace("um", "µm")
                at = point.radius_mean * scale
                side = 4 if at < 0.8 * top else -4  # near the right end there is no room beyond
                marked_line(ax, at, text, side, color=INK, linewidth=0.9)
            if edges[0] > 0:
                ax.set_xscale("log")
                log_ticks(ax.xaxis, float(edges[0]), top)
            ranged = name == "position" and bool(calibration.measurements.is_distance.all())
            ax.set_xlabel(f"{'distance' if ranged else name} error [{unit}]")
            ax.set_ylabel("poses")
            ax.locator_params(axis="y", integer=True)
        legend_above(figure, axes[0])
        return svg_of(figure)


def bars(before: Array, after: Array) -> Array:
    """Edges of the bars that count errors (m,) before and after: even ones, so far as that shows.

    Where most errors after would stand in a few of them, bars are of equal ratio, on a logarithmic
    axis; what lies beyond its ends is counted in the outer ones. Few rows have few bars.
    """
    count = int(np.clip(3 * np.sqrt(len(after)), FEW_BARS, BARS))
    both = np.concatenate([before, after])
    top = float(np.quantile(both, 0.995)) or 1.0
    low, high = np.quantile(after, [0.05, 0.95])
    least = float(np.quantile(both, CUT_OFF))
    if (high - low) * count >= FEWEST_BARS * top or least <= 0:
        return np.linspace(0.0, top, count + 1)
    return np.geomspace(max(least, 1e-4 * top), top, count + 1)


def by_joint(calibration: Calibration) -> str:
    """Errors against each joint's value: a wave that is left says which joint is not as modeled."""
    q, kinds = calibration.measurements.q, calibration.nominal.chain.kinds
    panels = [
        (q[:, k] * (DEG if kind == "revolute" else MM), "deg" if kind == "revolute" else "mm")
        for k, kind in enumerate(kinds)
    ]
    titles = [f"joint {k + 1}" for k in range(len(kinds))]
    columns = min(4, len(kinds)) if len(kinds) != 6 else 3
    height = 0.4 + 1.6 * -(-len(kinds) // columns)
    return _against(calibration, panels, height=height, columns=columns, titles=titles)


def by_order(calibration: Calibration, width: float = WIDTH) -> str:
    """Errors over time, or over the order of the table where no time was kept."""
    table, after = calibration.measurements, calibration.fit.misses.position * MM
    if calibration.time is not None:
        x, label = calibration.time / 3600.0, "time since the first row [h]"
    else:
        x, label = np.arange(1.0, len(table) + 1), "row of the table"
    with drawing(1, 1, height=2.2, width=width) as (figure, (ax,)):
        for rows, color, marker, name in (
            (calibration.is_used, LIGHT, "s", "identified from"),
            (calibration.split.is_test, DARK, "o", "held out"),
        ):
            if rows.any():
                _cloud(ax, x[rows], after[rows], color, marker, name)
        judged = calibration.is_judged
        _median(ax, x[judged], after[judged], SOFT)
        out = calibration.gross.left_out
        if out.any():
            ax.plot(x[out], after[out], label="left out", **OUT_LOOK)
        error_axis(ax, after, float(np.median(after)))
        ax.set_xlabel(label)
        ax.set_ylabel("error after [mm]")
        legend_above(figure, ax)
        return svg_of(figure)


def by_temperature(calibration: Calibration) -> str:
    """Errors against the temperature that was noted."""
    temperature = calibration.conditions.temperature
    if temperature is None:
        return ""
    panels = [(temperature, "temperature [°C]")]
    return _against(calibration, panels, height=2.2, columns=1, width=HALF_WIDTH)


def over_workspace(calibration: Calibration) -> str:
    """Where in the workspace the errors are: from above and from the side, base frame."""
    rows = calibration.is_judged
    place = tool_places(calibration)[rows] * MM
    after = calibration.fit.misses.position[rows]
    steps = np.quantile(after, np.linspace(0, 1, len(SHADES) + 1)[1:-1])
    shade = np.searchsorted(steps, after)
    with drawing(1, 2, height=3.1) as (figure, axes):
        for ax, (i, j, view) in zip(axes, VIEWS, strict=True):
            for k, color in enumerate(SHADES):
                here = place[shade == k]
                if len(here):
                    _points(ax, here[:, i], here[:, j], color, "o")
            ax.plot(0, 0, "s", color=SOFT, markersize=4)
            view_of(ax, i, j, view)
        return svg_of(figure)


def has_medians(calibration: Calibration) -> bool:
    """Whether there are rows enough for running medians."""
    return int(calibration.is_judged.sum()) >= LEAST


def thinned(calibration: Calibration) -> str:
    """What a caption adds where not every row is drawn."""
    count = int(max(calibration.is_judged.sum(), calibration.is_used.sum()))
    if count <= MOST_DOTS:
        return ""
    return f" At most {MOST_DOTS} rows of a kind, evenly spread, are drawn; medians are of all."


def shade_steps(calibration: Calibration) -> tuple[float, float]:
    """Errors below which the map is palest and above which it is darkest [m]."""
    after = calibration.fit.misses.position[calibration.is_judged]
    low, high = np.quantile(after, [1 / len(SHADES), 1 - 1 / len(SHADES)])
    return float(low), float(high)


def tool_places(calibration: Calibration) -> Array:
    """(m, 3) tool positions of the chosen model in its base frame [m]."""
    model = calibration.fit.identification.model
    T = inverse(model.chain.T_world_base) @ tool_poses(model, calibration.measurements)
    return np.asarray(T[:, :3, 3])


def _against(
    calibration: Calibration,
    panels: list[tuple[Array, str]],
    *,
    height: float,
    columns: int,
    titles: Sequence[str] = (),
    width: float = WIDTH,
) -> str:
    """Errors before and after against several columns (m,), with their running medians."""
    rows = calibration.is_judged
    before = calibration.before_misses.position[rows] * MM
    after = calibration.fit.misses.position[rows] * MM
    lines = -(-len(panels) // columns)
    with drawing(lines, columns, height=height, width=width, sharey=True) as (figure, axes):
        for ax in axes[len(panels) :]:
            ax.set_visible(False)
        for k, (x, label) in enumerate(panels):
            ax = axes[k]
            _cloud(ax, x[rows], before, PALE, "s", "before")
            _cloud(ax, x[rows], after, DARK, "o", "after")
            _median(ax, x[rows], before, SOFT)
            _median(ax, x[rows], after, MIDDLE)
            ax.set_xlabel(label)
            if titles:
                ax.set_title(titles[k])
            if k % columns == 0:
                ax.set_ylabel("error [mm]")
        for ax in axes[: len(panels)]:
            lowest = float(min(np.median(before), np.median(after)))
            error_axis(ax, np.concatenate([before, after]), lowest)
        legend_above(figure, axes[0])
        return svg_of(figure)


def _cloud(ax: "Axes", x: Array, y: Array, color: str, marker: str, label: str) -> None:
    """Points with one entry in the legend."""
    _points(ax, x, y, color, marker)
    ax.plot([], [], linestyle="none", marker=marker, color=color, markersize=3.5, label=label)


def _points(ax: "Axes", x: Array, y: Array, color: str, marker: str) -> None:
    """Markers if they are few, else round dots as one path."""
    if len(x) > MOST_DOTS:
        drawn = evenly(np.arange(len(x)), MOST_DOTS)
        x, y = x[drawn], y[drawn]
    if len(x) < FEW:
        ax.plot(x, y, linestyle="none", marker=marker, color=color, markersize=3.2)
    else:
        dots(ax, np.column_stack([x, y]), color)


def _median(ax: "Axes", x: Array, y: Array, color: str) -> None:
    """Median over stretches of equally many points; none if there are too few."""
    if len(x) < LEAST or np.ptp(x) == 0:
        return
    parts = np.array_split(np.argsort(x, kind="stable"), min(BINS, len(x) // IN_A_STRETCH))
    ax.plot([np.median(x[p]) for p in parts], [np.median(y[p]) for p in parts], color=color)
