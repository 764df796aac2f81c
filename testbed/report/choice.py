"""Which joint errors were offered to a model, and how the choice went: tables of a report."""

from collections.abc import Sequence

import numpy as np

from calib.identification.climbing import ClimbStep, Offer
from testbed.report.page import Table
from testbed.units import MM, decimals, fixed

SAG = (
    " sag: waves, if gravity has that form. by torques: each joint gives way in proportion to the "
    "pull of the stated or guessed masses of the links. bearings: also across its axis. springs: "
    "the moments of the links are estimated as well. on a tilted base: gravity may be a degree or "
    "two off its stated direction; compared with the same level upright."
)


def choice_tables(offered: Sequence[Offer], steps: Sequence[ClimbStep]) -> list[Table]:
    """What was offered and what became of it, and the steps; none where nothing was asked."""
    tables = []
    if offered:
        rows = [(o.ladder, o.level, _odds(o.gain), o.outcome) for o in offered]
        tables.append(
            Table(
                caption="Joint errors that were offered to the model, and the outcome",
                head=("cause", "level", "log evidence", "outcome"),
                rows=tuple(rows),
                align="llrl",
                on_paper=0,
                note="log evidence: natural logarithm of the odds that the training poses give "
                "this level alone against geometry alone; 3.0, odds of 20 to 1, are required."
                + SAG
                * any(o.ladder == "gravity" and not np.isnan(o.gain) for o in offered),
            )
        )
    if steps:
        taken = [
            (
                step.level,
                _odds(step.gain),
                _miss(step.before),
                _miss(step.after),
                "taken" if step.taken else "refused",
            )
            for step in steps
        ]
        tables.append(
            Table(
                caption="How the choice went",
                head=("level", "log evidence gained", "before [mm]", "after [mm]", "outcome"),
                rows=tuple(taken),
                align="lrrrl",
                note="before, after: mean error at training poses left out in turn; a level is "
                "refused if it increases this error by more than a standard error.",
            )
        )
    return tables


def _odds(gain: float) -> str:
    """A log evidence, or a dash where nothing was asked."""
    return "–" if np.isnan(gain) else f"{gain:+.1f}".replace("-", "−")


def _miss(size: float) -> str:
    """A miss in millimeters, or a dash where no pose was left out."""
    return "–" if np.isnan(size) else fixed(size * MM, max(3, decimals(size * MM, 2)))
