"""The figures of belief: the uncertainty budget as bars, and the tool point's u over the room."""

from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import Array, Index
from calib.uncertainty.tool_map import tool_map
from testbed.report.plots import label
from testbed.report.svg import DARK, INK, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.statement.records import Statement
from testbed.studies.trial.statement.sources import full_covariance
from testbed.units import MM, UM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELL = 0.1
"""Edge of the cells of the map [m]."""


def budget_bars(statements: list[tuple[str, Statement]]) -> str:
    """One bar per source and trial, the combined u and the discrepancy below them."""
    names = list(dict.fromkeys(name for _, statement in statements for name in statement.sources))
    labels = [*names, "combined", "discrepancy"]
    with drawing(1, len(statements), height=0.75 + 0.2 * len(labels), sharey=True, sharex=True) as (
        figure,
        axes,
    ):
        for ax, (title, statement) in zip(axes, statements, strict=True):
            known = dict(zip(statement.sources, statement.source_u * UM, strict=True))
            values = [known.get(name, 0.0) for name in names]
            ax.barh(range(len(names)), values, color=DARK, height=0.62)
            ax.barh([len(names)], [statement.combined_u * UM], color=INK, height=0.62)
            discrepancy = 0.0 if np.isnan(statement.discrepancy_u) else statement.discrepancy_u * UM
            ax.barh(
                [len(names) + 1], [discrepancy], facecolor="none", edgecolor=MIDDLE, hatch="////",
                height=0.62,
            )  # fmt: skip
            for k, value in enumerate([*values, statement.combined_u * UM, discrepancy]):
                label(ax, f"{value:.3g}", (value, k), (3, 0), size=7, va="center", color=SOFT)
            ax.set_yticks(range(len(labels)), labels)
            ax.set(title=title, xlabel="u [µm]")
            ax.grid(visible=False, axis="y")
        axes[0].invert_yaxis()
        low, high = axes[0].get_xlim()
        axes[0].set_xlim(low, 1.18 * high)
        return svg_of(figure)


def tool_maps(campaign: Campaign, trial: Trial) -> str:
    """u_3D of the tool point over the pool's work space, from above and from the side."""
    from matplotlib import colormaps

    estimate = next(e for e in trial.estimates if e.statement is not None)
    result, statement = estimate.identification, estimate.statement
    assert statement is not None, "chosen because it has one"
    target = campaign.setting.target
    made = tool_map(
        result.model,
        campaign.setting.pool_q,
        full_covariance(result, result.covariance + statement.systematic),
        cell=CELL,
        discrepancy=None if statement.trust.model_valid else statement.discrepancy,
        target=target if target.any() else None,
    )
    x, y, z = (edges(made.corner[k], made.count.shape[k]) for k in range(3))
    square: Array = np.where(made.count > 0, made.mean**2, 0.0) * made.count
    views = [(x, y, 2, "above", "y"), (x, z, 1, "side", "z")]
    flat = [shown(square, made.count, axis) for _, _, axis, _, _ in views]
    low = min(float(np.nanmin(u)) for u in flat)
    high = max(float(np.nanmax(u)) for u in flat)
    middle = (low + high) / 2
    # a difference of a few percent must not look like one of black and white
    low, high = min(low, 0.8 * middle), max(high, 1.2 * middle)
    # few enough colors that the bar beside the map is drawn, not embedded as a picture
    colors = colormaps["cividis"].resampled(24)
    with drawing(1, 2, height=2.6) as (figure, axes):
        for ax, (across, up, _, title, letter), u in zip(axes, views, flat, strict=True):
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
