"""The figures of accuracy and pose sets, one function each: records in, one SVG element out."""

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from calib.shown import length_words
from testbed.report.plots import (
    BARS,
    LETTER,
    Look,
    dots,
    free_place,
    key_in_corner,
    legend_above,
    log_ticks,
    marked_line,
    room_across,
    short_ticks,
    toward,
)
from testbed.report.svg import DARK, HALF_WIDTH, INK, LIGHT, MIDDLE, SOFT, WIDTH, drawing, svg_of
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets
from testbed.units import MM, UM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PANELS = 6
"""Trials shown in one figure; the tables hold all."""
UNCERTAINTIES = ("A", "V", "G")
"""Criteria whose figure is a standard uncertainty, smaller is better; the others are indices."""
PALE = "#ecc9b4"
"""Of random sets in a histogram: pale vermilion, as the marks of theirs are vermilion."""
TOP = 102.0
"""Upper end of axes of shares [%]."""
MOST_VIEWS = 4
"""Panels of the figures that show one pose set each."""
LOOKS: dict[str, Look] = {
    "whitened": {"marker": "o", "color": DARK, "markersize": 3.4},
    "paper": {"marker": "^", "color": MIDDLE, "markersize": 3.6, "markerfacecolor": "none"},
}
"""Marker and color of each estimator, the same in every figure."""
DASHES: dict[str, Any] = {"whitened": "-", "paper": (0, (1.5, 1))}
"""Of their lines, told apart in gray."""
NAMES = {"whitened": "default estimator", "paper": "paper estimator"}


def only(everything: Sequence[object], most: int = MOST_PANELS) -> str:
    """What a caption adds where a figure shows only the first few; else nothing."""
    return f" (the first {most} of {len(everything)})" if len(everything) > most else ""


def shown(campaign: Campaign) -> tuple[Trial, ...]:
    """The trials that figures show."""
    return campaign.trials[:MOST_PANELS]


def error_distributions(trials: Sequence[Trial]) -> str:
    """Tool position errors at the held-out poses before and after, as shares below each size.

    Upright lines stand where the believed region of the default estimator ends (R95).
    """
    columns = len(trials) if len(trials) < 4 else 2 if len(trials) == 4 else 3
    rows = ceil(len(trials) / columns)
    with drawing(rows, columns, height=0.6 + 1.55 * rows, sharex=True, sharey=True) as (
        figure,
        axes,
    ):
        for k, (ax, trial) in enumerate(zip(axes, trials, strict=False)):
            before = trial.estimates[0].comparison.before
            look: Look = {"color": SOFT, "linestyle": (0, (4, 2)), "label": "nominal model"}
            _shares_below(ax, before, look)
            for estimate in trial.estimates:
                look = {"color": LOOKS[estimate.mode]["color"], "label": NAMES[estimate.mode]}
                look["linestyle"] = DASHES[estimate.mode]
                _shares_below(ax, estimate.comparison.after, look)
            ax.set_xscale("log")
            if len(trials) > 1:
                ax.set_title(trial.name)
            if k % columns == 0:
                ax.set_ylabel("poses [%]")
            if k >= len(trials) - columns:
                ax.set_xlabel("error of the tool [mm]")
                ax.tick_params(labelbottom=True)  # also above an empty place
        low, high = axes[0].get_xlim()
        log_ticks(axes[0].xaxis, low, high, most=9 if columns < 3 else 5)
        axes[0].set(ylim=(0, TOP), yticks=[0, 25, 50, 75, 100])
        room = (room_across(axes[0]), 75.0)
        for ax, trial in zip(axes, trials, strict=False):
            _mark_radius(ax, trial, room)
        for ax in axes[len(trials) :]:
            ax.set_visible(False)
        legend_above(figure, axes[0])
        return svg_of(figure)


def _mark_radius(ax: "Axes", trial: Trial, room: tuple[float, float]) -> None:
    """A line at the believed radius of a trial, named where no curve of the panel runs."""
    stated = [one.statement for one in trial.estimates if one.statement is not None]
    radii = [one.point.radius_mean for one in stated if one.point is not None]
    low, high = np.log(ax.get_xlim())
    errors = [trial.estimates[0].comparison.before]
    errors += [estimate.comparison.after for estimate in trial.estimates]
    curves = [
        ((np.log(np.sort(error) * MM) - low) / (high - low), shares(error) / TOP)
        for error in errors
    ]
    for radius in radii:
        name = f"R95 {length_words(radius, um='.3g')}".replace("um", "µm")
        place = float((np.log(radius * MM) - low) / (high - low))
        size = (LETTER[0] * 7.5 * len(name), 7.5)
        look: Look = {"color": INK, "linewidth": 0.9, "linestyle": (0, (1, 1))}
        found = free_place(curves, place, room, size)
        if found is None:
            ax.axvline(radius * MM, **look)
            key_in_corner(ax, name, **look)
        else:
            side, foot = found
            marked_line(ax, radius * MM, name, 3 * side, height=foot, **look)


def shares(error: Array) -> Array:
    """Share (m,) of all errors (m,) that are at most so large as each, from small to large [%]."""
    return 100 * np.arange(1, len(error) + 1) / len(error)


def _shares_below(ax: "Axes", error: Array, look: Look) -> None:
    """Which share [%] of errors (m,) [m] is at most so large, as a line of steps [mm]."""
    x = np.sort(error) * MM
    ax.step(np.r_[x[0], x], np.r_[0.0, shares(error)], where="post", **look)


def pose_space(campaign: Campaign) -> str:
    """Tool positions of the pool and of each trial's set, seen from above and from the side."""
    trials = campaign.trials[:MOST_VIEWS]
    pool = campaign.setting.pool_nominal[:, :3, 3] * MM
    station = campaign.setting.T_world_tracker[:2, 3]
    above, side = (0, 1, "above"), (0, 2, "side")
    if len(trials) <= 2:
        # one row: both views of a trial beside each other
        rows, panels = 1, [(trial, view) for trial in trials for view in (above, side)]
    else:
        rows, panels = 2, [(trial, view) for view in (above, side) for trial in trials]
    columns = len(panels) // rows
    width = HALF_WIDTH if len(trials) == 1 else WIDTH
    with drawing(rows, columns, height=0.4 + 1.6 * rows, width=width) as (figure, axes):
        for k, (ax, (trial, (i, j, view))) in enumerate(zip(axes, panels, strict=True)):
            chosen = pool[trial.selection.indices]
            dots(ax, pool[:, [i, j]])
            random = trial.method == "random"
            look: Look = {"color": MIDDLE if random else DARK, "markersize": 3.2}
            ax.plot(chosen[:, i], chosen[:, j], "^" if random else "o", **look)
            ax.set_title(f"{trial.name}\n{view}")  # above each other: both fit any panel
            ax.set_ylabel(f"{'xyz'[j]} [mm]" if rows == 1 or k % columns == 0 else "")
            if k >= len(panels) - columns:
                ax.set_xlabel("x [mm]")
            if view == "above":
                toward(ax, station)
            ax.set_aspect("equal", anchor="W")
        return svg_of(figure)


def unit_of_criterion(trial: Trial) -> str:
    """Unit of the figure a set was chosen by: "m" for an uncertainty, "1" for an index."""
    return "m" if trial.selection.criterion in UNCERTAINTIES and trial.rows == "whitened" else "1"


def unit_factor(unit: str, criterion: str) -> tuple[float, str]:
    """Factor from SI to what an axis shows, and the axis's name."""
    return (UM, f"{criterion} [µm]") if unit == "m" else (1.0, criterion)


def pose_count(study: PoseCountStudy) -> str:
    """Mean index of random sets against their size, with the rule's choice."""
    with drawing(2, 2, height=3.7) as (figure, axes):
        for ax, name, chosen in zip(axes, ("O1", "O2"), study.chosen, strict=False):
            i = study.names.index(name)
            low, high = study.mean[i] - study.spread[i], study.mean[i] + study.spread[i]
            ax.fill_between(study.counts, low, high, color="#d5e3f0", linewidth=0)
            ax.plot(study.counts, study.mean[i], color=DARK)
            if chosen is not None:
                look: Look = {"color": MIDDLE, "linestyle": "--", "linewidth": 1.0}
                marked_line(ax, chosen, f"the rule: {chosen} poses", 4, height=0.08, **look)
            title = f"{name}: mean ± sd of 50 random sets"
            ax.set(title=title, xlabel="poses per set", ylabel=name)
            short_ticks(ax)
        forms = (
            (study.mean, "as printed: O3, O4, O5 go on moving"),
            (study.mean_per_pose, "per pose: all five settle"),
        )
        styles = ("-", "--", "-.", ":", (0, (1, 1)))
        colors = (INK, SOFT, DARK, MIDDLE, LIGHT)
        for ax, (mean, title) in zip(axes[2:], forms, strict=True):
            for i, name in enumerate(study.names):
                ratio = mean[i] / mean[i, -1]
                ax.plot(study.counts, ratio, linestyle=styles[i], color=colors[i], label=name)
            ylabel = f"index / its value at {study.counts[-1]} poses"
            ax.set(title=title, xlabel="poses per set", ylabel=ylabel, ylim=(0.0, 2.0))
        axes[3].legend(ncols=3, loc="upper right")
        return svg_of(figure)


def random_sets(sets: Sequence[RandomSets]) -> str:
    """The figure of each designed set beside those of random sets of the same size."""
    sets = sets[:MOST_VIEWS]
    with drawing(1, len(sets), height=1.9) as (figure, axes):
        for ax, one in zip(axes, sets, strict=True):
            scale, name = unit_factor(one.unit, one.criterion)
            ax.hist(one.values * scale, bins=14, **BARS | {"color": PALE})
            marked_line(
                ax, one.chosen_value * scale, "chosen set", -3 if one.larger_is_better else 3,
                height=0.96, color=DARK, linewidth=1.6,
            )  # fmt: skip
            title = f"{one.trial}: {one.n_poses} poses"
            ax.set(title=title, xlabel=name, ylabel="random sets")
            short_ticks(ax, axis="x")
        return svg_of(figure)
