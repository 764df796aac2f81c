"""The figures of the coverage study: attained coverage with bands, and the radii of statements."""

from math import floor
from typing import TYPE_CHECKING

from testbed.report.plots import (
    Look,
    interval,
    legend_above,
    legend_entries,
    log_ticks,
    rows_of,
    share_ends,
)
from testbed.report.svg import DARK, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.coverage.study import MODELS, STATEMENTS, CoverageStudy
from testbed.studies.coverage.summary import Cell
from testbed.units import UM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {
    "region": "believed region",
    "model": "parameters alone",
    "discrepancy": "with discrepancy",
    "conformal": "conformal ball",
}
LOOKS: dict[str, Look] = {
    "geometric": {"marker": "o", "color": DARK},
    "extended": {"marker": "^", "color": MIDDLE},
}
MARKERS = {"region": "^", "model": "o", "discrepancy": "s", "conformal": "D"}
APART = 0.16
"""Distance between the rows of one kind of robot, in rows."""
FINE = 0.8
"""If all shares are above this, the axis begins at the next twentieth below them; else at 0."""


def attained(cells: tuple[Cell, ...]) -> str:
    """Share of points inside per statement; thin: bands that hold all at once."""
    truths = tuple(dict.fromkeys(cell.truth for cell in cells))
    height = 0.85 + 0.4 * len(truths)
    with drawing(1, len(STATEMENTS), height=height, sharey=True) as (figure, axes):
        for ax, statement in zip(axes, STATEMENTS, strict=True):
            shown = [cell for cell in cells if cell.statement == statement]
            ax.axvline(100 * shown[0].level, color=SOFT, linewidth=0.9)
            for cell in shown:
                look = LOOKS[cell.model]
                y = truths.index(cell.truth) + APART * (1 if cell.model == "extended" else -1)
                interval(ax, y, share_ends(cell.share), share_ends(cell.joint), look["color"])
                face = look["color"] if cell.believable else "white"
                ax.plot(
                    100 * cell.share.value, y, markersize=4.6, markerfacecolor=face,
                    linestyle="none", **look,
                )  # fmt: skip
            worst = min(cell.joint.low for cell in shown)
            low = min(floor(20 * worst) * 5.0, 95.0) if worst > FINE else 0.0
            ax.set_xlim(low - (100 - low) * 0.04, 100 + (100 - low) * 0.04)
            ax.set_title(TITLES[statement])
            ax.set_xlabel("points inside [%]")
            by_truth(ax, truths)
        legend_entries(axes[0], LOOKS)
        legend_above(figure, axes[0])
        return svg_of(figure)


def sharpness(studies: tuple[CoverageStudy, ...], cells: tuple[Cell, ...]) -> str:
    """Mean radius of each statement beside the mean error, one panel per model."""
    truths = tuple(study.truth for study in studies)
    height = 0.85 + 0.4 * len(truths)
    with drawing(1, len(MODELS), height=height, sharex=True, sharey=True) as (figure, axes):
        for i, (ax, model) in enumerate(zip(axes, MODELS, strict=True)):
            for row, study in enumerate(studies):
                error = float(study.mean_error[i].mean()) * UM
                ax.plot(error, row, "|", color=SOFT, markersize=13, markeredgewidth=1.6)
            for cell in cells:
                if cell.model == model:
                    face = DARK if cell.believable else "white"
                    y = truths.index(cell.truth) + APART * (STATEMENTS.index(cell.statement) - 1.5)
                    ax.plot(
                        cell.radius * UM, y, MARKERS[cell.statement], color=DARK,
                        markersize=4.4, markerfacecolor=face,
                    )  # fmt: skip
            ax.set_xscale("log")
            radii = [cell.radius * UM for cell in cells]
            log_ticks(ax.xaxis, min(radii) / 2, 2 * max(radii))
            ax.set_title(f"{model} model")
            ax.set_xlabel("mean radius [µm]")
            by_truth(ax, truths)
        looks: dict[str, Look] = {
            TITLES[statement]: {"marker": mark, "color": DARK}
            for statement, mark in MARKERS.items()
        }
        looks["mean error"] = {"marker": "|", "color": SOFT, "markersize": 10}
        legend_entries(axes[0], looks)
        legend_above(figure, axes[0])
        return svg_of(figure)


def by_truth(ax: "Axes", truths: tuple[str, ...]) -> None:
    """One row per kind of robot, the first on top."""
    rows_of(ax, truths)
    for y in range(1, len(truths)):
        ax.axhline(y - 0.5, color="#ececec", linewidth=0.6)
