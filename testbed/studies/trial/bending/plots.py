"""The figures of what bends an arm, one function each: numbers in, one SVG element out."""

from collections.abc import Mapping
from itertools import cycle

import numpy as np

from calib.arrays import Array
from testbed.report.plots import (
    SHADES,
    TICKS,
    dots,
    legend_above,
    legend_entries,
    marked_line,
    plain_log,
)
from testbed.report.svg import DARK, HALF_WIDTH, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.bending.sag import Sag
from testbed.units import DEG, MM, UM, micrometres, significant

COLUMNS = 4
"""Loops beside each other."""


def sag_maps(sag: Sag) -> str:
    """Sag and what the model leaves, in one scale of shades, over the plane of the arm."""
    steps = shade_steps(max(float(sag.size.max()), float(sag.left.max())) * UM)
    panels = (("gravity moves the tool", sag.size), ("what the model leaves", sag.left))
    share = {"sharex": True, "sharey": True}
    with drawing(1, 2, height=3.1, width=HALF_WIDTH, **share) as (figure, axes):
        for ax, (title, size) in zip(axes, panels, strict=True):
            shade = np.searchsorted(steps, size * UM)
            for k, color in enumerate(SHADES):
                if (shade == k).any():
                    dots(ax, MM * sag.place[shade == k], color, 3.4)
            ax.plot(0, 0, "s", color=SOFT, markersize=4)
            ax.set(title=title, xlabel="from the base [mm]")
            ax.set_aspect("equal")
        axes[0].set_ylabel("height above the base [mm]")
        low, high = [*steps, np.inf], [0.0, *steps]
        names = [
            f"> {a:g} µm" if np.isinf(b) else f"{a:g} to {b:g}"
            for a, b in zip(high, low, strict=True)
        ]
        looks = {
            name: {"marker": "o", "color": color} for name, color in zip(names, SHADES, strict=True)
        }
        legend_entries(axes[0], looks)
        legend_above(figure, axes[0], 3)
        return svg_of(figure)


def loops(motion: Ways) -> str:
    """What each link and the tool are beside rest, on the way down and on the way up."""
    degrees = DEG * 1e3
    panels = [
        (f"joint {k + 1}: {significant(degrees * width, 2)} mdeg", x * degrees, y * degrees)
        for k, (width, x, y) in enumerate(
            zip(motion.loop_width, motion.loop_command.T, motion.loop_turn.T, strict=True)
        )
    ]
    share = motion.loop_command[:, 0] / np.abs(motion.loop_command[:, 0]).max()
    tool = f"tool: {micrometres(motion.tool_width, 2)} µm"
    panels.append((tool, 100 * share, UM * motion.loop_tool))
    half = len(share) // 2
    lines = -(-len(panels) // COLUMNS)
    with drawing(lines, COLUMNS, height=0.3 + 1.75 * lines) as (figure, axes):
        for ax in axes[len(panels) :]:
            ax.set_visible(False)
        for k, (ax, (title, x, y)) in enumerate(zip(axes, panels, strict=False)):
            last = k == len(panels) - 1
            for part, color, style, name in (
                (slice(half, None), DARK, "-", "motors turn up"),
                (slice(half + 1), MIDDLE, "--", "down"),
            ):
                ax.plot(x[part], y[part], color=color, linestyle=style, label=name)
            ax.set_title(title)
            ax.set_xlabel("way [%]" if last else "motor [mdeg]")
            if last or k % COLUMNS == 0:
                ax.set_ylabel("tool beside rest [µm]" if last else "link beside rest [mdeg]")
        legend_above(figure, axes[0])
        return svg_of(figure)


def dying_away(dwell: Array, kinds: Mapping[str, tuple[Array, Array]], own: float = -1.0) -> str:
    """Mean and largest distance (d,) [m] from rest after dwells (d,) [s], of kinds of ways.

    `own` is the dwell of a campaign, which is marked; below zero there is none.
    """
    styles = (("-", DARK), ("--", MIDDLE), (":", SOFT), ("-.", LIGHT))
    with drawing(1, 1, height=2.5) as (figure, (ax,)):
        for (name, (mean, most)), (style, color) in zip(kinds.items(), cycle(styles), strict=False):
            ax.plot(dwell, UM * mean, color=color, linestyle=style, label=f"{name}mean")
            ax.plot(
                dwell, UM * most, color=color, linestyle=style, linewidth=0.6,
                label=f"{name}largest",
            )  # fmt: skip
        if own >= 0:
            marked_line(ax, own, "the tracker looks", -3, color=SOFT, linewidth=1.0)
        ax.set_yscale("log")
        plain_log(ax)
        ax.set_xlabel("since the motors stopped [s]")
        ax.set_ylabel("tool from rest [µm]")
        legend_above(figure, ax, len(kinds) if len(kinds) > 1 else None)
        return svg_of(figure)


def shade_steps(largest: float) -> Array:
    """The steps between six shades: the last five of 1, 2, 5, 10 ... below the largest value."""
    below = [tick for tick in TICKS if tick < largest]
    return np.array(below[1 - len(SHADES) :])
