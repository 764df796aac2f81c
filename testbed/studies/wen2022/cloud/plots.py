"""The figure of the clouds of the tool point at the zero pose, in three views."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.arrays import Array
from testbed.report.plots import TICKS, Look, dots, legend_above
from testbed.report.svg import DARK, HALF_WIDTH, LIGHT, MIDDLE, WIDTH, drawing, svg_of
from testbed.studies.wen2022.cloud.draws import Cloud
from testbed.units import MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOM = 1.06
"""Extent of the views relative to the widest range."""
WIDE = 2.7
"""Width on paper of the two views beside each other [in]."""
WORDS = 1.5
"""Height of legend, title, ticks and names of the axes [in]."""


def zero_pose_clouds(clouds: Mapping[str, tuple[Cloud, Cloud]]) -> str:
    """Both clouds from above, from the front and from the side, all at one scale [mm].

    The views are arranged as on a drawing: x and z below x and y, and z and y beside it.
    """
    widest = np.max([np.abs(one.ends).max(axis=1) for pair in clouds.values() for one in pair], 0)
    x, y, z = ROOM * MM * widest
    tick = max(tick for tick in TICKS if tick < z)
    alone = len(clouds) == 1
    size: dict[str, Any] = {
        "width": HALF_WIDTH if alone else WIDTH,
        "height": WIDE * (y + z) / (x + z) + WORDS,
        "width_ratios": [x, z] * len(clouds),
        "height_ratios": [y, z],
    }
    columns = 2 * len(clouds)
    with drawing(2, columns, sharex="col", sharey="row", **size) as (figure, axes):
        for k, (whose, (best, random)) in enumerate(clouds.items()):
            above, side, front, empty = (axes[2 * k + i] for i in (0, 1, columns, columns + 1))
            above.set_title(whose)
            for ax, shown in ((above, (0, 1)), (side, (2, 1)), (front, (0, 2))):
                view(ax, random, shown, LIGHT, MIDDLE, "random sets")
                view(ax, best, shown, DARK, DARK, "optimal set")
                # the views stand against each other, however much room is left around them
                ax.set_aspect("equal", anchor="SW" if ax is side else "NE" if ax is front else "SE")
            above.set(xlim=(-x, x), ylim=(-y, y), ylabel="" if k else "y [mm]")
            front.set(ylim=(-z, z), xlabel="x [mm]", ylabel="" if k else "z [mm]")
            side.set(xlim=(-z, z), xlabel="z [mm]")
            side.tick_params(labelbottom=True)
            side.set_xticks([-tick, tick])
            front.set_yticks([-tick, 0, tick])
            empty.set_axis_off()
        legend_above(figure, axes[0])
        return svg_of(figure)


def view(ax: "Axes", cloud: Cloud, axes: tuple[int, int], color: str, edge: str, name: str) -> None:
    """The drawn points of a cloud along two axes, and the range of all draws around them [mm]."""
    dots(ax, MM * cloud.shown[:, axes], color, size=0.9)
    low, high = MM * cloud.ends[list(axes)].T
    look: Look = {"color": edge, "linewidth": 0.8, "linestyle": "--" if edge == MIDDLE else "-"}
    ax.plot(*outline(low, high), label=f"{name}, range of all draws", **look)


def outline(low: Array, high: Array) -> tuple[Array, Array]:
    """Corners of a rectangle (5,), the first one twice."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    x, y = np.where(corners, high, low).T
    return x, y
