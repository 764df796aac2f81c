"""Pictures of a test: where the cycles of each pose fell, paths in their tube, drift."""

from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array, evenly
from testbed.iso9283.records import CycleResult, PathShown, PoseDrift
from testbed.lengths import column_unit
from testbed.report.plots import dots, label, legend_above, legend_entries
from testbed.report.svg import DARK, FAINT, INK, LIGHT, MIDDLE, SOFT, drawing, svg_of
from testbed.units import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POSES = 5
"""Poses that are drawn: those that scatter most."""
MOST_DRIFTS = 8
PALE = "#c9d6e3"
FEW = 200
"""Readings of each half up to which each is a marker; of more so many are drawn."""
WIDE = 0.09
"""Largest drawn error of a path, as part of its size."""


def drawn(result: CycleResult) -> list[int]:
    """Entries whose clusters are drawn, in the order of the test."""
    RP = np.array([figure.value for figure in result.of("RP")])
    return sorted(np.argsort(-RP, kind="stable")[:MOST_POSES].tolist())


def clusters(result: CycleResult) -> str:
    """Cycles of each pose about their barycenter, in two views, with the sphere of RP."""
    visits = result.test.visits
    assert visits is not None  # asked for where there are some
    entries = drawn(result)
    sizes = [result.of("RP")[e].value for e in entries]
    about = [visits.position[e] - visits.position[e].mean(axis=0) for e in entries]
    largest = max(*sizes, *(float(np.abs(each).max()) for each in about))
    scale, unit = column_unit(largest)
    reach = 1.25 * largest * scale
    n = len(entries)
    width = min(7.1, 1.9 + 1.42 * n)
    with drawing(2, n, height=3.4, width=width, pairs=True, sharex=True, sharey=True) as (
        figure, axes,
    ):  # fmt: skip
        for k, (e, radius) in enumerate(zip(entries, sizes, strict=True)):
            x = about[k] * scale
            toward = (visits.command[e] - visits.position[e].mean(axis=0)) * scale
            views = axes[2 * k : 2 * k + 2]
            for ax, j in zip(views, (1, 2), strict=True):
                _cluster(ax, x[:, [0, j]], radius * scale, toward[[0, j]], reach)
                _name_axes(ax, views[0], "xyz"[j], unit)
            views[0].set_title(_short(visits.names[e]))
        axes[0].set_xlim(-reach, reach)
        axes[0].set_ylim(-reach, reach)
        legend_entries(
            axes[0],
            {
                "first half of the cycles": {
                    "marker": "^" if visits.cycles <= 2 * FEW else "o",
                    "color": LIGHT,
                },
                "second half": {"marker": "o", "color": DARK},
                "barycenter": {"marker": "+", "color": INK, "markersize": 7},
                "toward the command": {"linestyle": "-", "color": MIDDLE},
                "RP": {"linestyle": "-", "color": SOFT, "linewidth": 0.9},
            },
        )
        legend_above(figure, axes[0])
        return svg_of(figure)


def _name_axes(ax: "Axes", upper: "Axes", name: str, unit: str) -> None:
    """Names where no panel to the left or below has the same; views may stand side by side."""
    place, first = ax.get_subplotspec(), upper.get_subplotspec()
    assert place is not None  # panels of a drawing
    assert first is not None
    if place.is_first_col() or place.colspan != first.colspan:
        ax.set_ylabel(f"{name} [{unit}]")
    if place.is_last_row():
        ax.set_xlabel(f"x [{unit}]")


def _short(name: str, most: int = 16) -> str:
    """A name that stands over a small panel."""
    return name if len(name) <= most else f"{name[: most - 1]}…"


def _cluster(ax: "Axes", x: Array, radius: float, toward: Array, reach: float) -> None:
    """One view of one pose; the arrow ends at the command, or at the edge on the way there."""
    turn = np.linspace(0, 2 * np.pi, 90)
    ax.plot(radius * np.cos(turn), radius * np.sin(turn), color=SOFT, linewidth=0.9)
    half = len(x) // 2
    for part, color, marker in ((x[:half], LIGHT, "^"), (x[half:], DARK, "o")):
        if len(part) > FEW:
            dots(ax, part[evenly(np.arange(len(part)), FEW)], color)
        else:
            ax.plot(part[:, 0], part[:, 1], marker, color=color, markersize=2.6)
    ax.plot(0, 0, "+", color=INK, markersize=7)
    length = float(np.abs(toward).max())
    end = toward * min(1.0, 0.93 * reach / max(length, 1e-9))
    ax.annotate(
        "", xy=(end[0], end[1]), xytext=(0, 0),
        arrowprops={"arrowstyle": "->", "color": MIDDLE, "linewidth": 0.9, "shrinkA": 0,
                    "shrinkB": 0},
    )  # fmt: skip
    ax.set_aspect("equal")
    ax.locator_params(nbins=4)


def factor_of(path: PathShown) -> int:
    """How many times larger than life the errors of a path are drawn."""
    size = float(np.ptp(path.command, axis=0).max())
    largest = float((path.AT + path.RT).max())
    whole = WIDE * size / max(largest, 1e-12)
    step = 10.0 ** np.floor(np.log10(max(whole, 1.0)))
    return int(max(step * max(k for k in (1, 2, 5) if k * step <= max(whole, 1.0)), 1))


def path_picture(path: PathShown) -> str:
    """A path with its tube, errors drawn larger than life, and AT and RT along it."""
    axes_of_it = np.argsort(-np.ptp(path.command, axis=0), kind="stable")[:2]
    i, j = sorted(int(k) for k in axes_of_it)
    times, mm = factor_of(path), 1e3
    command = path.command * mm
    shown = command + times * (path.mean - path.command) * mm
    with drawing(1, 2, height=2.9, width_ratios=(1.0, 1.25)) as (figure, (view, curve)):
        _tube(view, shown[:, [i, j]], times * path.RT * mm)
        view.plot(command[:, i], command[:, j], color=MIDDLE, linewidth=0.9, linestyle="--")
        view.plot(shown[:, i], shown[:, j], color=DARK, linewidth=1.1)
        worst = int(path.AT.argmax())
        view.plot(shown[worst, i], shown[worst, j], "o", color=DARK, markersize=4)
        view.set_aspect("equal", "datalim")
        view.set_xlabel(f"{'xyz'[i]} [mm]")
        view.set_ylabel(f"{'xyz'[j]} [mm]")
        view.set_title(f"errors × {times}")
        along, (scale, unit) = path.along * mm, column_unit([*path.AT, *path.RT])
        curve.plot(along, path.AT * scale, color=DARK, label="mean path from command")
        curve.plot(along, path.RT * scale, color=LIGHT, label="RT of each point")
        for values, color, name in ((path.AT, DARK, "AT"), (path.RT, LIGHT, "RT")):
            k = int(values.argmax())
            curve.plot(along[k], values[k] * scale, "o", color=color, markersize=4)
            text = f"{name} {significant(float(values[k]) * scale)}"
            side = "left" if k < len(along) / 3 else "right" if k > 2 * len(along) / 3 else "center"
            label(curve, text, (float(along[k]), float(values[k]) * scale), (0, 4), ha=side)
        curve.set_ylim(0, 1.2 * scale * float(max(path.AT.max(), path.RT.max())))
        curve.set_xlabel("along the path [mm]")
        curve.set_ylabel(f"[{unit}]")
        curve.plot([], [], color=MIDDLE, linestyle="--", linewidth=0.9, label="commanded")
        legend_above(figure, curve)
        return svg_of(figure)


def _tube(ax: "Axes", center: Array, radius: Array) -> None:
    """A band about a line (m, 2), as wide as RT to both sides."""
    step = np.gradient(center, axis=0)
    across = np.stack([-step[:, 1], step[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    sides = [center + sign * radius[:, None] * across for sign in (1.0, -1.0)]
    for k in range(len(center) - 1):
        corner = np.array([sides[0][k], sides[0][k + 1], sides[1][k + 1], sides[1][k]])
        ax.fill(corner[:, 0], corner[:, 1], color=PALE, linewidth=0)


def drift_picture(drifts: tuple[PoseDrift, ...]) -> str:
    """AP and RP of each pose, block after block."""
    with drawing(1, 2, height=2.2) as (figure, axes):
        for ax, key in zip(axes, ("AP", "RP"), strict=True):
            shown = [getattr(one, key).max() for one in drifts]
            scale, unit = column_unit(shown)
            for one in drifts[:MOST_DRIFTS]:
                ax.plot(one.hours, getattr(one, key) * scale, "o-", color=FAINT, markersize=3)
            worst = min(drifts, key=lambda one: min(one.p_values))
            ax.plot(worst.hours, getattr(worst, key) * scale, "o-", color=DARK, markersize=3.5,
                    label=_short(worst.where, 30))  # fmt: skip
            ax.set_ylabel(f"{key} [{unit}]")
            ax.set_xlabel("time [h]")
            ax.set_ylim(bottom=0)
        axes[0].plot([], [], "o-", color=FAINT, markersize=3, label="other poses")
        legend_above(figure, axes[0])
        return svg_of(figure)
