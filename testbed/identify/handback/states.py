"""Each number of the robot that is handed out: how far it moved, and what holds it there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.uncertainty.statement.stated_point import IN_DATUM
from testbed.identify.calibration import Calibration
from testbed.identify.handback.least_moved import RULE, LeastMoved, least_moved
from testbed.identify.handback.links import farthest
from testbed.identify.records import FittedModel
from testbed.lengths import with_unit
from testbed.robots.write.dh_table import DhRow, dh_rows
from testbed.units import DEG, MM, counted, listed, sentences, significant

NOMINAL, MEASURED, PRIOR = "nominal", "measurements", "prior"
TOGETHER = "measurements, with all that springs do"
"""Of a compliance, a moment or a tilt: it stands for what the model lacks as well, and alone it has
no U that holds; the region of the tool point counts what all of them leave there."""
SHARED = "measurements, only together with others"
"""Of a number that others can stand for, and that no prior holds: it takes its share of what is
known of all of them, so that its own true value may lie as far off as their tolerances."""
BEYOND, LOOSE = "measurements, beyond its tolerance", "nothing: U exceeds its tolerance"
HALF = 0.5
"""Share of the variance of a number from which on a prior holds it, its own or that of others."""
STANDS = 0.1
"""Part of its standard uncertainty that a number may be off by what stands for it unnoticed."""
PARALLEL = 0.999
"""Sine of alpha from which theta and beta of a joint are said to turn about parallel axes: 2.6 deg.
"""
EVEN = 1.2
"""So many times as large as either must what two turns have in common be, to name their sum."""
MOST_NAMED = 6
"""Numbers that a sentence names."""


@dataclass(frozen=True, slots=True)
class HandedNumber:
    """One number of the robot that is handed out."""

    row: DhRow
    tolerance: float | None
    """Standard deviation about nominal that was believed, in mm or deg; None for other than links
    and for what the session held."""
    held_by: str
    """What keeps it where it is."""

    @property
    def is_far(self) -> bool:
        """Whether it moved further than its tolerance."""
        return self.tolerance is not None and abs(self.row.delta) > self.tolerance


def handed_robot(calibration: Calibration, fit: FittedModel | None = None) -> LeastMoved:
    """The robot of a fit, by default the chosen one, in the numbers that are handed out."""
    chosen = fit is None or fit is calibration.fit
    asked, given = calibration.fit if fit is None else fit, calibration.handback
    return least_moved(
        calibration.nominal.chain, asked.identification, given.tolerance, given.limits,
        covariance=calibration.covariance if chosen else None,
    )  # fmt: skip


def in_own_frames(calibration: Calibration, fit: FittedModel | None = None) -> RobotModel:
    """The robot handed out in the base and with the tool of the robot's file: what programs know.

    Found from nothing, both say only where the tracker stood and where its target was mounted. Of
    all robots of the same poses it has to be the one handed out: where links can stand for a part
    of base and tool, each of them has a base of its own.
    """
    model, own = handed_robot(calibration, fit).model, calibration.nominal.chain
    if calibration.own_frames:
        return RobotModel(model.chain, model.joint_errors)
    chain = replace(model.chain, T_world_base=own.T_world_base, T_flange_tool=own.T_flange_tool)
    return RobotModel(chain, model.joint_errors)


def handed_numbers(calibration: Calibration) -> tuple[HandedNumber, ...]:
    """Base, links, tool and joint terms, nominal with fitted frames against what is handed out."""
    result, handed = calibration.fit.identification, handed_robot(calibration)
    free = result.parameters.freeing(result.parameters.names)
    rows = dh_rows(calibration.before, handed.model, free, handed.covariance)
    believed = set() if result.prior is None else set(result.prior.names)
    names = result.parameters.names[6 : 6 + calibration.handback.tolerance.size]
    scale = np.where([row.unit == "mm" for row in rows[6 : 6 + len(names)]], MM, DEG)
    sizes = dict(
        zip(names, calibration.handback.tolerance.ravel() * scale, strict=True)
    )  # in the units of the rows
    shares = dict(zip((row.name for row in rows), calibration.handback.by_prior, strict=False))
    springs = handed.model.joint_errors.springs
    together = dict.fromkeys(() if springs is None else springs.names, TOGETHER)
    # what no reading tells has no U, and of links what base and tool take up, wherever they stand
    untold = {row.name for row in rows} - {*sizes, *result.names}
    untold |= (set(sizes) & set(result.reduction.dropped)) - believed
    together |= dict.fromkeys(untold, NOMINAL)
    together |= dict.fromkeys(_shared(calibration, believed), SHARED)
    return tuple(
        HandedNumber(replace(row, expanded=None), sizes.get(row.name), together[row.name])
        if row.name in together and row.expanded is not None
        else _held(row, sizes.get(row.name), row.name in believed, shares.get(row.name, 0.0))
        for row in rows
    )


def _shared(calibration: Calibration, believed: set[str]) -> set[str]:
    """Link numbers without a prior that stand for each other further than their own u reaches."""
    result, tolerance = calibration.fit.identification, calibration.handback.tolerance.ravel()
    reduction = result.reduction
    told = {*reduction.kept, *reduction.dropped}
    free = [name for name in result.parameters.names if name in told]
    sd = dict(zip(result.parameters.names[6:], tolerance, strict=False))
    u = dict(zip(result.names, np.sqrt(np.diag(result.covariance)), strict=True))
    found = set()
    for other in set(reduction.dropped) & set(sd) - believed:
        moved = dict(zip(reduction.kept, reduction.mixing[:, free.index(other)], strict=True))
        for name in set(moved) & set(sd) - believed:
            if abs(moved[name]) * sd[other] > STANDS * u[name]:
                found |= {name, other}
    return found


def _held(row: DhRow, tolerance: float | None, believed: bool, share: float) -> HandedNumber:
    """What holds one number, whose variance comes by a share from a prior."""
    if row.expanded is None:
        return HandedNumber(row, tolerance, NOMINAL)
    if tolerance is None:
        return HandedNumber(row, None, PRIOR if share > HALF else MEASURED)
    if believed and (share > HALF or row.expanded > tolerance):
        return HandedNumber(row, tolerance, PRIOR)
    if row.expanded > tolerance:
        return HandedNumber(row, tolerance, LOOSE)
    return HandedNumber(row, tolerance, BEYOND if abs(row.delta) > tolerance else MEASURED)


def hand_back_words(calibration: Calibration) -> tuple[str, ...]:
    """The rule, and what a person must know of the numbers before using them, in sentences."""
    said = [RULE, *_why_and_beyond(calibration)]
    numbers = handed_numbers(calibration)
    for how, text in (
        (PRIOR, "the prior holds {}: the measurements say less about them than the nominal values"),
        (LOOSE, "nothing determines {} to within their tolerance: measure more poses, or state a "
                "[prior]"),
    ):  # fmt: skip
        named = [one.row.name for one in numbers if one.held_by == how and one.tolerance]
        if named:
            said.append(text.format(_some(named[:MOST_NAMED], len(named))))
    return sentences(said)


def hand_back_warnings(calibration: Calibration) -> tuple[str, ...]:
    """What must be said first: why links have a prior, what moved beyond its tolerance."""
    said = _why_and_beyond(calibration)
    named = [one.row.name for one in handed_numbers(calibration) if one.held_by == LOOSE]
    if named:
        said.append(f"{_some(named[:MOST_NAMED], len(named))}: U exceeds the tolerance")
    return tuple(said)


def _why_and_beyond(calibration: Calibration) -> list[str]:
    """Why links have a prior, and which numbers moved further than their tolerance."""
    given, result, said = calibration.handback, calibration.fit.identification, []
    if not calibration.converged and (away := farthest(result, given.tolerance)):
        said.append(f"the fit did not converge: {away}")
    if given.why:
        said.append(
            f"the links have a prior of {_widths(given.tolerance)} ({given.stated_by}): {given.why}"
        )
    elif given.widened:
        said.append(f"the links lie {_widths(given.tolerance)} from nominal ({given.stated_by})")
    far = [one for one in handed_numbers(calibration) if one.is_far]
    # what no number of the model stands for is spread over those that come near it
    refuted = "ask for it, though some of what the model misses may be in it"
    for alone, why in (
        (True, refuted if calibration.refuted else "confirm it"),
        (False, "determine {} only together with others"),
    ):
        some = [one for one in far if (one.held_by == BEYOND) == alone]
        why = why.format("them" if len(some) > 1 else "it")
        told = [
            f"{one.row.name} by {significant(abs(one.row.delta), 2)} {one.row.unit}"
            for one in some[:MOST_NAMED]
        ]
        if told:
            said.append(
                f"{counted(len(some), 'number')} changed by more than the tolerance, and the "
                f"measurements {why}: {_some(told, len(some))}"
            )
    if calibration.moved is not None:
        return said
    handed = handed_robot(calibration).covariance
    return [*said, *zero_words(handed_numbers(calibration), calibration.nominal.chain, handed)]


def zero_words(numbers: Sequence[HandedNumber], chain: Chain, covariance: Array) -> tuple[str, ...]:
    """Zeros of joints of which theta and beta have a part each: they turn about parallel axes.

    `covariance` (P, P) is that of all numbers [m, rad]: of the sum it must be known that it is off.
    In Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) the axis of beta is that of theta, or its opposite,
    where alpha is a right angle.
    """
    by_name, said = {one.row.name: one for one in numbers}, []
    for joint, (_, _, _, alpha, _) in enumerate(chain.links, start=1):
        parts = [by_name.get(f"theta{joint}"), by_name.get(f"beta{joint}")]
        along = np.sin(alpha)
        if chain.prismatic[joint - 1] or abs(along) < PARALLEL or None in parts:
            continue
        theta, beta = (one for one in parts if one is not None)
        turns = theta.row.delta, beta.row.delta * along
        whole, limit = sum(turns), theta.tolerance
        at = 6 + 5 * (joint - 1) + np.array([0, 4])
        U = 2 * DEG * np.sqrt(np.array([1.0, along]) @ covariance[np.ix_(at, at)] @ [1.0, along])
        if limit is None or abs(whole) <= max(limit, U, *(EVEN * abs(turn) for turn in turns)):
            continue
        said.append(
            f"theta{joint} and beta{joint} turn about parallel axes here, and share what is off: "
            f"together the zero of joint {joint} is {significant(whole, 2)} deg off"
        )
    return tuple(said)


def _some(told: list[str], count: int) -> str:
    """The first ones, and how many more there are."""
    more = [f"{count - len(told)} more"] if count > len(told) else []
    return listed([*told, *more])


def _widths(tolerance: Array) -> str:
    """Lengths and angles, from least to largest."""
    spans = []
    for sizes, unit in ((tolerance[:, 1:3] * MM, "mm"), (tolerance[:, [0, 3, 4]] * DEG, "deg")):
        ends = dict.fromkeys(f"{float(end):.4g}" for end in (sizes.min(), sizes.max()))
        spans.append(f"{' to '.join(ends)} {unit}")
    return " and ".join(spans)


def tool_words(calibration: Calibration) -> tuple[str, ...]:
    """What is believed of the tool in use, in sentences; empty without one."""
    found = calibration.handback.in_use
    if found is None:
        return tuple(filter(None, [calibration.handback.tool_refused]))
    x, y, z = (1e3 * each for each in found.worst)
    mean, move = found.radius_mean, found.radius_move
    text = (
        f"for {found.tool.name}, at ({x:.6g}, {y:.6g}, {z:.6g}) mm in the flange frame, the mean "
        f"tip lies within R95 = {with_unit(mean, move)} of the predicted one "
        f"(3-D radius, {100 * found.probability:g} %"
    )
    if np.isfinite(move):
        text += f"; for a single move {with_unit(move, mean)}"
    text += ")"
    if any(found.tool.box):
        text += "; that is the worst corner of the stated box"
    return (
        text + IN_DATUM * calibration.relative,
        "this includes how far the links between the measured target and the flange may be from "
        "nominal: to know more, measure a target on that tool",
    )
