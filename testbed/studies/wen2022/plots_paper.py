"""The pictures of the paper on one robot: parameter budget, tool point, both forms."""

from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from calib.uncertainty.regions import coverage_factor
from testbed.report.plots import Look, legend_above, plain_log
from testbed.report.svg import DARK, INK, MIDDLE, drawing, svg_of
from testbed.studies.wen2022 import paper
from testbed.studies.wen2022.records import PaperBudget, ToolPointStudy
from testbed.units import MM, UM, in_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def parameter_budget(budget: PaperBudget) -> str:
    """Combined parameter uncertainties of the optimal and the random protocol, ours and printed."""
    is_length = np.array(list(map(paper.is_length, budget.names)))
    printed = _printed(budget.names)
    with drawing(1, 2, height=2.7) as (figure, axes):
        for ax, which, unit in ((axes[0], ~is_length, "deg"), (axes[1], is_length, "mm")):
            names = [name for name, here in zip(budget.names, which, strict=True) if here]
            x = np.arange(len(names))
            series = (
                ("random protocol, ours", budget.random, "^", MIDDLE, 3.8, MIDDLE),
                ("optimal set, ours", budget.best, "o", DARK, 3.8, DARK),
                ("random, Table 3", printed[1], "^", MIDDLE, 5.5, "none"),
                ("optimal, Table 3", printed[0], "o", DARK, 5.5, "none"),
            )
            for label, value, marker, color, size, face in series:
                look: Look = {"color": color, "markersize": size, "markerfacecolor": face}
                ax.plot(x, in_units(value, is_length)[which], marker, label=label, **look)
            ax.set_yscale("log")
            ax.set_ylabel(f"u [{unit}]")
            ax.set_xticks(x, names, rotation=90)
        legend_above(figure, axes[0])
        return svg_of(figure)


def zero_pose_regions(study: ToolPointStudy) -> str:
    """95 % regions of the tool point at the zero pose in three planes, both forms."""
    k = coverage_factor(2)
    with drawing(1, 3, height=2.75) as (figure, axes):
        axis = "xyz"
        for ax, (i, j) in zip(axes, ((0, 1), (0, 2), (1, 2)), strict=True):
            full = study.covariance[0][np.ix_([i, j], [i, j])]
            factor = k * np.linalg.cholesky(full) * UM
            _ellipse(ax, factor, color=DARK, label="full covariance, 3-D")
            for source, label, style in (
                ("ours best", "independent draws, ours", "--"),
                ("table 3 best", "independent draws, Table 3", ":"),
            ):
                if source in study.source:
                    spread = study.spread[study.source.index(source), 0][[i, j]]
                    look = {"color": MIDDLE if style == "--" else INK, "linestyle": style}
                    _ellipse(ax, k * np.diag(spread) * UM, label=label, **look)
            ax.set_xlabel(f"{axis[i]} [µm]")
            ax.set_ylabel(f"{axis[j]} [µm]")
            ax.set_aspect("equal")
        reach = max(abs(edge) for ax in axes for edge in (*ax.get_xlim(), *ax.get_ylim()))
        for ax in axes:
            ax.set(xlim=(-reach, reach), ylim=(-reach, reach))
        legend_above(figure, axes[0])
        return svg_of(figure)


def held_out_uncertainty(study: ToolPointStudy) -> str:
    """Tool-point uncertainty over the held-out poses: |P| and 3-D, optimal against random."""
    groups = [
        (title, [source for source in study.source if source.startswith(prefix)])
        for prefix, title in (("table 3", "u from Table 3"), ("ours", "u of this campaign"))
    ]
    groups = [(title, sources) for title, sources in groups if sources]
    x = np.arange(1, study.distance_sd.shape[1])
    full = np.sqrt(np.trace(study.covariance[1:], axis1=1, axis2=2))
    with drawing(1, len(groups), height=2.9, sharey=True) as (figure, axes):
        for ax, (title, sources) in zip(axes, groups, strict=True):
            for source in sources:
                at, best = study.source.index(source), source.endswith("best")
                color, name = (DARK, "optimal") if best else (MIDDLE, "random")
                marker = "o" if best else "^"
                look: Look = {"color": color, "linestyle": "none", "markersize": 3.2}
                ax.plot(x, study.spatial[at, 1:] * MM, marker, label=f"{name}, 3-D", **look)
                look["markerfacecolor"] = "none"
                distance = study.distance_sd[at, 1:] * MM
                ax.plot(x, distance, marker, label=f"{name}, |P| only", **look)
            if title.endswith("campaign"):
                ax.plot(x, full * MM, "_", color=INK, label="full covariance, 3-D", markersize=5)
            ax.set_yscale("log")
            ax.set_title(title)
            ax.set_xlabel("held-out pose")
        axes[0].set_ylabel("standard uncertainty [mm]")
        legend_above(figure, axes[-1])
        plain_log(axes[0])
        return svg_of(figure)


def _printed(names: tuple[str, ...]) -> tuple[Array, Array]:
    """Columns u_best and u_rand (f,) of Table 3 [m, rad]; nan where it has no such row."""
    best, random = paper.table3("u_best"), paper.table3("u_random")
    place = [paper.PARAMETERS.index(n) if n in paper.PARAMETERS else -1 for n in names]
    absent = np.array(place) < 0
    return np.where(absent, np.nan, best[place]), np.where(absent, np.nan, random[place])


def _ellipse(ax: "Axes", factor: Array, **look: Any) -> None:
    """Outline of the image of the unit circle under `factor` (2, 2)."""
    angle = np.linspace(0.0, 2 * np.pi, 121)
    x, y = factor @ np.array([np.cos(angle), np.sin(angle)])
    ax.plot(x, y, **look)
