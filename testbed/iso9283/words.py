"""What a test says, sentence by sentence: verdict, decisions on limits, reasons."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from testbed.iso9283.records import (
    PATH_CYCLES,
    POSE_CYCLES,
    STANDARD,
    CycleResult,
    CycleTest,
    StatedFigure,
)
from testbed.report.page import SIMULATED
from testbed.units import (
    MDEG,
    UM,
    counted,
    decimals,
    fixed,
    probability,
    sentences,
    significant,
)

MEASURED = "MEASURED - a test report, not a certificate of traceability"
EDITION = (
    f"Figures of {STANDARD}, from their textbook definitions; the text of the standard is not "
    "reproduced, and its further conditions (warm-up, load, speed, where the poses lie) are for "
    "whoever measured to keep."
)
NEAR = 1.5
"""Times its floor up to which a figure may be mostly noise."""
SURE = 0.01
"""A p-value, for all poses together, below which a drift is said."""
FINEST = 1e-3
"""Of a standard uncertainty that decides digits [um, mdeg]."""
MOST_CYCLES = 1000
"""Beyond which no number of cycles is proposed."""
OF_THE_FRAME = ("AP", "AT")
"""Figures that a fitted frame makes smaller."""


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

    FAIL where the lower limit of one is beyond it. Between, or without such a figure, nothing is
    decided: guard bands as wide as the confidence limits (ISO 14253-1, JCGM 106).
    """
    return tuple(_decision(result, name, limit) for name, limit in result.test.limits.items())


def _decision(result: CycleResult, name: str, limit: float) -> LimitDecision:
    """One limit."""
    figures, allowed = result.of(name), f"limit {name} {um(limit)}"
    if not figures:
        text = f"{allowed}: UNDECIDED: nothing that was measured gives {name}"
        return LimitDecision(name, limit, "UNDECIDED", "", text)
    failing = [figure for figure in figures if figure.least > limit]
    if failing:
        worst = max(failing, key=lambda figure: figure.least)
        text = f"{allowed}: FAIL: {told(worst)}"
        return LimitDecision(name, limit, "FAIL", worst.where, text)
    worst = max(figures, key=lambda figure: figure.most)
    if worst.most <= limit:
        text = f"{allowed}: PASS: the largest upper limit is {um(worst.most)} ({worst.where})"
        if result.test.fitted and name in OF_THE_FRAME:
            text += ", in the frame that was fitted to these very readings"
        if drifts(result):
            text += ", if the drift below is no more than what these cycles show"
        return LimitDecision(name, limit, "PASS", worst.where, text)
    text = f"{allowed}: UNDECIDED: {told(worst)}; {would_decide(worst, limit)}"
    return LimitDecision(name, limit, "UNDECIDED", worst.where, text)


def would_decide(figure: StatedFigure, limit: float) -> str:
    """How many cycles would bring the confidence limit to a limit, if the figure stays."""
    gap = abs(limit - figure.size)
    width = figure.most - figure.size if figure.size < limit else figure.size - figure.least
    t = float(stdtrit(figure.cycles - 1, 0.975))
    of_all = (t * figure.shared) ** 2
    rest = gap**2 - of_all
    cycles = figure.cycles * (width**2 - of_all) / rest if rest > 0 else np.inf
    if cycles <= MOST_CYCLES:
        return f"about {int(np.ceil(cycles - 1e-6))} cycles would decide it if it stays where it is"
    if of_all and rest <= 0:
        return (
            f"more cycles would not decide it: u of what all readings of the instrument share is "
            f"{um(figure.shared)}; an instrument that knows places better would"
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
    parts = []
    for name in ("AP", "RP", "AT", "RT"):
        figure = result.worst(name)
        if figure is not None:
            span = f"{show(figure.least, figure)} to {show(figure.most, figure)}"
            parts.append(f"{name} is up to {show(figure.size, figure)} um ({figure.where}: {span})")
    text = f"{'; '.join(parts)}; in brackets 95 % limits"
    return f"{text}. Measured: {extent(result.test)}."


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
        f"{figure.name} is up to {value} {unit(figure)} ({figure.where}; 95 % limits {low} to "
        f"{high} {unit(figure)})"
    )


def reasons(result: CycleResult) -> tuple[str, ...]:
    """Decisions first, then what limits the figures."""
    test = result.test
    texts = [one.sentence for one in decisions(result)]
    texts += _too_few(result)
    texts += _drifting(result)
    near = [f for f in result.figures if f.name in ("RP", "RD", "RT") and f.size < NEAR * f.floor]
    if near:
        worst = min(near, key=lambda figure: figure.size / figure.floor)
        texts.append(
            f"{worst.name} of {worst.where} is {um(worst.size)}, and the stated noise alone reads "
            f"{um(worst.floor)}: the robot itself repeats better than that"
            + (f" ({counted(len(near) - 1, 'more figure')} like it)" if len(near) > 1 else "")
        )
    if not test.uncertainty:
        texts.append(
            "The noise of a reading is not stated: nothing tells how much of the scatter is the "
            "instrument's ([uncertainty] position_um)"
        )
    if test.systematic is None:
        texts.append(
            "What the instrument gets wrong in all readings alike is in no limit: nobody states it "
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
            f"{said}: these are not the standard's figures; the RP of {um(RP.size)} may be "
            f"{um(RP.least)} to {um(RP.most)} with endlessly many"
        )
    texts += [
        f"Path {one.name} has {len(one.runs)} runs, and {STANDARD} asks for {PATH_CYCLES}"
        for one in test.paths
        if len(one.runs) < PATH_CYCLES
    ]
    return texts


def drifts(result: CycleResult) -> bool:
    """Whether chance alone hardly orders the cycles so."""
    return result.drift_p_value < SURE  # nan where nothing tells


def _drifting(result: CycleResult) -> list[str]:
    """Which poses drift, or why nobody asked."""
    visits = result.test.visits
    if visits is None:
        return []
    if not result.drifts:
        why = "there are no times" if visits.time is None else "there are fewer than 20 cycles"
        return [f"Drift was not asked about: {why}"]
    if not drifts(result):
        return []
    worst = max(result.drifts, key=lambda one: float((one.changes / one.chance).max()))
    k = int((worst.changes / worst.chance).argmax())
    return [
        f"The robot drifts (p {equal(result.drift_p_value)}): {('AP', 'RP')[k]} of {worst.where} "
        f"changes by {um(worst.changes[k])} over {significant(float(np.ptp(worst.hours)), 2)} h, "
        f"chance alone stays below {um(worst.chance[k])} in 95 %; the limits take cycles as "
        "independent, and are too narrow then"
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
    where = f"measured {said}" if said else "load and speed, which nobody stated"
    return f"Quote each figure with its limits, its cycles and the conditions: {where}."


def equal(p: float) -> str:
    """A p-value with its sign."""
    text = probability(p)
    return text if text.startswith("<") else f"= {text}"


def um(length: float) -> str:
    """A length [m] in um with its unit."""
    return f"{significant(length * UM)} um"


def show(value: float, figure: StatedFigure) -> str:
    """A value of a figure in um, or mdeg, to the second digit of its standard uncertainty."""
    scale = MDEG if figure.angle else UM
    if figure.u * scale < FINEST:
        return significant(value * scale)
    return fixed(value * scale, decimals(figure.u * scale, 2))


def unit(figure: StatedFigure) -> str:
    """Unit that it is shown in."""
    return "mdeg" if figure.angle else "um"
