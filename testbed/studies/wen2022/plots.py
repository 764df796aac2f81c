"""The figures: parameter budget and tool point on one robot, and the re-examination on many."""

from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array
from testbed.report.plots import (
    Look,
    label,
    legend_above,
    legend_entries,
    log_ticks,
    rows_of,
    share_ends,
)
from testbed.report.svg import DARK, FAINT, INK, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.over_robots import percent_of
from testbed.studies.trial.plots import LOOKS
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.ratio import PRINTED, Split
from testbed.studies.wen2022.records import ESTIMATORS, STATEMENTS, PaperBudget
from testbed.studies.wen2022.summary import Errors, Held, Predicted
from testbed.units import in_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PARTS = (("repeats u_r", DARK), ("number of poses u_p", LIGHT), ("place of poses u_w", MIDDLE))
TITLES = {
    "distance": "type A: |P|\nwithin t u",
    "point": "type A: point\nwithin t u",
    "unweighted": "point in region of\nthe unweighted fit",
    "covariance": "point in region of\nthe weighted fit",
}
APART = 0.16
"""Distance between the rows of one set, in rows."""
LANE = 0.15
"""Half the height of a step from 1 to the ratio, in rows."""


def ratio_apart(found: tuple[Split, ...]) -> str:
    """Shares in the variance of u random, and the two steps from 1 to the ratio."""
    kinds = list({split.truth: split for split in found}.values())
    with drawing(1, 2, height=0.95 + 0.3 * len(found)) as (figure, (left, right)):
        for y, split in enumerate(kinds):
            start = 0.0
            for (source, color), part in zip(PARTS, split.shares, strict=True):
                width = 100 * part.value
                name = source if y == 0 else None
                left.barh(y, width, left=start, height=0.6, color=color, label=name)
                if width > 5:
                    inside = INK if color == LIGHT else "white"
                    middle = start + width / 2
                    left.text(middle, y, f"{width:.0f}", ha="center", va="center", color=inside)
                start += width
        rows_of(left, [split.truth for split in kinds])
        left.set_xlim(0, 100)
        left.set_xlabel("share of the variance of u random [%]")
        left.set_title("what the random side counts")
        for y, split in enumerate(found):
            whole, repeats, _ = split.geometric
            # first the step by repeats alone, then that by further parts of the random side
            steps = ((1.0, repeats, DARK, -LANE), (repeats, whole, MIDDLE, LANE))
            for start, end, color, lane in steps:
                low, high = sorted((start, end))
                right.barh(
                    y + lane, high - low, left=low, height=2 * LANE, color=color, linewidth=0
                )
            right.plot([repeats, repeats], [y - 2 * LANE, y + 2 * LANE], color=INK, linewidth=0.8)
            right.plot(whole, y + LANE, "D", color=INK, markersize=4)
            label(right, f"{whole:.2f}", (whole, y + LANE), (-6, 0), ha="right", va="center")
        right.axvline(1.0, color=SOFT, linewidth=0.9)
        right.set_xscale("log")
        lowest, highest, _ = zip(*(split.geometric for split in found), strict=True)
        ends = min(lowest) / 1.7, 1.25 * max(1.0, *highest)
        right.set_xlim(*ends)
        log_ticks(right.xaxis, *ends)
        right.set_xlabel("geometric mean of u best / u random")
        right.set_title("from 1 to the ratio")
        right.plot([], [], color=DARK, linewidth=5, label="repeats against repeats")
        right.plot([], [], color=MIDDLE, linewidth=5, label="counted on the random side only")
        names = [s.truth if s.truth == PRINTED else f"{s.truth}, {s.trial}" for s in found]
        rows_of(right, names)
        for ax, columns in ((left, 3), (right, 2)):
            ax.legend(
                loc="lower center", bbox_to_anchor=(0.45, 1.12), ncols=columns, fontsize=6.6,
                columnspacing=0.9, handlelength=1.1,
            )  # fmt: skip
        return svg_of(figure)


def like_for_like(predicted: tuple[Predicted, ...], found: tuple[Errors, ...]) -> str:
    """Designed against random sets of the same size: predicted by noise, and true."""
    trials = list(dict.fromkeys(one.trial for one in found))
    poses = {one.trial: one.poses for one in found}
    truths = list(dict.fromkeys(one.truth for one in found))
    panels = 1 + len(truths)
    with drawing(1, panels, height=0.95 + 0.33 * len(trials), sharey=True) as (figure, axes):
        for one in predicted:
            if one.trial in trials and one.against == one.poses:
                lower, upper = (100 * (x - 1) for x in (one.tool.low, one.tool.high))
                middle = 100 * (one.tool.value - 1)
                dot(axes[0], middle, (lower, upper), trials.index(one.trial), one.estimator)
        axes[0].set_title("predicted from noise")
        axes[0].set_xlabel("tool u against random [%]")
        for ax, truth in zip(axes[1:], truths, strict=True):
            for pair in (each for each in found if each.truth == truth):
                middle, lower, upper = percent_of(pair.ratio)
                dot(ax, middle, (lower, upper), trials.index(pair.trial), pair.estimator)
            ax.set_title(f"true, {truth} robots")
            ax.set_xlabel("error against random [%]")
        for ax in axes:
            rows_of(ax, [f"{name} ({poses[name]} poses)" for name in trials])
            ax.axvline(0.0, color=SOFT, linewidth=0.9)
        names = {"paper": "paper's estimator", "whitened": "noise weighed"}
        legend_entries(axes[0], {names[mode]: LOOKS[mode] for mode in ESTIMATORS})
        legend_above(figure, axes[0])
        return svg_of(figure)


def dot(ax: "Axes", middle: float, ends: tuple[float, float], row: int, estimator: str) -> None:
    """One figure with its interval, in its row."""
    y = row + APART * (1 if estimator == "whitened" else -1)
    look = LOOKS[estimator]
    if np.isfinite(ends).all():
        ax.plot(list(ends), [y, y], color=look["color"], linewidth=1.6)
    ax.plot(middle, y, linestyle="none", **look)


def what_u_best_holds(found: tuple[Held, ...]) -> str:
    """Share of true points inside each 95 % statement."""
    truths = list(dict.fromkeys(one.truth for one in found))
    rows = [(one.truth, one.trial) for one in found]
    with drawing(1, len(STATEMENTS), height=0.8 + 0.34 * len(rows), sharey=True) as (figure, axes):
        for s, (ax, statement) in enumerate(zip(axes, STATEMENTS, strict=True)):
            ax.axvline(95.0, color=SOFT, linewidth=0.9)
            for y, one in enumerate(found):
                mean, color = one.shares[s], (DARK, MIDDLE)[truths.index(one.truth) % 2]
                ax.plot(share_ends(mean), [y, y], color=color, linewidth=2.0)
                face = color if mean.high >= 0.95 else "white"
                ax.plot(100 * mean.value, y, "o", color=color, markerfacecolor=face)
            ax.set_xlim(-4, 104)
            ax.set_title(TITLES[statement], fontsize=7.8)
            ax.set_xlabel("inside [%]")
        for ax in axes:
            rows_of(ax, [f"{truth}, {trial}" for truth, trial in rows])
            for y in range(1, len(rows)):
                if rows[y][0] != rows[y - 1][0]:
                    ax.axhline(y - 0.5, color=FAINT, linewidth=0.6)
        return svg_of(figure)


def parameter_budget(budget: PaperBudget) -> str:
    """Combined parameter uncertainties of the optimal and the random protocol, ours and printed."""
    is_length = np.array(list(map(paper.is_length, budget.names)))

    def printed(column: paper.Column) -> Array:
        """A column of Table 3 (f,) [m, rad]; nan where it has no such row."""
        rows = dict(zip(paper.PARAMETERS, paper.table3(column), strict=True))
        return np.array([rows.get(name, np.nan) for name in budget.names])

    with drawing(1, 2, height=2.7) as (figure, axes):
        for ax, which, unit in ((axes[0], ~is_length, "deg"), (axes[1], is_length, "mm")):
            names = [name for name, here in zip(budget.names, which, strict=True) if here]
            x = np.arange(len(names))
            series = (
                ("random protocol, ours", budget.random, "^", MIDDLE, 3.8, MIDDLE),
                ("optimal set, ours", budget.best[0], "o", DARK, 3.8, DARK),
                ("random, Table 3", printed("u_random"), "^", MIDDLE, 5.5, "none"),
                ("optimal, Table 3", printed("u_best"), "o", DARK, 5.5, "none"),
            )
            for label, value, marker, color, size, face in series:
                look: Look = {"color": color, "markersize": size, "markerfacecolor": face}
                ax.plot(x, in_units(value, is_length)[which], marker, label=label, **look)
            ax.set_yscale("log")
            ax.set_ylabel(f"u [{unit}]")
            ax.set_xticks(x, names, rotation=90)
        legend_above(figure, axes[0])
        return svg_of(figure)
