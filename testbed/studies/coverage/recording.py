"""The coverage study in a recording: robots come in one by one, and the attained share settles."""

from collections.abc import Sequence
from functools import partial
from itertools import cycle

import numpy as np

from calib.arrays import Array, Bool
from testbed.recording import style
from testbed.recording.chart import Chart, Series, level
from testbed.recording.pen import Pen, first
from testbed.recording.plane import LETTER, LINE, Word, draw_grid, draw_words
from testbed.recording.story import Chapter, Panel, numbered
from testbed.recording.timeline import Phase, growing, spread
from testbed.studies.coverage.plots import TITLES
from testbed.studies.coverage.study import MODELS, STATEMENTS, STUDY, CoverageStudy
from testbed.studies.coverage.summary import Cell, cells
from testbed.studies.trial.records import Campaign

CURVES = (style.LEAF, style.SKY, style.ORANGE, style.VERMILION, style.PINK, style.BLUE)
"""Colors of the kinds of robots, in turn."""
STAGES = 40
"""Number of steps in which the clouds of robots grow."""
PANEL, GAP, ROW = 100.0, 12.0, 27.0
"""Width of a panel, gap between panels, height of a row; a percent is about one point."""
NAMES, FOOT = 168.0, 30.0
"""Room for the names of rows, and for the numbers below."""
GOLDEN = 0.6180339887498949
"""Steps of this size, modulo 1, fill an interval evenly, so that robots do not overlap."""
SPREAD = 0.55
"""Fraction of a row's height over which its robots are spread."""
MOST_SHOWN = 2000
"""Most robots of a kind that are shown; more look the same, and each takes some kB."""
FRAMES = 144
"""Approximate number of frames of the phase."""


def running(shares: Array, made: Bool) -> Array:
    """Running mean of shares (R,) over the robots with a statement, `made` (R,) [%].

    Before the first such robot it has the share of that one.
    """
    count, first_made = np.cumsum(made), int(np.argmax(made))
    total = np.cumsum(np.where(made, shares, 0.0))
    mean = 100 * total / np.maximum(count, 1)
    return np.asarray(np.where(count > 0, mean, 100 * shares[first_made]))


def first_of(study: CoverageStudy, model: int, statement: int) -> tuple[Array, Bool]:
    """Shares of the robots that are shown, and on which of them the statement is made."""
    made = study.made(model, statement)
    return study.inside[model, statement, :MOST_SHOWN], made[:MOST_SHOWN]


def chapter(campaign: Campaign) -> Chapter:
    """Chapter in which robots of all kinds appear one by one, beside the promised share."""
    studies = STUDY.of(campaign)
    found, robots = cells(studies), studies[0].before.size
    shown = min(robots, MOST_SHOWN)
    some = str(robots) if shown == robots else f"the first {shown} of {robots}"
    short = sum(not cell.believable for cell in found)
    panel = Panel(
        origin="attained",
        title="Points inside what is stated, % (a dot is a robot)",
        x=(-NAMES, len(STATEMENTS) * (PANEL + GAP) + GAP),
        y=(-0.6 * ROW - 2 * (LINE + 1), (len(studies) * len(MODELS) - 0.4) * ROW + FOOT),
        tall=True,
    )
    return Chapter(
        name="coverage",
        local="robot",
        color=(140, 92, 170),
        motion=spread(shown, FRAMES),
        text=(
            "#### 5 Coverage: does the statement hold?",
            f"- {some} robots of each of {len(studies)} kinds come in one by one",
            "- a dot: share of one robot's held-out points inside what is stated",
            f"- pale line: the promised {100 * studies[0].level:g} %",
            "- large: mean so far, vermilion where it falls short",
            f"- {short} of {len(found)} statements fall short, by bands over robots",
        ),
        draw=partial(_draw, studies, found),
        lines=numbered("robot", shown),
        charts=[_chart(studies, i) for i in range(len(MODELS))],
        panel=panel,
    )


def _draw(
    studies: tuple[CoverageStudy, ...], found: Sequence[Cell], pen: Pen, phase: Phase
) -> None:
    """Draw the clouds of all kinds of robots from the records."""
    _draw_frame(pen, studies)
    for k, cell in enumerate(found):
        row, column = divmod(k, len(STATEMENTS))
        study, i = studies[row // len(MODELS)], row % len(MODELS)
        shares, made = first_of(study, i, column)
        _draw_robots(pen, phase, shares, made, cell, row, column)


def _chart(studies: tuple[CoverageStudy, ...], i: int) -> Chart:
    """The mean over the robots so far, of all kinds, with one of the two models."""
    curves = [
        Series(study.truth, running(*first_of(study, i, 0)), color)
        for study, color in zip(studies, cycle(CURVES), strict=False)
    ]
    promise, count = 100 * studies[0].level, len(curves[0].values)
    curves.append(level("promise", count, promise, style.MUTED_COLOR, "promised"))
    return Chart(f"coverage/{MODELS[i]}", f"Inside [%] by robots, {MODELS[i]}", curves)


def _draw_frame(pen: Pen, studies: tuple[CoverageStudy, ...]) -> None:
    """Draw promised share, edges and words of the panels."""
    import rerun as rr

    rows = len(studies) * len(MODELS)
    low, high = -0.6 * ROW, (rows - 0.4) * ROW
    left = [j * (PANEL + GAP) for j in range(len(STATEMENTS))]
    lines = [[[x + at, low], [x + at, high]] for x in left for at in (0.0, 50.0, 100.0)]
    lines += [
        [[left[0], y], [left[-1] + PANEL, y]]
        for y in (ROW * (len(MODELS) * k - 0.5) for k in range(len(studies) + 1))
    ]
    draw_grid(pen, "attained/frame", lines, -30.0)
    level, thick = 100 * studies[0].level, rr.Radius.ui_points(1.2)
    lines = [[[x + level, low], [x + level, high]] for x in left]
    promise = rr.LineStrips2D(lines, colors=style.LINE_COLOR, radii=thick, draw_order=-20.0)
    pen.static("attained/promise", promise)
    draw_words(pen, "attained/words", frame_words([study.truth for study in studies]))


def frame_words(truths: Sequence[str]) -> list[Word]:
    """Titles in two lines in turn, numbers below, and names before the rows."""
    low, high = -0.6 * ROW, (len(truths) * len(MODELS) - 0.4) * ROW
    left = [j * (PANEL + GAP) for j in range(len(STATEMENTS))]
    words = [
        Word(x + PANEL / 2, low - (1 + j % 2) * (LINE + 1), TITLES[s])
        for j, (x, s) in enumerate(zip(left, STATEMENTS, strict=True))
    ]
    words += [Word(x + at, high + 4, f"{at:.0f}") for x in left for at in (50, 100)]
    rows = [f"{truth}, {model}" for truth in truths for model in MODELS]
    return words + [
        Word(-4 - (LETTER * len(name) + 8) / 2, k * ROW - LINE / 2, name)
        for k, name in enumerate(rows)
    ]


def _draw_robots(
    pen: Pen, phase: Phase, shares: Array, made: Bool, cell: Cell, row: int, column: int
) -> None:
    """The robots of one cell as they come in, and the mean so far of those with a statement."""
    import rerun as rr

    count, x = len(shares), column * (PANEL + GAP)
    path = f"attained/{cell.truth}/{cell.model}/{cell.statement}"
    within = (np.arange(count) * GOLDEN) % 1 - 0.5
    points = np.stack([x + 100 * shares, ROW * (row + SPREAD * within)], axis=-1)
    lengths = growing(count, STAGES)
    clouds = rr.Points2D.columns(positions=first(points, lengths)).partition(lengths)
    pen.every_step(f"{path}/robots", clouds, phase.at[lengths - 1])
    small, gray = rr.Radius.ui_points(1.6), (*style.MUTED_COLOR, 150)
    dots = rr.Points2D.from_fields(radii=small, colors=gray, draw_order=-10.0)
    pen.static(f"{path}/robots", dots)
    means = np.stack([x + running(shares, made), np.full(count, ROW * row)], axis=-1)
    pen.every_step(f"{path}/mean", rr.Points2D.columns(positions=means), phase.at)
    large, color = rr.Radius.ui_points(5.0), style.BLUE if cell.believable else style.VERMILION
    dot = rr.Points2D.from_fields(radii=large, colors=color, draw_order=10.0)
    pen.static(f"{path}/mean", dot)
