"""Charts of a recording: curves against the number of a pose, with a legend, drawn on a plane.

A plane is measured in points of the screen at `SIZE`, from its left top corner; where its window is
larger or smaller it is scaled as a whole, but for its words. The curves are in the file as scalars
too, exactly as the record has them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from textwrap import wrap

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Index
from testbed.recording import style
from testbed.recording.pen import Pen
from testbed.recording.plane import LETTER, LINE, Word, grid_lines, words_of
from testbed.recording.style import Color
from testbed.recording.ticks import decades, ticks
from testbed.recording.timeline import Phase

SIZE = (620.0, 193.0)
"""Width and height of the plane: somewhat smaller than its window in one of 1280 by 720."""
LEFT, RIGHT, TICK, BOTTOM = 62.0, 18.0, 12.0, 35.0
"""Margins of a chart: for its numbers, below its legend, and for the numbers along it."""
SAMPLE = 22.0
"""Length of the line before a name in a legend."""
FEW = 40
"""Curves with fewer points also show the points."""
DECADE = 8.0
"""Curves whose medians are further apart than this factor share a logarithmic axis."""
ROOT = "chart"


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One scalar per item of a phase, exactly as the record has it times the unit's factor."""

    key: str
    """Name of its entity, below that of its chart."""
    values: Array
    """(k,) numbers."""
    color: Color
    name: str = ""
    """In the legend; the key if empty."""
    local: Index | None = None
    """(k,) which items they belong to; None: all in turn."""

    @property
    def label(self) -> str:
        """Its name in the legend."""
        return self.name or self.key

    @property
    def items(self) -> Index:
        """(k,) items of the phase."""
        return np.arange(len(self.values)) if self.local is None else self.local


def level(key: str, phase_items: int, value: float, color: Color, name: str = "") -> Series:
    """A curve that stays at one value."""
    return Series(key, np.full(phase_items, value), color, name)


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Curves over the items of a phase."""

    origin: str
    """Root of the entities of its curves."""
    title: str
    """What it shows, with the unit, and what counts along its axis."""
    curves: Sequence[Series]
    places: ArrayLike | None = None
    """Number of every item on the axis; None: 1, 2 ..."""

    def across(self, items: Index) -> Array:
        """Numbers of items on the axis."""
        return np.asarray(items + 1.0 if self.places is None else np.asarray(self.places)[items])


def before_after(before: Array, after: Array) -> list[str]:
    """Words for pairs of errors (k,) [m], with the digits that the smaller ones need."""
    digits = 3 if np.median(after) < 1e-4 else 2
    pairs = zip(1e3 * before, 1e3 * after, strict=True)
    return [f"{one:.{digits}f} to {other:.{digits}f} mm" for one, other in pairs]


def fit_chart(trace: Array, dof: int) -> Chart:
    """Log10 of the sum of squares per degree of freedom: 0 where only noise is left."""
    ratio = np.log10(np.maximum(trace / max(dof, 1), 1e-30))
    curve = Series("fit", ratio, style.LINE_COLOR, "0: only noise is left")
    title = "log10(sum of squares / dof) by iteration"
    return Chart("identify", title, (curve,), np.arange(len(trace), dtype=np.float64))


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Where a chart lies on the plane and what it spans."""

    chart: Chart
    left: float
    width: float
    x: tuple[float, float]
    y: tuple[float, float]
    names: Sequence[Word]
    """Its legend."""
    is_log: bool = False
    """Whether the numbers beside it count decades."""
    shows_names: bool = True
    """Whether its legend is drawn; not where that of the chart before it stands for both."""

    def place(self, across: Array, values: Array) -> Array:
        """Points (k, 2) of the plane."""
        right, high = self.left + self.width - RIGHT, SIZE[1] - BOTTOM
        along = (across - self.x[0]) / (self.x[1] - self.x[0])
        low, top = self.scaled(np.array(self.y))
        up = (self.scaled(values) - low) / (top - low)
        start = self.left + LEFT
        top = self.names[-1].y + LINE + TICK
        return np.stack([start + along * (right - start), high - up * (high - top)], axis=-1)

    def scaled(self, values: Array) -> Array:
        """Values, or their decades."""
        return np.log10(values) if self.is_log else values

    def of(self, curve: Series) -> Array:
        """Points (k, 2) of a curve; numbers that are not finite lie on its lower edge."""
        values = np.where(np.isfinite(curve.values), curve.values, self.y[0])
        return self.place(self.chart.across(curve.items), values)

    @property
    def marks(self) -> tuple[Array, Array]:
        """Numbers marked along the axis and beside it."""
        numbers = self.chart.across(self.chart.curves[0].items)
        along = ticks(*self.x, 6)
        if (numbers % 1 == 0).all():
            along = along[along % 1 == 0]
        return along, decades(*self.y) if self.is_log else ticks(*self.y, 4)

    @property
    def grid(self) -> Array:
        """Thin lines (k, 2, 2)."""
        along, up = self.marks
        low, high = np.array(self.y), np.array(self.x)
        stand = [self.place(np.full(2, mark), low) for mark in along]
        return np.array(stand + [self.place(high, np.full(2, mark)) for mark in up])

    @property
    def samples(self) -> Array:
        """Lines (curves, 2, 2) before the names of the legend that is drawn."""
        shown = self.names if self.shows_names else ()
        lines = [(word.box[0] - SAMPLE + 2, word.y + LINE / 2) for word in shown]
        return np.array([[[x, y], [x + SAMPLE - 6, y]] for x, y in lines])

    @property
    def words(self) -> list[Word]:
        """Title, legend, and the numbers of both axes."""
        along, up = self.marks
        found = [
            Word(self.left + LETTER * len(line) / 2 + 12, 2 + k * LINE, line)
            for k, line in enumerate(title_lines(self.chart, self.width))
        ]
        found += self.names if self.shows_names else ()
        for mark in along:
            x, y = self.place(np.array(mark), np.array(self.y[0]))
            found.append(Word(x, y + 12, f"{mark:g}"))
        for mark in up:
            x, y = self.place(np.array(self.x[0]), np.array(mark))
            text = f"{mark:g}".replace("e-0", "e-")
            found.append(Word(x - 8 - (LETTER * len(text) + 8) / 2, y - LINE / 2, text))
        return found


def title_lines(chart: Chart, width: float) -> list[str]:
    """The title of a chart so wide, in as many lines as it needs."""
    return wrap(chart.title, int((width - 24) / LETTER))


def legend(chart: Chart, left: float, right: float, y: float) -> list[Word]:
    """Names of curves between two edges, in as many lines as they need."""
    at, found = left + 12.0, list[Word]()
    for curve in chart.curves:
        width = LETTER * len(curve.label) + 8
        if found and at + SAMPLE + width > right:
            at, y = left + 12.0, y + LINE + 1
        found.append(Word(at + SAMPLE + width / 2, y, curve.label))
        at += SAMPLE + width + 10
    return found


def frames_of(charts: Sequence[Chart], count: int) -> list[Axes]:
    """The charts of a phase with so many items, side by side; one legend if theirs are alike."""
    width, found = SIZE[0] / max(len(charts), 1), list[Axes]()
    looks = {tuple((curve.label, curve.color) for curve in chart.curves) for chart in charts}
    alike = len(charts) > 1 and len(looks) == 1
    most = max((len(title_lines(chart, width)) for chart in charts), default=0)
    for k, chart in enumerate(charts):
        left, right = (0.0, SIZE[0]) if alike else (k * width, (k + 1) * width)
        lines = most if alike else len(title_lines(chart, width))
        names = legend(chart, left, right, lines * LINE + 5)
        frame = _frame(chart, k * width, width, count, names)
        found.append(replace(frame, shows_names=not alike or k == 0))
    return found


def _frame(chart: Chart, left: float, width: float, count: int, names: Sequence[Word]) -> Axes:
    """A chart with all items and finite points in view; from zero where zero is not far."""
    x = chart.across(np.arange(count))
    y = np.concatenate([curve.values for curve in chart.curves])
    y = y[np.isfinite(y)]
    first, last = float(x.min()), float(x.max())
    aside = 0.4 if last == first else min(0.01 * (last - first), 0.4)
    across = first - aside, last + aside
    if len(y) and y.min() > 0:
        typical = [float(np.median(curve.values)) for curve in chart.curves if len(curve.values)]
        if max(typical) > DECADE * min(typical):
            return Axes(chart, left, width, across, (0.8 * y.min(), 1.25 * y.max()), names, True)
    low, high = (float(y.min()), float(y.max())) if len(y) else (0.0, 1.0)
    if 0 <= low < 0.5 * high:
        low = 0.0
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    below = 0.0 if low == 0.0 else room
    return Axes(chart, left, width, across, (low - below, high + room), names)


def draw_curves(pen: Pen, phase: Phase, charts: Sequence[Chart], words: str = "") -> None:
    """The curves of a phase as scalars; their names begin with `words`."""
    import rerun as rr

    for chart in charts:
        for curve in chart.curves:
            path = f"{words}{chart.origin}/{curve.key}"
            pen.rows(path, phase, rr.Scalars.columns(scalars=curve.values), curve.local)
            pen.static(path, rr.SeriesLines(colors=curve.color, names=curve.label, widths=2))


def draw_charts(pen: Pen, phase: Phase, charts: Sequence[Chart], words: str = "") -> None:
    """The charts of a phase on the plane while it lasts; their names begin with `words`."""
    import rerun as rr

    root, at = f"{words}{ROOT}/{phase.name}", partial(pen.at, phase.start)
    frames = frames_of(charts, len(phase.at))
    if not frames:
        return
    thick = rr.Radius.ui_points(1.1)
    grid = np.concatenate([frame.grid for frame in frames])
    at(f"{root}/grid", grid_lines(grid, -20.0))
    strips, colors, dots, dyes = list[Array](), list[Color](), list[Array](), list[Color]()
    for frame in frames:
        strips += list(frame.samples)
        colors += [curve.color for curve in frame.chart.curves][: len(frame.samples)]
        for curve in frame.chart.curves:
            points = frame.of(curve)
            strips.append(points)
            colors.append(curve.color)
            if 0 < len(points) < FEW and len({*curve.values.tolist()}) > len(points) // 2:
                dots.append(points)
                dyes += len(points) * [curve.color]
    at(f"{root}/curves", rr.LineStrips2D(strips, colors=colors, radii=thick, draw_order=0.0))
    if dots:
        small, cloud = rr.Radius.ui_points(2.5), np.concatenate(dots)
        points = rr.Points2D(cloud, colors=dyes, radii=small, draw_order=1.0)
        at(f"{root}/points", points)
    at(f"{root}/words", words_of([word for frame in frames for word in frame.words]))
    _draw_cursor(pen, phase, root, frames)
    if phase.stop < pen.timeline.n_steps:
        pen.at(phase.stop, root, rr.Clear(recursive=True))


def _draw_cursor(pen: Pen, phase: Phase, root: str, frames: Sequence[Axes]) -> None:
    """A dot on each curve at the item that is shown."""
    import rerun as rr

    items = np.concatenate([c.items for frame in frames for c in frame.chart.curves])
    points = np.concatenate([frame.of(c) for frame in frames for c in frame.chart.curves])
    dyes = [c.color for frame in frames for c in frame.chart.curves for _ in c.items]
    order = np.argsort(items, kind="stable")
    shown, counts = np.unique(items, return_counts=True)
    columns = rr.Points2D.columns(
        positions=points[order], colors=np.array(dyes, dtype=np.uint8)[order]
    ).partition(counts)
    pen.every_step(f"{root}/now", columns, phase.at[shown])
    large = rr.Radius.ui_points(5.5)
    pen.static(f"{root}/now", rr.Points2D.from_fields(radii=large, draw_order=2.0))
