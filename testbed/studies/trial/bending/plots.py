"""The figures of what bends an arm, one function each: numbers in, one SVG element out."""

import numpy as np

from calib.arrays import Array
from testbed.report.plots import SHADES, TICKS, dots, legend_above, legend_entries
from testbed.report.svg import SOFT, drawing, svg_of
from testbed.studies.trial.bending.sag import Sag
from testbed.units import MM, UM


def sag_maps(sag: Sag) -> str:
    """Sag and what the model leaves, in one scale of shades, over the plane of the arm."""
    steps = shade_steps(max(float(sag.size.max()), float(sag.left.max())) * UM)
    panels = (("how far gravity moves the tool", sag.size), ("what the model leaves", sag.left))
    with drawing(1, 2, height=3.3, sharex=True, sharey=True) as (figure, axes):
        for ax, (title, size) in zip(axes, panels, strict=True):
            shade = np.searchsorted(steps, size * UM)
            for k, color in enumerate(SHADES):
                if (shade == k).any():
                    dots(ax, MM * sag.place[shade == k], color, 3.4)
            ax.plot(0, 0, "s", color=SOFT, markersize=4)
            ax.set(title=title, xlabel="from the upright through the base [mm]")
            ax.set_aspect("equal")
        axes[0].set_ylabel("height above the base [mm]")
        low, high = [*steps, np.inf], [0.0, *steps]
        names = [
            f"> {a:g} µm" if np.isinf(b) else f"{a:g} to {b:g}"
            for a, b in zip(high, low, strict=True)
        ]
        looks = {
            name: {"marker": "o", "color": color} for name, color in zip(names, SHADES, strict=True)
        }
        legend_entries(axes[0], looks)
        legend_above(figure, axes[0])
        return svg_of(figure)


def shade_steps(largest: float) -> Array:
    """The steps between six shades: the last five of 1, 2, 5, 10 ... below the largest value."""
    below = [tick for tick in TICKS if tick < largest]
    return np.array(below[1 - len(SHADES) :])
