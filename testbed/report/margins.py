"""Where the panels of a figure stand: room for the words around them, from the words' own lengths.

Matplotlib's constrained layout draws every text twice to measure it, at half the cost of a figure.
Here widths are estimated from the letters, which is enough for margins.
"""

from collections.abc import Iterable
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.layout_engine import LayoutEngine

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

POINTS = 72.0
"""In an inch."""
NARROW, WIDE = frozenset(" .,:;'|!()[]ijlIrtf"), frozenset("mwMW%@−")
LINE = 1.25
"""Height of a line of text over its size."""
PAD = 4.0
"""Between a panel's frame and its words, and around a figure [pt]."""
GAP = 8.0
"""Between panels that have no words in between [pt]."""
ROUGH = 0.6
"""Share of its column that a panel fills at least; only for labels at its edges."""
BOLD = 1.1
"""Width of bold letters over that of plain ones."""
BAR = 9.0
"""Width of a bar of colors [pt]."""


class Margins(LayoutEngine):
    """Positions of the panels of one grid, of the legend above them and of a bar beside them."""

    _adjust_compatible = True
    _colorbar_gridspec = False

    def execute(self, fig: "Figure") -> None:
        """Place every panel; nothing is drawn."""
        bars = [ax for ax in fig.axes if hasattr(ax, "_colorbar")]
        panels = [ax for ax in fig.axes if ax.get_subplotspec() is not None and ax not in bars]
        if not panels:
            return
        width, height = fig.get_size_inches() * POINTS
        top = PAD + sum(map(_legend_height, fig.legends))
        right = width - PAD - (BAR + GAP + _words(bars[0].yaxis) if bars else 0.0)
        grid = panels[0].get_gridspec()
        assert grid is not None  # they are subplots
        before, after = _sides(panels, grid, width / grid.ncols)
        columns = _shares(PAD, right, before[0], after[0], grid.get_width_ratios())
        rows = _shares(top, height - PAD, before[1], after[1], grid.get_height_ratios())
        for ax in panels:
            spec = ax.get_subplotspec()
            assert spec is not None
            x0, x1 = columns[spec.colspan.start][0], columns[spec.colspan.stop - 1][1]
            y0, y1 = rows[spec.rowspan.start][0], rows[spec.rowspan.stop - 1][1]
            box = (x0 / width, 1 - y1 / height, (x1 - x0) / width, (y1 - y0) / height)
            ax.set_position(box)
        for bar in bars:
            low, high = 1 - rows[-1][1] / height, 1 - rows[0][0] / height
            bar.set_box_aspect(None)
            bar.set_position(((right + GAP) / width, low, BAR / width, high - low))


def _sides(panels: Iterable["Axes"], grid: "GridSpec", share: float) -> tuple[list[Any], list[Any]]:
    """Room before and after each column about so wide, and above and below each row [pt]."""
    shape = (grid.ncols, grid.nrows)
    before, after = ([np.zeros(n) for n in shape] for _ in range(2))
    for ax in panels:
        spec = ax.get_subplotspec()
        if spec is None or not ax.axison:
            continue
        column, row = spec.colspan, spec.rowspan
        first, last = _overhangs(ax.xaxis, share)
        title = ax.get_title("left")
        last = max(last, BOLD * _length(title, 8.5) - ROUGH * share)
        left = max(_words(ax.yaxis), first)  # asks for the ticks, on which their factor hangs
        above = LINE * 8.5 * (title.count("\n") + 1) if title else 0.0
        above += LINE * 7.5 if ax.yaxis.get_major_formatter().get_offset() else 0.0
        for side, place, room in (
            (before[0], column.start, left),
            (after[0], column.stop - 1, last),
            (before[1], row.start, above + PAD),
            (after[1], row.stop - 1, _words(ax.xaxis)),
        ):
            side[place] = max(side[place], room)
    return before, after


def _shares(
    low: float, high: float, before: Any, after: Any, ratios: Any
) -> list[tuple[float, float]]:
    """Where columns or rows begin and end between two edges, in the ratio asked for [pt]."""
    part = np.asarray(ratios, dtype=np.float64)
    between = GAP * (len(part) - 1)
    size = (high - low - before.sum() - after.sum() - between) * part / part.sum()
    found, at = [], low
    for k, each in enumerate(size):
        at += before[k]
        found.append((at, at + max(float(each), 1.0)))
        at += max(float(each), 1.0) + after[k] + GAP
    return found


def _words(axis: "Axis") -> float:
    """Room across an axis for its tick labels and its name [pt]."""
    upright = axis is axis.axes.yaxis
    shown = axis.get_tick_params().get("labelleft" if upright else "labelbottom", True)
    if hasattr(axis.axes, "_colorbar"):
        shown = True
    labels = [text for _, text in _ticks(axis)] if shown else []
    size = 7.5
    room = 0.0
    if labels:
        turned = axis.get_major_ticks(1)[0].label1.get_rotation() != 0
        lines = max(label.count("\n") for label in labels) + 1
        along = upright or turned
        room = PAD + 3 + (max(_length(t, size) for t in labels) if along else LINE * size * lines)
    name = axis.get_label_text()
    return room + (LINE * 8.0 * (name.count("\n") + 1) + PAD if name else 0.0)


def _overhangs(axis: "Axis", across: float) -> tuple[float, float]:
    """How far the first and the last label of an x axis about so long stick out of it [pt]."""
    shown = _ticks(axis)
    if not shown or axis.get_major_ticks(1)[0].label1.get_rotation():
        return 0.0, 0.0
    (first, text), (last, other) = shown[0], shown[-1]
    return (
        max(_length(text, 7.5) / 2 - first * ROUGH * across, 0.0),
        max(_length(other, 7.5) / 2 - (1 - last) * ROUGH * across, 0.0),
    )


def _ticks(axis: "Axis") -> list[tuple[float, str]]:
    """Ticks within view that have a label: where along the axis, from 0 to 1, and what it says."""
    places = np.asarray(axis.get_majorticklocs(), dtype=np.float64)
    texts = axis.get_major_formatter().format_ticks(list(places))
    transform = axis.get_transform()
    low, high = sorted(transform.transform(np.array(axis.get_view_interval())))
    at = (transform.transform(places) - low) / (high - low)
    return [
        (float(x), text)
        for x, text in zip(at, texts, strict=True)
        if text and -1e-9 <= x <= 1 + 1e-9
    ]


def _length(text: str, size: float) -> float:
    """Length of the longest line of a text in DejaVu Sans, to about a tenth [pt]."""
    if "$" in text:  # 10 to a power
        text = "".join(c for c in text if c.isalnum() or c in "−.").replace("mathdefault", "")
    return max(size * sum(map(_letter, line)) for line in text.split("\n"))


def _letter(letter: str) -> float:
    """Width of a letter over its size."""
    return 0.36 if letter in NARROW else 0.9 if letter in WIDE else 0.63


def _legend_height(legend: Any) -> float:
    """Room for a legend above all panels [pt]."""
    entries = len(legend.get_texts())
    return float(LINE * 7.5 * 1.15 * ceil(entries / legend._ncols) + 8)
