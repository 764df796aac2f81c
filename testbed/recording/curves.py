"""Plots in a recording: one curve window per phase, and the parameters against what was stated."""

import numpy as np

from calib.arrays import Array, Index
from calib.measurement.accuracy import seen_minus_predicted
from testbed.recording.pen import Color, Pen, Stretch, Timeline, Writer
from testbed.recording.story import search_trace
from testbed.studies.trial.records import RandomSets

LINE_COLOR, STATED_COLOR, MUTED_COLOR = (92, 150, 240), (140, 160, 250), (150, 156, 164)
RED, GREEN = (232, 84, 80), (60, 190, 110)
"""Before and after in the plots."""
BAND_COLOR, GRID_COLOR, TEXT_COLOR = (92, 98, 106), (124, 130, 138), (140, 146, 154)
COVERED = (110, 240, 160)
"""Readable on the dark and on the light ground of the viewer's two themes."""
FEW = 40
"""Curves with fewer points also show the points."""
TICKS, EDGE = (0, 2, 10, 100), 300.0
"""Marks of the parameter plot and where it clips, in stated standard uncertainties."""
BAND = 1.959963984540054
ROW = 10.0
"""Height of a parameter's row in the plot's own units."""


def draw_curve(
    writer: Pen[Timeline],
    path: str,
    phase: Stretch,
    values: Array,
    color: Color,
    name: str = "",
    local: Index | None = None,
) -> None:
    """One scalar per item of a phase, exactly as the record has it times the unit's factor."""
    import rerun as rr

    name = name or path.rsplit("/", 1)[1]
    writer.rows(path, phase, rr.Scalars.columns(scalars=values), local)
    writer.static(path, rr.SeriesLines(colors=color, names=name, widths=2))
    if len(values) < FEW:
        writer.static(
            path, rr.SeriesPoints(colors=color, names=name, markers="circle", marker_sizes=2.5)
        )


def draw_curves(writer: Writer, random_sets: RandomSets | None) -> None:
    """The four windows: best index so far, errors seen, fit, held-out errors [mm]."""
    story = writer.story
    select, measure, identify, evaluate = story.phases[:4]
    trial, judged = story.trial, story.estimate.comparison
    found = story.estimate.identification
    draw_curve(
        writer, f"select/{trial.selection.criterion}", select, search_trace(trial), LINE_COLOR
    )
    if random_sets is not None:
        best = np.full(len(select.at), random_sets.best)
        draw_curve(
            writer,
            "select/random",
            select,
            best,
            MUTED_COLOR,
            f"best of {len(random_sets.values)} random sets",
        )
    for name, model, color in (
        ("nominal", story.setting.nominal, RED),
        ("identified", found.model, GREEN),
    ):
        _, vectors = seen_minus_predicted(model, trial.measurements)
        size = np.linalg.norm(vectors, axis=1)
        draw_curve(writer, f"measure/{name}", measure, size * 1e3, color)
    draw_curve(writer, "identify/fit", identify, fit(found.trace, found.dof), LINE_COLOR)
    stated = np.sqrt(np.trace(judged.covariance[:, :3, :3], axis1=1, axis2=2))
    draw_curve(writer, "evaluate/before", evaluate, judged.before * 1e3, RED)
    draw_curve(writer, "evaluate/after", evaluate, judged.after * 1e3, GREEN)
    draw_curve(writer, "evaluate/stated", evaluate, stated * 1e3, STATED_COLOR, "stated rms")


def fit(trace: Array, degrees_of_freedom: int) -> Array:
    """Log10 of the sum of squares per degree of freedom: 0 where only noise is left."""
    return np.asarray(np.log10(np.maximum(trace / max(degrees_of_freedom, 1), 1e-30)))


def draw_parameters(writer: Writer) -> None:
    """Error of every estimated parameter in stated standard uncertainties, from nominal to final.

    The axis is asinh, so that 2 and 1000 both fit. Points inside the gray band are covered by the
    stated 95 % interval.
    """
    import rerun as rr

    story = writer.story
    found, judged = story.estimate.identification, story.estimate.comparison
    names = found.parameters.free_names
    u = np.where(found.standard_uncertainty > 0, found.standard_uncertainty, np.inf)
    rows = ROW * np.arange(len(names), dtype=np.float64)
    low, high = -ROW, rows[-1] + ROW
    width = float(place(EDGE))
    # one very thick line: 2-D boxes cannot be filled
    writer.static(
        "parameters/band",
        rr.LineStrips2D(
            [[[0, 0], [0, rows[-1]]]], colors=BAND_COLOR, radii=place(BAND), draw_order=-30.0
        ),
    )
    ticks = np.array([sign * tick for tick in TICKS for sign in (1, -1) if tick or sign > 0])
    writer.static(
        "parameters/grid",
        rr.LineStrips2D(
            [[[place(tick), low], [place(tick), high]] for tick in ticks],
            colors=GRID_COLOR,
            radii=rr.Radius.ui_points(0.5),
            draw_order=-20.0,
        ),
    )
    writer.static(
        "parameters/axis",
        rr.Points2D(
            [[place(tick), high + 0.2 * ROW] for tick in ticks if tick],
            radii=0.01,
            labels=[f"{tick:d}" for tick in ticks if tick],
            show_labels=True,
            colors=TEXT_COLOR,
        ),
    )
    writer.static(
        "parameters/names",
        rr.Points2D(
            [[-(1.2 + 0.42 * (k % 2)) * width, row - 0.9 * ROW] for k, row in enumerate(rows)],
            radii=0.01,
            labels=list(names),
            show_labels=True,
            colors=TEXT_COLOR,
        ),
    )
    phase = story.phase("identify")
    steps = np.concatenate([[0], phase.steps])
    error = judged.true_step - story.known[steps, None] * found.step
    points = np.stack(
        [place(np.clip(error / u, -EDGE, EDGE)), np.broadcast_to(rows, error.shape)], -1
    )
    covered = np.abs(error) <= BAND * u
    covered[-1] = judged.parameter_inside
    colors = np.where(covered[..., None], COVERED, RED).astype(np.uint8)
    writer.every_step(
        "parameters/error",
        rr.Points2D.columns(
            positions=points.reshape(-1, 2), colors=colors.reshape(-1, 3)
        ).partition(np.full(len(steps), len(names))),
        steps,
    )
    writer.static("parameters/error", rr.Points2D.from_fields(radii=rr.Radius.ui_points(4.0)))


def place(z: Array | float) -> Array:
    """Where a normalized error lies on the parameter plot's axis."""
    return np.asarray(12 * np.arcsinh(z))


def parameter_bounds(count: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Visible range in x and y of the parameter plot with so many rows."""
    width = float(place(EDGE))
    return (-1.85 * width, 1.1 * width), (-1.5 * ROW, (count + 1.2) * ROW)
