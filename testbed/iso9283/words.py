"""What a test says, sentence by sentence: verdict, decisions on limits, reasons."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from calib.measurement.iso_drift import BLOCK
from testbed.iso9283.cycle_words import cycle_words
from testbed.iso9283.figure_words import equal, limit_um, place, show, um, unit
from testbed.iso9283.records import (
    PATH_CYCLES,
    POSE_CYCLES,
    PROBABILITY,
    SCATTERS,
    STANDARD,
    CycleResult,
    CycleTest,
    StatedFigure,
)
from testbed.report.page import SIMULATED
from testbed.units import counted, sentences, significant

MEASURED = "MEASURED - a test report, not a certificate of traceability"
EDITION = (
    f"Figures of {STANDARD}, from their textbook definitions; the text of the standard is not "
    "reproduced. Its further conditions (warm-up, load, speed, choice of poses) are the "
    "responsibility of whoever measured."
)
NEAR = 1.5
"""Times its floor up to which a figure may be mostly noise."""
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


def notice(result: CycleResult) -> str:
    """Whether the numbers come from a real robot; neither kind is a certificate."""
    return SIMULATED if result.test.simulated else MEASURED


def decisions(result: CycleResult) -> tuple[LimitDecision, ...]:
    """Every stated limit against its figures: PASS where all upper limits keep it.

    FAIL where the lower limit of one is beyond it, and the instrument's noise does not explain
    that. Between, or without such a figure, nothing is decided: guard bands as wide as the
    confidence limits (ISO 14253-1, JCGM 106).
    """
    return tuple(_decision(result, name, limit) for name, limit in result.test.limits.items())


def _decision(result: CycleResult, name: str, limit: float) -> LimitDecision:
    """One limit."""
    figures, allowed = result.of(name), f"{name} limit {limit_um(limit)} um"
    if not figures:
        text = f"{allowed}: UNDECIDED, nothing that was measured gives {name}"
        return LimitDecision(name, limit, "UNDECIDED", "", text)
    failing = [figure for figure in figures if figure.own_least > limit]
    if failing:
        worst = max(failing, key=lambda figure: figure.least)
        text = f"{allowed}: FAIL, {told(worst)}"
        return LimitDecision(name, limit, "FAIL", worst.where, text)
    worst = max(figures, key=lambda figure: figure.most)
    if worst.most <= limit:
        most = f"{show(worst.most, worst)} {unit(worst)}"
        text = f"{allowed}: PASS, the largest upper limit is {most} ({place(worst)})"
        if result.test.fitted and name in OF_THE_FRAME:
            text += ", in the frame that was fitted to these same readings"
        if drifts(result):
            text += ", if the drift stays within what these cycles show"
        return LimitDecision(name, limit, "PASS", worst.where, text)
    text = f"{allowed}: UNDECIDED, {told(worst)}; {would_decide(worst, limit)}"
    return LimitDecision(name, limit, "UNDECIDED", worst.where, text)


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
        return (
            f"the stated noise of the instrument alone gives {show(figure.floor, figure)} "
            f"{unit(figure)}, and without it the robot may keep the limit: a quieter instrument "
            "would decide it"
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
        return f"about {count} cycles would decide it if it stays where it is"
    if of_all and rest <= 0:
        return (
            "more cycles would not decide it: the stated systematic errors alone give u = "
            f"{um(figure.shared)}; a more accurate instrument would"
        )
    return "it lies so near the limit that no sensible number of cycles would decide it"


def overall(result: CycleResult) -> str:
    """One word over all limits; empty where none is stated."""
    words = {one.word for one in decisions(result)}
    return next((word for word in ("FAIL", "UNDECIDED", "PASS") if word in words), "")


def enough(result: CycleResult) -> bool:
    """Whether every figure has the cycles that the standard asks for."""
    return not _too_few(result)


def mark(result: CycleResult) -> str:
    """The verdict in a few words."""
    word, sign = overall(result), {"PASS": "✓", "FAIL": "✗", "UNDECIDED": "?"}
    if word:
        few = "" if enough(result) else f", with fewer cycles than {STANDARD} asks for"
        return f"{sign[word]} {word} at the stated limits{few}{' (it drifts)' * drifts(result)}"
    if not enough(result):
        return f"? Fewer cycles than {STANDARD} asks for"
    return f"✓ Measured with as many cycles as {STANDARD} asks for"


def verdict(result: CycleResult) -> str:
    """The largest figures with their limits."""
    parts = list[str]()
    for name in ("AP", "RP", "AT", "RT"):
        figure = result.worst(name)
        if figure is not None:
            span = f"{show(figure.least, figure)} to {show(figure.most, figure)}"
            limits = f"95 % limits {span}" if not parts else span
            at = f"({place(figure)}; {limits})"
            parts.append(f"{name} is up to {show(figure.size, figure)} um {at}")
    said = [f"{'; '.join(parts)}", *_drift_told(result), f"Measured: {extent(result.test)}"]
    return f"{'. '.join(said)}."


def extent(test: CycleTest) -> str:
    """How much was measured."""
    counts = []
    if test.visits is not None:
        poses = counted(len(set(test.visits.pose)), "pose")
        counts.append(f"{counted(test.visits.cycles, 'cycle')} of {poses}")
    counts += [f"{counted(len(one.runs), 'run')} of path {one.name}" for one in test.paths]
    return ", ".join(counts)


def told(figure: StatedFigure) -> str:
    """One figure with its limits in words."""
    low, high = (show(x, figure) for x in (figure.least, figure.most))
    value = show(figure.size, figure)
    return (
        f"{figure.name} is up to {value} {unit(figure)} ({place(figure)}; 95 % limits {low} to "
        f"{high} {unit(figure)})"
    )


def reasons(result: CycleResult) -> tuple[str, ...]:
    """Decisions first, then what limits the figures."""
    test = result.test
    texts = [one.sentence for one in decisions(result)]
    texts += _too_few(result)
    texts += _drifting(result)
    texts += cycle_words(result)
    near = [f for f in result.figures if f.name in SCATTERS and f.size < NEAR * f.floor]
    if near:
        worst = min(near, key=lambda figure: figure.size / figure.floor)
        texts.append(
            f"{worst.name} of {place(worst)} is {show(worst.size, worst)} um, and the stated noise "
            f"alone gives {show(worst.floor, worst)} um: the robot itself repeats better than that"
            + (f" ({counted(len(near) - 1, 'more figure')} like it)" if len(near) > 1 else "")
        )
    if not test.uncertainty:
        texts.append(
            "The noise of a reading is not stated ([uncertainty] position_um): the instrument's "
            "share of the scatter is unknown"
        )
    if test.systematic is None:
        texts.append(
            "Systematic errors of the instrument are not in these limits: none are stated "
            "([uncertainty.systematic])"
        )
    texts.append(result.frame)
    texts += test.warnings
    return sentences(texts)


def _too_few(result: CycleResult) -> list[str]:
    """Which figures have fewer cycles than the standard asks for."""
    texts, test = [], result.test
    if test.visits is not None and test.visits.cycles < POSE_CYCLES:
        n, RP = test.visits.cycles, result.worst("RP")
        said = f"The poses have {n} cycles, and {STANDARD} asks for {POSE_CYCLES}"
        assert RP is not None  # every pose has one
        texts.append(
            f"{said}: these are not the standard's figures; with infinitely many cycles the RP of "
            f"{show(RP.size, RP)} um may be {show(RP.least, RP)} to {show(RP.most, RP)} um"
        )
    texts += [
        f"Path {one.name} has {len(one.runs)} runs, and {STANDARD} asks for {PATH_CYCLES}"
        for one in test.paths
        if len(one.runs) < PATH_CYCLES
    ]
    return texts


def drift_words(result: CycleResult) -> str:
    """Whether the robot drifts, or why that was not tested; empty without poses."""
    return next(iter([*_drift_told(result), *_drifting(result)]), "")


def _drift_told(result: CycleResult) -> list[str]:
    """Drift in one sentence, where it was tested."""
    if not result.drifts:
        return []
    dAP, p = result.worst("dAP"), equal(result.drift_p_value)
    assert dAP is not None  # every drift has one
    hours = max(float(np.ptp(one.hours)) for one in result.drifts)
    size = f"{show(dAP.size, dAP)} um ({place(dAP)}) over {significant(hours, 2)} h"
    if drifts(result):
        return [f"The robot drifts (p {p} for all poses together): AP by up to {size}"]
    return [
        f"Drift is not significant (p {p} for all poses together, tested at {SURE:g}): AP changes "
        f"by up to {size}"
    ]


def drifts(result: CycleResult) -> bool:
    """Whether chance alone would hardly order the cycles so."""
    return result.drift_p_value < SURE  # nan where nothing tells


def _drifting(result: CycleResult) -> list[str]:
    """Which poses drift, or why nobody asked."""
    visits = result.test.visits
    if visits is None:
        return []
    if not result.drifts:
        why = (
            "there are no times"
            if visits.time is None
            else f"there are fewer than {2 * BLOCK} cycles"
        )
        return [f"Drift was not tested: {why}"]
    if not drifts(result):
        return []
    worst = max(result.drifts, key=lambda one: float((one.changes / one.chance).max()))
    k = int((worst.changes / worst.chance).argmax())
    own = next(f for f in result.of(("dAP", "dRP")[k]) if f.where == worst.where)
    change, usual = show(worst.changes[k], own), show(worst.chance[k], own)
    name = ("AP", "RP")[k]
    return [
        f"{name} of {place(own)} changes by {change} um; in 95 % of random orders of the "
        f"same cycles it changes by less than {usual} um. The limits are of the hours measured"
    ]


def next_step(result: CycleResult) -> str:
    """What a person should do now."""
    test, word = result.test, overall(result)
    if word == "UNDECIDED":
        return "See above what would decide each limit."
    if not enough(result):
        return f"Measure {POSE_CYCLES} cycles of poses and {PATH_CYCLES} runs of paths."
    stated = [test.conditions, f"speed {test.speed_percent:g} %" if test.speed_percent else ""]
    said = ", ".join(filter(None, stated))
    where = f"measured {said}" if said else "load and speed, which are not stated"
    return f"Quote each figure with its limits, its number of cycles and the conditions: {where}."
