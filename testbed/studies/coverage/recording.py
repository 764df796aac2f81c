"""The coverage study in a recording: robots come in one by one, and the attained share settles."""

from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.recording.curves import (
    GREEN,
    GRID_COLOR,
    LINE_COLOR,
    MUTED_COLOR,
    RED,
    STATED_COLOR,
    TEXT_COLOR,
    draw_curve,
)
from testbed.recording.pen import Color, Writer, first
from testbed.recording.story import Phase
from testbed.studies.coverage.plots import TITLES
from testbed.studies.coverage.records import MODELS, STATEMENTS, CoverageStudy
from testbed.studies.coverage.summary import Cell, cells

CURVES: tuple[Color, ...] = (GREEN, LINE_COLOR, (226, 150, 60), RED, STATED_COLOR)
"""One per kind of robot."""
STAGES = 40
"""The clouds of robots grow in so many rows."""
PANEL, GAP, ROW = 100.0, 22.0, 27.0
"""Width of a statement's panel (a percent is one unit), between panels, height of a row."""
GOLDEN = 0.6180339887498949
"""Fractional steps of this fill an interval evenly: no two robots lie on each other."""
SPREAD = 0.55
"""Part of a row over which its robots lie."""


def running(shares: Array) -> Array:
    """Mean over the first robot, the first two ... of shares (..., R) [%]."""
    return np.asarray(100 * np.cumsum(shares, axis=-1) / np.arange(1, shares.shape[-1] + 1))


def panel(count: int) -> Any:
    """The window with every robot of `count` kinds, beside the promise."""
    import rerun.blueprint as rrb

    rows = count * len(MODELS)
    return rrb.Spatial2DView(
        origin="/attained",
        name="Points inside what is stated, % (a dot is a robot)",
        visual_bounds=rrb.VisualBounds2D(
            x_range=(-1.05 * PANEL, len(STATEMENTS) * (PANEL + GAP)),
            y_range=(-1.7 * ROW, (rows + 0.4) * ROW),
        ),
    )


def draw_coverage(writer: Writer, studies: tuple[CoverageStudy, ...], phase: Phase) -> None:
    """Curves and clouds of all kinds of robots, exactly as the records have them."""
    found = cells(studies)
    for study, color in zip(studies, CURVES, strict=False):
        for model, shares in zip(MODELS, study.inside[:, 0], strict=True):
            path = f"coverage/{model}/{study.truth}"
            draw_curve(writer, path, phase, running(shares), color, study.truth)
    for model in MODELS:
        level = np.full(len(phase.at), 100 * studies[0].level)
        draw_curve(writer, f"coverage/{model}/promise", phase, level, MUTED_COLOR, "promised")
    _draw_frame(writer, studies)
    for row, (study, i) in enumerate((s, i) for s in studies for i in range(len(MODELS))):
        for j, statement in enumerate(STATEMENTS):
            cell = next(
                c for c in found
                if (c.truth, c.model, c.statement) == (study.truth, MODELS[i], statement)
            )  # fmt: skip
            _draw_robots(writer, phase, study.inside[i, j], cell, row, j)


def _draw_frame(writer: Writer, studies: tuple[CoverageStudy, ...]) -> None:
    """Promise, edges and words of the panels."""
    import rerun as rr

    rows = len(studies) * len(MODELS)
    low, high = -0.6 * ROW, (rows - 0.4) * ROW
    left = [j * (PANEL + GAP) for j in range(len(STATEMENTS))]
    lines = [[[x + at, low], [x + at, high]] for x in left for at in (0.0, 50.0, 100.0)]
    lines += [
        [[left[0], y], [left[-1] + PANEL, y]]
        for y in (ROW * (len(MODELS) * k - 0.5) for k in range(len(studies) + 1))
    ]
    thin = rr.Radius.ui_points(0.5)
    writer.static(
        "attained/frame", rr.LineStrips2D(lines, colors=GRID_COLOR, radii=thin, draw_order=-30.0)
    )
    promise = [x + 100 * studies[0].level for x in left]
    writer.static(
        "attained/promise",
        rr.LineStrips2D(
            [[[x, low], [x, high]] for x in promise],
            colors=LINE_COLOR,
            radii=rr.Radius.ui_points(1.2),
            draw_order=-20.0,
        ),
    )
    words = [(x + PANEL / 2, -0.95 * ROW, TITLES[s]) for x, s in zip(left, STATEMENTS, strict=True)]
    words += [(x + at, high + 0.6 * ROW, f"{at:.0f}") for x in left for at in (0, 50, 100)]
    words += [
        (-0.54 * PANEL, (len(MODELS) * k + i) * ROW, f"{study.truth}, {model}")
        for k, study in enumerate(studies)
        for i, model in enumerate(MODELS)
    ]
    writer.static(
        "attained/words",
        rr.Points2D(
            [[x, y - 0.3 * ROW] for x, y, _ in words],
            labels=[text for *_, text in words],
            show_labels=True,
            radii=0.01,
            colors=TEXT_COLOR,
        ),
    )


def _draw_robots(
    writer: Writer, phase: Phase, shares: Array, cell: Cell, row: int, column: int
) -> None:
    """The robots of one cell as they come in, and their mean so far."""
    import rerun as rr

    count, x = len(shares), column * (PANEL + GAP)
    path = f"attained/{cell.truth}/{cell.model}/{cell.statement}"
    within = (np.arange(count) * GOLDEN) % 1 - 0.5
    points = np.stack([x + 100 * shares, ROW * (row + SPREAD * within)], axis=-1)
    lengths = np.unique(np.ceil(np.linspace(1, count, min(count, STAGES))).astype(np.int64))
    writer.every_step(
        f"{path}/robots",
        rr.Points2D.columns(positions=first(points, lengths)).partition(lengths),
        phase.at[lengths - 1],
    )
    style = rr.Points2D.from_fields(
        radii=rr.Radius.ui_points(1.6), colors=(*MUTED_COLOR, 150), draw_order=-10.0
    )
    writer.static(f"{path}/robots", style)
    means = x + running(shares)
    writer.every_step(
        f"{path}/mean",
        rr.Points2D.columns(positions=np.stack([means, np.full(count, ROW * row)], axis=-1)),
        phase.at,
    )
    color = GREEN if cell.believable else RED
    writer.static(
        f"{path}/mean",
        rr.Points2D.from_fields(radii=rr.Radius.ui_points(5.0), colors=color, draw_order=10.0),
    )


def words(studies: tuple[CoverageStudy, ...]) -> str:
    """What is on the screen in this phase."""
    found = cells(studies)
    short = sum(not cell.believable for cell in found)
    return "\n".join(
        [
            "#### 5 Coverage: does the statement hold?",
            f"- {studies[0].before.size} robots of each of {len(studies)} kinds come in one by "
            "one, each calibrated, validated and judged",
            f"- a dot: share of one robot's held-out points inside what is stated; blue line: the "
            f"promised {100 * studies[0].level:g} %",
            "- large: mean so far, green where the promise is kept, red where it is not",
            f"- {short} of {len(found)} statements fall short, by bands over robots",
        ]
    )
