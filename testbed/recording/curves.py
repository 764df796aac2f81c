"""Plots in a recording: curves over a phase, and planes beside the cell with grid and labels."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index
from testbed.recording import style
from testbed.recording.pen import Pen
from testbed.recording.story import Panel
from testbed.recording.style import Color
from testbed.recording.timeline import Phase

FEW = 40
"""Curves with fewer points also show the points."""
TICKS, EDGE = (0, 2, 10, 100), 300.0
"""Marks of the parameter plot and where it clips, in stated standard uncertainties."""
BAND = 1.959963984540054
ROW = 10.0
"""Height of a parameter's row in the plot's own units."""
MOST_ROWS = 36
"""Of more parameters only the first have a row, so that names can be read."""


def draw_curve(
    pen: Pen,
    path: str,
    phase: Phase,
    values: Array,
    color: Color,
    name: str = "",
    local: Index | None = None,
) -> None:
    """One scalar per item of a phase, exactly as the record has it times the unit's factor."""
    import rerun as rr

    name = name or path.rsplit("/", 1)[1]
    pen.rows(path, phase, rr.Scalars.columns(scalars=values), local)
    pen.static(path, rr.SeriesLines(colors=color, names=name, widths=2))
    if len(values) < FEW:
        style = rr.SeriesPoints(colors=color, names=name, markers="circle", marker_sizes=2.5)
        pen.static(path, style)


def draw_level(
    pen: Pen, path: str, phase: Phase, value: float, color: Color, name: str = ""
) -> None:
    """A curve that stays at one value."""
    draw_curve(pen, path, phase, np.full(len(phase.at), value), color, name)


def draw_fit(pen: Pen, phase: Phase, trace: Array, dof: int) -> None:
    """Log10 of the sum of squares per degree of freedom: 0 where only noise is left."""
    ratio = np.maximum(trace / max(dof, 1), 1e-30)
    draw_curve(pen, "identify/fit", phase, np.log10(ratio), style.LINE_COLOR)


def draw_grid(pen: Pen, path: str, lines: ArrayLike, order: float) -> None:
    """Thin lines (k, 2, 2) behind what a plane shows; those of the lowest order lie deepest."""
    import rerun as rr

    thin = rr.Radius.ui_points(0.5)
    pen.static(path, rr.LineStrips2D(lines, colors=style.GRID_COLOR, radii=thin, draw_order=order))


def draw_labels(pen: Pen, path: str, places: ArrayLike, labels: Sequence[str]) -> None:
    """Words at places (k, 2) of a plane."""
    import rerun as rr

    color = style.TEXT_COLOR
    words = rr.Points2D(places, labels=labels, show_labels=True, radii=0.01, colors=color)
    pen.static(path, words)


def draw_parameters(
    pen: Pen, names: Sequence[str], error: Array, covered: Bool, steps: Index
) -> None:
    """Errors of all parameters, each in its row, at some steps of the timeline.

    The axis is asinh, so that 2 and 1000 both fit. Points inside the gray band are covered by the
    stated 95 % interval. Of very many only the first are drawn.

    Parameters
    ----------
    names : sequence of str
        Of the p parameters.
    error : (k, p) array
        In stated standard uncertainties.
    covered : (k, p) array of bool
        Whether the stated interval holds the truth.
    steps : (k,) array of int
        Where the rows lie on the timeline.
    """
    import rerun as rr

    names, error, covered = names[:MOST_ROWS], error[:, :MOST_ROWS], covered[:, :MOST_ROWS]
    rows = ROW * np.arange(len(names), dtype=np.float64)
    low, high, width = -ROW, rows[-1] + ROW, float(place(EDGE))
    # one very thick line: 2-D boxes cannot be filled
    band = rr.LineStrips2D(
        [[[0, 0], [0, rows[-1]]]], colors=style.BAND_COLOR, radii=place(BAND), draw_order=-30.0
    )
    pen.static("parameters/band", band)
    ticks = np.array([sign * tick for tick in TICKS for sign in (1, -1) if tick or sign > 0])
    lines = [[[place(tick), low], [place(tick), high]] for tick in ticks]
    draw_grid(pen, "parameters/grid", lines, -20.0)
    marks = [tick for tick in ticks if tick]
    # in two lines: those of neighbors would touch
    above = [[place(tick), high + (0.2 + 1.2 * (abs(tick) == 10)) * ROW] for tick in marks]
    draw_labels(pen, "parameters/axis", above, [f"{tick:d}" for tick in marks])
    beside = [[-(1.18 + 0.5 * (k % 2)) * width, row - 0.9 * ROW] for k, row in enumerate(rows)]
    draw_labels(pen, "parameters/names", beside, list(names))
    x = place(np.clip(error, -EDGE, EDGE))
    points = np.stack([x, np.broadcast_to(rows, x.shape)], axis=-1).reshape(-1, 2)
    colors = np.where(covered[..., None], style.COVERED, style.RED).astype(np.uint8).reshape(-1, 3)
    columns = rr.Points2D.columns(positions=points, colors=colors)
    pen.every_step("parameters/error", columns.partition(np.full(len(steps), len(names))), steps)
    pen.static("parameters/error", rr.Points2D.from_fields(radii=rr.Radius.ui_points(4.0)))


def place(z: Array | float) -> Array:
    """Where a normalized error lies on the parameter plot's axis."""
    return np.asarray(12 * np.arcsinh(z))


def parameter_panel(count: int) -> Panel:
    """The window of the parameter plot with so many rows, all of them in view."""
    width, rows = float(place(EDGE)), min(count, MOST_ROWS)
    x, y = (-1.95 * width, 1.1 * width), (-1.5 * ROW, (rows + 3.2) * ROW)
    title = f"Error / u: first {rows} of {count}" if count > rows else "Parameter error / stated u"
    return Panel("parameters", title, x, y)
