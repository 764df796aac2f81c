"""The figure of joint maps: what each joint turns beside its command, over one turn."""

import numpy as np

from calib.arrays import Array, Index
from testbed.report.plots import Look, legend_above
from testbed.report.svg import DARK, HALF_WIDTH, MIDDLE, drawing, svg_of
from testbed.units import MDEG

BAND = "#d9c7bb"
COLUMNS = 3


def joint_maps(
    joints: Index, angle: Array, turn: Array, u: Array, truth: Array | None = None
) -> str:
    """One panel for each joint: its map in a band of 2 u, and the true map where it is known.

    Parameters
    ----------
    joints : (k,) array of int
        From 0.
    angle : (a,) array
        Commanded [rad].
    turn, u : (a, k) array
        What a model turns beside the command, and its standard uncertainty [rad].
    truth : (a, k) array, optional
        What the true joints turn [rad].
    """
    lines = -(-len(joints) // COLUMNS)
    degrees = np.degrees(angle)
    height = 0.2 + 1.3 * lines + 0.3 * (truth is not None)
    share = {"sharex": True, "sharey": True}
    with drawing(lines, COLUMNS, height=height, width=HALF_WIDTH, **share) as (figure, axes):
        for ax in axes[len(joints) :]:
            ax.set_visible(False)
        for k, joint in enumerate(joints):
            ax, own, half = axes[k], MDEG * turn[:, k], 2 * MDEG * u[:, k]
            ax.fill_between(degrees, own - half, own + half, color=BAND, linewidth=0)
            ax.plot(degrees, own, color=DARK, linewidth=0.9, label="model, ± 2 u")
            if truth is not None:
                look: Look = {"color": MIDDLE, "linewidth": 0.9, "linestyle": (0, (3, 1.2))}
                ax.plot(degrees, MDEG * truth[:, k], label="truth", **look)
            ax.set_title(f"joint {joint + 1}")
            ax.set_xticks([-180, 0, 180])
            if k % COLUMNS == 0:
                ax.set_ylabel("off by [mdeg]")
            if k + COLUMNS >= len(joints):
                ax.set_xlabel("command [deg]")
                ax.tick_params(labelbottom=True)  # also above a panel that is not there
        if truth is not None:
            legend_above(figure, axes[0])
        return svg_of(figure)
