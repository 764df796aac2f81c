"""Pictures of the answers of the lessons in `scenes/`, drawn on axes for a projector."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from testbed.report.svg import DARK, INK, LIGHT, MIDDLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SKY, GRAY = "#56b4e9", "#b7b7b7"
THIN: Any = {"color": INK, "linewidth": 1.5}
"""Of a line that the others are held against."""


def error_by_poses(
    axes: "Axes", counts: Sequence[int], found: Mapping[str, Array], names: Mapping[str, str]
) -> None:
    """The errors (seeds, counts) [um] against the number of poses, and where noise would be."""
    for (kind, um), color in zip(found.items(), (DARK, MIDDLE), strict=True):
        axes.fill_between(counts, um.min(axis=0), um.max(axis=0), color=color, alpha=0.2)
        axes.plot(counts, um.mean(axis=0), "o-", color=color, label=names[kind])
        alone = um.mean(axis=0)[counts.index(29)] * (29 / np.array(counts)) ** 0.5
        axes.plot(counts, alone, ":", color=color)
    axes.set(xlabel="poses", ylabel="mean true error [um]", xscale="log", yscale="log")
    axes.set_xticks(counts, [str(count) for count in counts])
    steps = (5, 10, 20, 50, 100, 200, 400)
    axes.set_yticks(steps, [str(one) for one in steps])
    axes.minorticks_off()
    axes.set_title("Dotted: if all that is left after 29 poses were noise")
    axes.legend()


def against_random(
    axes: "Axes", found: Mapping[tuple[str, str], Array], names: Mapping[str, str]
) -> None:
    """A dot for each seed, a bar at the mean; below the line the chosen poses are better."""
    for place, ((kind, _), percent) in enumerate(found.items()):
        color = DARK if kind == "rigid" else MIDDLE
        axes.plot(np.full(len(percent), place), percent, "o", color=color, alpha=0.5)
        axes.plot([place - 0.25, place + 0.25], 2 * [percent.mean()], "-", color=color)
    axes.axhline(0.0, **THIN)
    axes.set_xticks(range(len(found)), [f"{name}, {names[kind]}" for kind, name in found])
    axes.set_ylabel("error against random poses [%]")
    axes.set_title("Above the line: worse than random")


def inside_by_poses(axes: "Axes", counts: Sequence[int], found: Mapping[int, Array]) -> None:
    """Points inside against poses, a line for each sag; crosses: inside the believed region."""
    for (sag, rows), color in zip(found.items(), (DARK, SKY, LIGHT, MIDDLE), strict=True):
        *alone, believed = rows.mean(axis=0)
        axes.plot(counts, alone, "o-", color=color)
        label = f"sag of {sag} mdeg" if sag else "no sag"
        axes.text(counts[-1] + 2, alone[-1], label, color=color, va="bottom")
        axes.plot(counts[0], believed, "x", color=color, markeredgewidth=3)
    axes.axhline(47.5, **THIN, linestyle=":")
    axes.set(xlabel="poses", ylabel="true points inside, of 50", ylim=(-1, 52), xlim=(25, 143))
    axes.set_xticks(counts)
    axes.set_title("Dotted: 95 %. Crosses: inside the believed region")


def share_by_held_out(axes: "Axes", found: Mapping[int, Array | None]) -> None:
    """What a radius holds, draw by draw, against the number of poses that it is from."""
    there = {count: rows for count, rows in found.items() if rows is not None}
    shares = [100 * rows[..., 1].ravel() for rows in there.values()]
    places = range(len(there))
    parts: Any = axes.violinplot(shares, places, showextrema=False, widths=0.8)
    for body in parts["bodies"]:
        body.set_facecolor(DARK)
    axes.plot(places, [share.mean() for share in shares], "o", color=DARK)
    axes.axhline(95.0, **THIN, linestyle=":")
    axes.set_xticks(places, [str(count) for count in there])
    axes.set(xlabel="held-out poses (with fewer there is no radius)", ylim=(78, 101))
    axes.set_ylabel("true points inside [%]")
    axes.set_title("Each draw of poses gives a radius; dots: the means")


def noise_and_error(axes: "Axes", found: Mapping[str, Array]) -> None:
    """Noise of a reading and error of the calibration (2, seeds) [um], by station."""
    looks = (("u of one reading", GRAY), ("true error after calibration", DARK))
    for row, (words, color) in enumerate(looks):
        um = np.array([values[row] for values in found.values()])
        mean, places = um.mean(axis=1), np.arange(len(um)) + 0.4 * row - 0.2
        reach = np.abs([um.min(axis=1) - mean, um.max(axis=1) - mean])
        axes.bar(places, mean, 0.38, yerr=reach, capsize=5, color=color, label=words)
    axes.set_xticks(range(len(found)), list(found))
    axes.set_ylabel("um")
    axes.set_title("Bars: means of six robots; lines: smallest to largest")
    axes.legend()
