"""What a test says, sentence by sentence: verdict, reasons, next step."""

import numpy as np

from calib.measurement.iso_drift import BLOCK
from testbed.iso9283.cycle_words import corner_words, cycle_words
from testbed.iso9283.decided import SURE, decisions, drifts, overall
from testbed.iso9283.figure_words import place, show, unit
from testbed.iso9283.records import (
    PATH_CYCLES,
    POSE_CYCLES,
    SCATTERS,
    STANDARD,
    CycleResult,
    CycleTest,
)
from testbed.report.page import SIMULATED
from testbed.units import counted, p_equals, sentences, significant

MEASURED = "MEASURED - a test report, not a certificate; no traceability is claimed"
EDITION = (
    f"The figures are those of {STANDARD}, from their textbook definitions; the text of the "
    "standard is not reproduced. Meeting its other conditions (warm-up, load, speed, choice of "
    "poses) is the responsibility of whoever measured."
)
NEAR = 1.5
"""Times its floor up to which a figure may be mostly noise."""


def notice(result: CycleResult) -> str:
    """Whether the numbers come from a real robot; neither kind is a certificate."""
    return SIMULATED if result.test.simulated else MEASURED


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
        return f"? Measured with fewer cycles than {STANDARD} asks for"
    return f"✓ Measured with as many cycles as {STANDARD} asks for"


def verdict(result: CycleResult) -> str:
    """The largest figures with their limits, those that decide among them."""
    parts, names = list[str](), ["AP", "RP", "AT", "RT"]
    word = overall(result)
    if word != "PASS":
        names += [one.name for one in decisions(result) if one.word == word]
    for name in dict.fromkeys(names):
        figure = result.worst(name)
        if figure is not None:
            span = f"{show(figure.least, figure)} to {show(figure.most, figure)}"
            limits = f"95 % limits {span}" if not parts else span
            at = f"({place(figure)}; {limits})"
            parts.append(f"{name} is up to {show(figure.size, figure)} {unit(figure)} {at}")
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


def reasons(result: CycleResult) -> tuple[str, ...]:
    """Decisions first, then what limits the figures."""
    test = result.test
    texts = [one.sentence for one in decisions(result)]
    texts += _too_few(result)
    texts += _drifting(result)
    texts += cycle_words(result)
    texts += corner_words(test.paths)
    near = [f for f in result.figures if f.name in SCATTERS and f.size < NEAR * f.floor]
    if near:
        worst = min(near, key=lambda figure: figure.size / figure.floor)
        too_large = all(figure.most < figure.noise for figure in result.of(worst.name))
        follows = (
            "the stated noise is too large, as robot and instrument together scatter less"
            if too_large
            else "the robot itself repeats better than that"
        )
        texts.append(
            f"{worst.name} of {place(worst)} is {show(worst.size, worst)} {unit(worst)}, and the "
            f"stated noise alone gives {show(worst.floor, worst)} {unit(worst)}: {follows}"
            + (f" ({counted(len(near) - 1, 'more figure')} like it)" if len(near) > 1 else "")
        )
    if not test.uncertainty:
        texts.append(
            "The noise of a reading is not stated ([uncertainty] position_um), so the "
            "instrument's share of the scatter is unknown"
        )
    if test.systematic is None:
        texts.append(
            "The confidence limits do not include systematic errors of the instrument, because "
            "none are stated ([uncertainty.systematic])"
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
            f"{said}: these are not the standard's figures; with infinitely many cycles, the RP of "
            f"{show(RP.size, RP)} {unit(RP)} may become {show(RP.least, RP)} to "
            f"{show(RP.most, RP)} {unit(RP)}"
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
    dAP, p = result.worst("dAP"), p_equals(result.drift_p_value)
    assert dAP is not None  # every drift has one
    hours = max(float(np.ptp(one.hours)) for one in result.drifts)
    size = f"{show(dAP.size, dAP)} {unit(dAP)} ({place(dAP)}) over {significant(hours, 2)} h"
    if drifts(result):
        return [f"The robot drifts (p {p} for all poses together): AP changes by up to {size}"]
    return [
        f"Drift is not significant (p {p} for all poses together, tested at {SURE:g}): AP changes "
        f"by up to {size}"
    ]


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
    change, usual = (
        f"{show(size, own)} {unit(own)}" for size in (worst.changes[k], worst.chance[k])
    )
    name = ("AP", "RP")[k]
    changed = any(figure.lower > 0 for figure in result.of("dAP", "dRP"))
    follow = result.memory is not None and result.memory.kept > 0
    unsure = (
        "Cycles that follow each other on a slow way back and forth may change AP and RP as much: "
        "the limits of dAP and dRP, which allow for that, include zero at every pose"
    )
    return [
        f"{name} of {place(own)} changes by {change}; in 95 % of random orders of the "
        f"same cycles it changes by less than {usual}. The confidence limits hold for the "
        "hours measured",
        *([unsure] if follow and not changed else []),
    ]


def next_step(result: CycleResult) -> str:
    """What a person should do now."""
    test, word = result.test, overall(result)
    if word == "UNDECIDED":
        return "The lines above say what would decide each limit."
    if not enough(result):
        return f"Measure {POSE_CYCLES} cycles of poses and {PATH_CYCLES} runs of paths."
    stated = [test.conditions, f"speed {test.speed_percent:g} %" if test.speed_percent else ""]
    said = ", ".join(filter(None, stated))
    where = f"measured {said}" if said else "load and speed, which are not stated"
    unsaid = ""
    if test.systematic is None:
        # whoever quotes a PASS must not claim them
        unsaid = " Say that these limits are without systematic errors of the instrument."
    return (
        "Quote each figure with its confidence limits, its number of cycles and the conditions: "
        f"{where}.{unsaid}"
    )
