"""The figures of a calibration's report, one function each: the record in, one SVG element out."""

from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array, Bool
from calib.geometry.frames import inverse
from testbed.identify.records import Calibration
from testbed.report.plots import SHADES, VIEWS, Look, dots, legend_above, plain_log, view_of
from testbed.report.svg import DARK, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.units import DEG, MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PALE = "#d9c7bb"
"""Before, where after lies over it."""
BINS = 14
"""Stretches along an axis over which a median is drawn."""
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
                getattr(misses, name)[which] * scale
                for misses in (calibration.before_misses, calibration.fit.misses)
            )
            top = float(np.quantile(np.concatenate([before, after]), 0.995)) or 1.0
            edges = np.linspace(0.0, top, 41)
            for values, color, label, alpha in (
                (before, PALE, "before", 1.0),
                (after, DARK, "after", 0.75),
            ):
                ax.hist(
                    np.minimum(values, top), bins=edges.tolist(), color=color, alpha=alpha,
                    label=label, linewidth=0,
                )  # fmt: skip
                ax.axvline(float(values.mean()), color=SOFT if label == "before" else DARK,
                           linewidth=1.0, linestyle="--")  # fmt: skip
            ax.set_xlabel(f"{name} error [{unit}]")
            ax.set_ylabel("rows")
        legend_above(figure, axes[0])
        return svg_of(figure)


def by_joint(calibration: Calibration) -> str:
    """Errors against each joint's value: a wave that is left says which joint is not as modeled."""
    rows = calibration.is_judged
    q = calibration.measurements.q[rows]
    kinds = calibration.nominal.chain.kinds
    columns = min(4, q.shape[1]) if q.shape[1] != 6 else 3
    lines = -(-q.shape[1] // columns)
    with drawing(lines, columns, height=0.4 + 1.6 * lines, sharey=True) as (figure, axes):
        for k, ax in enumerate(axes):
            ax.set_visible(k < q.shape[1])
            if k >= q.shape[1]:
                continue
            turning = kinds[k] == "revolute"
            x = q[:, k] * (DEG if turning else MM)
            _both(ax, x, calibration, rows)
            ax.set_title(f"joint {k + 1}")
            ax.set_xlabel("deg" if turning else "mm")
            if k % columns == 0:
                ax.set_ylabel("error [mm]")
        _from_zero(axes[0], calibration, rows)
        legend_above(figure, axes[0])
        return svg_of(figure)


def by_order(calibration: Calibration) -> str:
    """Errors over time, or over the order of the table where no time was kept."""
    table, after = calibration.measurements, calibration.fit.misses.position * MM
    if calibration.time is not None:
        x, label = calibration.time / 3600.0, "time since the first row [h]"
    else:
        x, label = np.arange(1.0, len(table) + 1), "row of the table"
    with drawing(1, 1, height=2.2) as (figure, (ax,)):
        for rows, color, marker, name in (
            (calibration.is_used, LIGHT, "s", "identified from"),
            (calibration.split.is_test, DARK, "o", "held out"),
        ):
            if rows.any():
                _cloud(ax, x[rows], after[rows], color, marker, name)
        judged = calibration.is_judged
        _median(ax, x[judged], after[judged], DARK)
        out = calibration.gross.left_out
        if out.any():
            ax.plot(x[out], after[out], label="left out", **OUT_LOOK)
        ax.set_yscale("log")
        plain_log(ax)
        ax.set_xlabel(label)
        ax.set_ylabel("error after [mm]")
        legend_above(figure, ax)
        return svg_of(figure)


def by_place(calibration: Calibration) -> str:
    """Errors against x, y and z of the tool in the base frame."""
    rows = calibration.is_judged
    place = tool_places(calibration)[rows] * MM
    with drawing(1, 3, height=2.1, sharey=True) as (figure, axes):
        for k, ax in enumerate(axes):
            _both(ax, place[:, k], calibration, rows)
            ax.set_xlabel(f"{'xyz'[k]} [mm]")
        axes[0].set_ylabel("error [mm]")
        _from_zero(axes[0], calibration, rows)
        legend_above(figure, axes[0])
        return svg_of(figure)


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


def by_temperature(calibration: Calibration) -> str:
    """Errors against the temperature that was noted."""
    rows = calibration.is_judged
    if calibration.temperature is None:
        return ""
    with drawing(1, 1, height=1.9) as (figure, (ax,)):
        _both(ax, calibration.temperature[rows], calibration, rows)
        _from_zero(ax, calibration, rows)
        ax.set_xlabel("temperature [°C]")
        ax.set_ylabel("error [mm]")
        legend_above(figure, ax)
        return svg_of(figure)


def tool_places(calibration: Calibration) -> Array:
    """(m, 3) tool positions of the chosen model in its base frame [m]."""
    model = calibration.fit.identification.model
    T = inverse(model.chain.T_world_base) @ model.poses(calibration.measurements.q)
    return np.asarray(T[:, :3, 3])


def _both(ax: "Axes", x: Array, calibration: Calibration, rows: Bool) -> None:
    """Errors before and after against something, with their running medians."""
    before = calibration.before_misses.position[rows] * MM
    after = calibration.fit.misses.position[rows] * MM
    _cloud(ax, x, before, PALE, "s", "before")
    _cloud(ax, x, after, DARK, "o", "after")
    _median(ax, x, before, SOFT)
    _median(ax, x, after, MIDDLE)


def _from_zero(ax: "Axes", calibration: Calibration, rows: Bool) -> None:
    """The vertical axis from zero to where all but a few rows lie."""
    before = calibration.before_misses.position[rows]
    after = calibration.fit.misses.position[rows]
    ax.set_ylim(0, 1.05 * MM * float(max(np.quantile(before, 0.99), np.quantile(after, 0.99))))


def _cloud(ax: "Axes", x: Array, y: Array, color: str, marker: str, label: str) -> None:
    """Points with one entry in the legend."""
    _points(ax, x, y, color, marker)
    ax.plot([], [], linestyle="none", marker=marker, color=color, markersize=3.5, label=label)


def _points(ax: "Axes", x: Array, y: Array, color: str, marker: str) -> None:
    """Markers if they are few, else round dots as one path."""
    if len(x) > MOST_DOTS:
        drawn = np.linspace(0, len(x) - 1, MOST_DOTS).round().astype(np.int64)
        x, y = x[drawn], y[drawn]
    if len(x) < FEW:
        ax.plot(x, y, linestyle="none", marker=marker, color=color, markersize=3.2)
    else:
        dots(ax, np.column_stack([x, y]), color)


def _median(ax: "Axes", x: Array, y: Array, color: str) -> None:
    """Median over stretches of equally many points; none if there are too few."""
    if len(x) < 4 * BINS or np.ptp(x) == 0:
        return
    parts = np.array_split(np.argsort(x, kind="stable"), BINS)
    ax.plot([np.median(x[p]) for p in parts], [np.median(y[p]) for p in parts], color=color)
