"""The figure of calibrated random sets: error against index, the designed set among them."""

from collections.abc import Sequence

import numpy as np

from testbed.report.plots import Look, label, legend_above, short_ticks
from testbed.report.svg import DARK, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.wen2022.calibrated_sets.records import AgainstRandom
from testbed.studies.wen2022.calibrated_sets.summary import index_of_choice, rank_of
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.units import MM

MOST_SETS = 4
"""Most designed sets in one figure; the table has all."""
DRAWN: Look = {"marker": "^", "color": MIDDLE, "markersize": 2.8, "markerfacecolor": "none"}
CHOSEN: Look = {"marker": "o", "color": DARK, "markersize": 5.2}


def error_against_index(sets: Sequence[AgainstRandom]) -> str:
    """Held-out error (top) and error on the own poses over the index, paper's estimator."""
    sets, k = sets[:MOST_SETS], ESTIMATORS.index("paper")
    with drawing(2, len(sets), height=4.0) as (figure, axes):
        for column, one in enumerate(sets):
            rank = rank_of(one, "paper")
            i, index = index_of_choice(one)
            rows = ("error", f"better than {rank.better_than} of {rank.sets}"), (
                "own_after", f"lower than {rank.own_lower_than} of {rank.sets}",
            )  # fmt: skip
            for row, (name, said) in enumerate(rows):
                ax = axes[row * len(sets) + column]
                drawn, chosen = (getattr(part, name)[k] * MM for part in (one.random, one.designed))
                ax.axhline(chosen[0], color=SOFT, linewidth=0.7)
                ax.plot(one.random.index[i], drawn, linestyle="none", label="random", **DRAWN)
                ax.plot(one.designed.index[i], chosen, linestyle="none", label="designed", **CHOSEN)
                x, y = float(one.designed.index[i, 0]), float(chosen[0])
                upper = y > float(np.median(drawn))
                look: Look = {"ha": "right", "va": "top" if upper else "bottom"}
                label(ax, said, (x, y), (-6, -4 if upper else 4), size=7, **look)
                if row == 0:
                    ax.set_title(f"{one.trial}: {one.poses} poses")
                else:
                    ax.set_xlabel(f"{index}, rows in mm and rad")
                if column == 0:
                    ax.set_ylabel(("held-out" if row == 0 else "own poses") + " [mm]")
                short_ticks(ax, axis="x")
        legend_above(figure, axes[0])
        return svg_of(figure)
