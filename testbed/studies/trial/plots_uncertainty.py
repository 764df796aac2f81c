"""The figures of uncertainty: stated beside true, the budget, and the tool point over the room."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.tool_map import tool_map
from testbed.report.plots import label, legend_above
from testbed.report.svg import DARK, HALF_WIDTH, INK, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.trial.compare import INTERVAL
from testbed.studies.trial.plots import LOOKS, NAMES
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.statement.records import SUMS, Statement, sums_of
from testbed.units import MM, UM

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def parameter_errors(trial: Trial) -> str:
    """Error of each parameter in units of its own stated u, and how often intervals held it."""
    names = tuple(dict.fromkeys(n for e in trial.estimates for n in e.identification.names))
    played = [e for e in trial.estimates if e.replications is not None]
    rows = 2 if played else 1
    with drawing(rows, 1, height=1.0 + 1.4 * rows, sharex=True) as (figure, axes):
        ax = axes[0]
        ax.axhspan(-INTERVAL, INTERVAL, color="#e3ecf4", linewidth=0)
        ax.axhline(0.0, color=SOFT, linewidth=0.6)
        for estimate in trial.estimates:
            found = estimate.identification
            x = [names.index(name) for name in found.names]
            error = (estimate.comparison.true_step - found.step) / found.standard_uncertainty
            error[~estimate.judged] = np.nan
            name = NAMES[estimate.mode]
            ax.plot(x, error, linestyle="none", label=name, **LOOKS[estimate.mode])
        ax.set_yscale("symlog", linthresh=4.0)
        _symlog_ticks(ax)
        ax.set_ylabel("error / stated u")
        ax.set_title(f"{trial.name}: this calibration; shaded: the 95 % interval")
        for estimate in played:
            ax, held = axes[1], estimate.replications
            assert held is not None
            x = [names.index(name) for name in estimate.identification.names]
            if estimate is played[0]:
                low, high = 100 * held.coverage_band
                ax.axhspan(low, high, color="#e3ecf4", linewidth=0)
                ax.set_title(
                    f"{held.count} replications; shaded: where an honest 95 % statement stays "
                    "(99.9 %)"
                )
            look = LOOKS[estimate.mode]
            ax.plot(x, 100 * held.parameter_coverage, linestyle="none", **look)
            ax.set_ylabel("intervals that\nheld the truth [%]")
            ax.set_ylim(-4, 104)
        axes[-1].set_xticks(range(len(names)), names, rotation=90)
        axes[-1].set_xlim(-0.7, len(names) - 0.3)
        legend_above(figure, axes[0])
        return svg_of(figure)


def _symlog_ticks(ax: "Axes") -> None:
    """Ticks of a scale that is linear inside the interval and logarithmic outside."""
    low, high = ax.get_ylim()
    marks = [
        m for m in (-1000, -100, -30, -10, -4, -2, 0, 2, 4, 10, 30, 100, 1000) if low <= m <= high
    ]
    ax.set_yticks(marks, [f"{mark:g}".replace("-", "−") for mark in marks])
    ax.minorticks_off()


CELL = 0.1
"""Edge of the cells of the map [m]."""
FLAT = 1.5
"""Largest over smallest u below which no map is drawn."""


def budget_bars(statements: list[tuple[str, Statement]]) -> str:
    """One bar per source and trial, the sums below them, the discrepancy open."""
    names = list(dict.fromkeys(name for _, statement in statements for name in statement.sources))
    sums = [sums_of(statement) for _, statement in statements]
    below = [name for name in SUMS if any(name in one for one in sums)]
    labels = [*names, *below]
    with drawing(1, len(statements), height=0.75 + 0.2 * len(labels), sharey=True, sharex=True) as (
        figure,
        axes,
    ):
        for ax, (title, statement), own in zip(axes, statements, sums, strict=True):
            known = dict(zip(statement.sources, statement.source_u.tolist(), strict=True)) | own
            for k, name in enumerate(labels):
                value = UM * known.get(name, 0.0)
                ax.barh([k], [value], height=0.62, **bar_look(name))
                label(ax, f"{value:.3g}", (value, k), (3, 0), size=7, va="center", color=SOFT)
            ax.set_yticks(range(len(labels)), labels)
            ax.set(title=title, xlabel="u [µm]")
            ax.grid(visible=False, axis="y")
        axes[0].invert_yaxis()
        low, high = axes[0].get_xlim()
        axes[0].set_xlim(low, 1.18 * high)
        return svg_of(figure)


def bar_look(name: str) -> dict[str, Any]:
    """Sums are dark, and what is no part of them is open."""
    if name == "discrepancy":
        return {"facecolor": "none", "edgecolor": MIDDLE, "hatch": "////"}
    return {"color": INK if name in ("parameters alone", "believed") else DARK}


@dataclass(frozen=True, slots=True)
class ToolViews:
    """Believed u of the tool point over the work space, from above and from the side."""

    edges: tuple[Array, Array, Array]
    """Edges of the cells along x, y and z [m]."""
    above: Array
    side: Array
    """u [um] per cell of each view; nan where no posture came by."""

    @property
    def low(self) -> float:
        """Smallest u shown [um]."""
        return float(min(np.nanmin(u) for u in (self.above, self.side)))

    @property
    def high(self) -> float:
        """Largest u shown [um]."""
        return float(max(np.nanmax(u) for u in (self.above, self.side)))

    @property
    def flat(self) -> bool:
        """Whether u is so much the same everywhere that a map says nothing."""
        return self.high < FLAT * self.low


def tool_views(campaign: Campaign, trial: Trial) -> ToolViews:
    """Believed u_3D of the tool point over the pool's work space."""
    (belief,) = (
        one.statement.belief
        for one in trial.estimates
        if one.statement is not None and one.statement.belief is not None
    )
    q = campaign.setting.pool_q
    reached = q[belief.proven.applies(q).place != "outside"]
    made = tool_map(
        partial(belief.regions, target=campaign.setting.target),
        reached if len(reached) else q,
        cell=CELL,
    )
    x, y, z = (edges(made.corner[k], made.count.shape[k]) for k in range(3))
    square: Array = np.where(made.count > 0, made.mean**2, 0.0) * made.count
    above, side = (shown(square, made.count, axis) for axis in (2, 1))
    return ToolViews((x, y, z), above, side)


def tool_maps(views: ToolViews) -> str:
    """Two maps of u, from above and from the side."""
    from matplotlib import colormaps

    x, y, z = views.edges
    low, high = views.low, views.high
    middle = (low + high) / 2
    # few enough colors that the bar beside the map is drawn, not embedded as a picture
    colors = colormaps["cividis"].resampled(24)
    with drawing(1, 2, height=2.0, width=HALF_WIDTH) as (figure, axes):
        shown = ((x, y, views.above, "above", "y"), (x, z, views.side, "side", "z"))
        for ax, (across, up, u, title, letter) in zip(axes, shown, strict=True):
            mesh = ax.pcolormesh(
                across * MM, up * MM, u.T, cmap=colors, vmin=low, vmax=high, edgecolor="white",
                linewidth=0.2,
            )  # fmt: skip
            ax.set(xlabel="x [mm]", ylabel=f"{letter} [mm]", title=title, aspect="equal")
            numbers(ax, across, up, u, middle)
        figure.colorbar(mesh, ax=axes, label="u [µm]", shrink=0.9)
        return svg_of(figure)


def edges(corner: float, count: int) -> Array:
    """Edges (count + 1,) of the cells along one axis [m]."""
    return np.asarray(corner + CELL * np.arange(count + 1))


def shown(square: Array, count: Index, axis: int) -> Array:
    """RMS u [um] over the cells behind each one of a view; nan where no posture came by."""
    number = count.sum(axis=axis)
    total = square.sum(axis=axis)
    return np.asarray(np.sqrt(np.where(number > 0, total / np.maximum(number, 1), np.nan)) * UM)


def numbers(ax: "Axes", across: Array, up: Array, u: Array, middle: float) -> None:
    """The smallest and the largest value, written into their cells."""
    for find in (np.nanargmin, np.nanargmax):
        i, j = np.unravel_index(int(find(u)), u.shape)
        ax.annotate(
            f"{u[i, j]:.0f}",
            ((across[i] + CELL / 2) * MM, (up[j] + CELL / 2) * MM),
            ha="center",
            va="center",
            fontsize=6.5,
            color="white" if u[i, j] < middle else "black",
        )
