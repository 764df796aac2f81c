"""Stated limits against the figures of a test: PASS, FAIL, UNDECIDED, and what would decide."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from calib.measurement.iso_drift import BLOCK
from testbed.iso9283.figure_words import place, show, show_limit, told, unit
from testbed.iso9283.records import PROBABILITY, CycleResult, StatedFigure
from testbed.lengths import as_stated, with_unit

SURE = 0.01
"""A p-value, for all poses together, below which a drift is said."""
MOST_CYCLES = 1000
"""Beyond which no number of cycles is proposed."""
OF_THE_FRAME = ("AP", "AT")
"""Figures that a fitted frame makes smaller."""
OF_BLOCKS = ("dAP", "dRP")
"""Figures of blocks of cycles, which are no longer where there are more of them."""


@dataclass(frozen=True, slots=True)
class LimitDecision:
    """One figure against its limit."""

    name: str
    limit: float
    """[m]"""
    word: str
    """PASS, FAIL or UNDECIDED."""
    where: str
    """The figure that decides, or is the last to be decided."""
    sentence: str


def decisions(result: CycleResult) -> tuple[LimitDecision, ...]:
    """Every stated limit against its figures: PASS where all upper limits keep it.

    FAIL where the lower limit of one is beyond it, and the instrument's noise does not explain
    that. Between, or without such a figure, nothing is decided: guard bands as wide as the
    confidence limits (ISO 14253-1, JCGM 106).
    """
    return tuple(_decision(result, name, limit) for name, limit in result.test.limits.items())


def _decision(result: CycleResult, name: str, limit: float) -> LimitDecision:
    """One limit."""
    figures = result.of(name)
    if not figures:
        text = f"{name} limit {as_stated(limit)}: UNDECIDED, nothing that was measured gives {name}"
        return LimitDecision(name, limit, "UNDECIDED", "", text)
    failing = [figure for figure in figures if figure.own_least > limit]
    if failing:
        worst = max(failing, key=lambda figure: figure.least)
        text = f"{_allowed(worst, limit)}: FAIL, {told(worst, unit(worst, limit))}"
        return LimitDecision(name, limit, "FAIL", worst.where, text)
    worst = max(figures, key=lambda figure: figure.most)
    if worst.most <= limit:
        named = unit(worst, limit)
        most = f"{show(worst.most, worst, named)} {named}"
        text = f"{_allowed(worst, limit)}: PASS, the largest upper limit is {most} ({place(worst)})"
        if result.test.fitted and name in OF_THE_FRAME:
            text += ", in the frame that was fitted to the same readings"
        if drifts(result):
            text += ", if the drift stays within what these cycles show"
        return LimitDecision(name, limit, "PASS", worst.where, text)
    ways, named = would_decide(worst, limit), unit(worst, limit)
    text = f"{_allowed(worst, limit)}: UNDECIDED, {told(worst, named)}; {ways}"
    return LimitDecision(name, limit, "UNDECIDED", worst.where, text)


def _allowed(figure: StatedFigure, limit: float) -> str:
    """A limit in the unit of the figure that it is read beside."""
    named = unit(figure, limit)
    return f"{figure.name} limit {show_limit(limit, named)} {named}"


def would_decide(figure: StatedFigure, limit: float) -> str:
    """How many cycles would bring the confidence limit to a limit, if the figure stays.

    References
    ----------
    Half width w of n cycles, of which all readings share c = t u_shared: w^2 - c^2 falls as 1/n, so
    that a gap d is reached with n (w^2 - c^2) / (d^2 - c^2) cycles; t stays that of n.
    """
    below, size = figure.size < limit, figure.own
    if figure.name in OF_BLOCKS:
        return (
            f"more cycles would not decide it, as every block has {BLOCK} of them: a robot or an "
            "instrument that scatters less would"
        )
    if not below and size <= limit:
        named = unit(figure, limit)
        return (
            f"the stated noise of the instrument alone gives {show(figure.floor, figure, named)} "
            f"{named}, and without it the robot may keep the limit: an instrument with less "
            "noise would decide it"
        )
    gap = abs(limit - (figure.size if below else size))
    width = figure.most - figure.size if below else size - figure.own_least
    t = float(stdtrit(figure.cycles - 1, (1 + PROBABILITY) / 2))
    of_all = (t * figure.shared) ** 2
    rest = gap**2 - of_all
    cycles = figure.cycles * (width**2 - of_all) / rest if rest > 0 else np.inf
    if cycles <= MOST_CYCLES:
        # less what rounding adds to a whole number
        count = int(np.ceil(cycles - 1e-6))
        return f"about {count} cycles would decide it, if the figure stays as it is"
    if of_all and rest <= 0:
        return (
            "more cycles would not decide it: the stated systematic errors alone give u = "
            f"{with_unit(figure.shared)}; a more accurate instrument would"
        )
    return "it is so near the limit that no reasonable number of cycles would decide it"


def overall(result: CycleResult) -> str:
    """One word over all limits; empty where none is stated."""
    words = {one.word for one in decisions(result)}
    return next((word for word in ("FAIL", "UNDECIDED", "PASS") if word in words), "")


def drifts(result: CycleResult) -> bool:
    """Whether chance alone would hardly order the cycles so."""
    return result.drift_p_value < SURE  # nan where nothing tells
