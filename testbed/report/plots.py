"""What all pictures share: looks of points, legends, axes, where the tracker stands."""

from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from testbed.report.svg import FAINT, INK
from testbed.units import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Look = dict[str, Any]
"""Properties of a line, as matplotlib names them."""


def toward(ax: "Axes", station: Array) -> None:
    """A small arrow in a corner that points where the tracker (2,) stands, far outside the view."""
    heading = station / max(float(np.linalg.norm(station)), 1e-12)
    ax.annotate(
        "tracker",
        xy=(0.87 + 0.11 * heading[0], 0.12 + 0.11 * heading[1]),
        xytext=(0.87 - 0.06 * heading[0], 0.12 - 0.06 * heading[1]),
        xycoords="axes fraction",
        ha="right",
        va="center",
        fontsize=6.5,
        color=INK,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 0.8, "shrinkA": 2},
    )


def dots(ax: "Axes", points: Array, color: str = FAINT) -> None:
    """Many small round dots as one path: a tenth of the bytes of a marker each."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    vertices = np.repeat(points, 2, axis=0)
    path = Path(vertices, np.tile([Path.MOVETO, Path.LINETO], len(points)))
    # dots have no length: simplification would drop every one
    path.should_simplify = False
    ax.add_patch(PathPatch(path, edgecolor=color, linewidth=1.6, capstyle="round", fill=False))
    ax.update_datalim(points)
    ax.autoscale_view()


def legend_above(figure: "Figure", ax: "Axes") -> None:
    """One legend for all panels, in a line above them."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))


def plain_log(ax: "Axes") -> None:
    """Tick labels 0.01, 0.1, 1 instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def short_ticks(ax: "Axes", axis: str = "y") -> None:
    """At most five ticks, small numbers with one common power of ten."""
    ax.locator_params(axis=axis, nbins=5)  # type: ignore[arg-type]  # "x" or "y"
    ax.ticklabel_format(axis=axis, style="sci", scilimits=(-3, 4), useMathText=True)  # type: ignore[arg-type]  # "x" or "y"


def percent_of(ratio: Mean) -> tuple[float, float, float]:
    """A logarithm of a ratio with its interval, as changes in percent."""
    middle, low, high = (100 * float(np.expm1(x)) for x in (ratio.value, ratio.low, ratio.high))
    return middle, low, high
