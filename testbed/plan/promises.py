"""What a plan promises, in words: how near, with which probability, and what it cannot promise."""

from collections.abc import Sequence
from math import floor

import numpy as np

from calib.arrays import Bool
from calib.held_out_counts import fewest_poses
from calib.shown import length_unit
from calib.uncertainty.drift.drifting import AGAIN
from calib.uncertainty.statement.applicability import REFUSED, WARNED, Applicability
from calib.uncertainty.statement.distance import least_content
from calib.uncertainty.statement.places import room_words
from testbed.plan.lengths import length
from testbed.plan.records import Plan
from testbed.plan.target import falls_short, joint_words, shortfall_words
from testbed.units import NARROW, counted, listed, percent, significant

PLANNED = "PLANNED - predicted, not measured; no calibration certificate"
"""On everything that a plan writes: it is about a real robot that is still to be measured."""
OVER = {"V": "RMS over the goal", "G": "worst of the goal"}
"""What a figure of each criterion of the goal is."""
CERTAIN = 1e-9
"""Of an efficiency: no difference."""


def promise(plan: Plan) -> str:
    """What will come out, first of all that a target is missed, and what no plan can promise."""
    poses = counted(len(plan.places), "more pose" if len(plan.measured_q) else "pose")
    seen = plan.foresight
    far = "noise and the tracker's systematic errors" if has_shared(plan) else "noise alone"
    return shortfall_words(plan) + (
        f"{poses} will locate the mean tool point within {length(seen.R95_over)} (3-D "
        f"radius, 95{NARROW}%). This counts {far}, over all postures of the goal. "
        f"{misfit_words(plan)}. {_time_words(plan)}."
    )


def _time_words(plan: Plan) -> str:
    """How long it takes to measure all poses, the held-out ones among them."""
    time, held = minutes(plan.tour.duration), plan.tour.roles.count("test")
    if not held:
        return f"Measuring takes about {time}"
    return f"All {len(plan.tour)} poses, {held} of them held out, take about {time} to measure"


def misfit_words(plan: Plan) -> str:
    """Up to which size errors outside the model stay hidden, and the radius that allows for it."""
    size, about = plan.foresight.misfit_seen, stated_words(plan)
    if not np.isfinite(size):
        few = "These measurements are too few to show errors outside the model"
        return f"{few}, and the calibration will state {about}" if about else few
    allowed = f"allow for it and state {about}" if about else "allow for it"
    return (
        f"Errors outside the model may stay hidden below {length(size, digits=2)} per axis: the "
        f"calibration will {allowed}"
    )


def stated_words(plan: Plan) -> str:
    """Which radius the calibration will state, of which arm; empty where it will state none."""
    links, joints = plan.foresight.stated.medians[:, 0]
    if not np.isfinite(links):
        return ""
    about = f"about {length(links, joints, digits=2)}"
    if not np.isfinite(joints) or falls_short(plan):
        return about  # or what the first words say
    return f"{about}, or {length(joints, links, digits=2)} if {joint_words(plan)}"


def has_shared(plan: Plan) -> bool:
    """Whether the tracker states systematic errors."""
    return bool(plan.foresight.shared.any())


def factor_words(factor: float, over: str = "") -> str:
    """What a U is: factor, dimension, probability, and over which postures."""
    least = floor(100 * least_content(factor))
    words = f"k = {factor:g}, 3-D, at least {least}{NARROW}%"
    return f"{words}, {over}" if over else words


def parts_words(plan: Plan) -> str:
    """The parts of the standard uncertainty over the goal."""
    if not has_shared(plan):
        return "noise alone: the tracker states no systematic errors"
    noise, shared = map(plan.over_goal, (plan.foresight.noise, plan.foresight.shared))
    scale, _ = length_unit(plan.u_mean)
    return f"noise {significant(noise * scale)}, systematic errors {significant(shared * scale)}"


def efficiency_word(efficiency: float) -> str:
    """A certified efficiency: rounded down, so that the word is as true as the number.

    Examples
    --------
    >>> efficiency_word(0.93258), efficiency_word(1.0), efficiency_word(float("nan"))
    ('0.932', '1.000', '–')
    """
    return f"{floor(min(efficiency + CERTAIN, 1.0) * 1000) / 1000:.3f}" if efficiency > 0 else "–"


def minutes(seconds: float) -> str:
    """A duration for people.

    Examples
    --------
    >>> minutes(94.2), minutes(3723)
    ('1 min 34 s', '62 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 600:
        return f"{whole // 60} min {whole % 60} s" if whole % 60 else f"{whole // 60} min"
    return f"{round(whole / 60)} min"


def hidden_words(plan: Plan) -> str:
    """Which systematic errors nothing measured by this plan can show."""
    seen = plan.foresight.sources
    if seen is None or not seen.hidden:
        return ""
    return (
        "Held-out poses measured by the same tracker cannot reveal some of its errors "
        f"({listed(seen.hidden)}): these count as stated"
    )


def order_words(plan: Plan) -> str:
    """What the measuring order lets the calibration tell, and what the other one would take."""
    other = plan.tour.other_duration
    takes = f"takes about {minutes(other)}" if np.isfinite(other) else "finds no free way"
    if plan.scenario.plan.order == "random":
        return (
            "The poses are in random order, so that drift of the station can be distinguished from "
            f'misfit of the model; [plan] order = "tour" {takes}'
        )
    again = min(AGAIN, len(plan.tour.pool_place))
    return (
        "The poses are in a tour, where neighbors follow each other: drift of the station cannot "
        "be distinguished from misfit of the model, and correlated noise cannot be tested "
        f"(measure the first {again} poses once more at the end to see a drift that goes one way); "
        f'[plan] order = "random" {takes}'
    )


def reach_warnings(plan: Plan) -> tuple[str, ...]:
    """A warning where the statement will not reach much of the goal."""
    seen = plan.foresight.applies
    if seen is None or seen.reaches:
        return ()
    share = percent(float((seen.place == "outside").mean()))
    return (
        f"Warning: the statement will not reach {share} of the goal's postures: there unmodelled "
        f"errors or noise have more than {REFUSED:g} times the variance that they have at the "
        "held-out poses; let the tracker see the goal, so that 20 poses can be held out there",
    )


def reach_words(plan: Plan) -> tuple[str, ...]:
    """Where the statement will hold, as far as can be known before measuring."""
    seen, count = plan.foresight.applies, plan.tour.roles.count("test")
    least = fewest_poses(0.95)
    if seen is None:
        return (
            "No pose is held out: where the statement will hold is unknown, and nothing guards it; "
            f"write held_out = {least + 1}",
        )
    said = [_where(seen, plan.nominal.chain.kinds)]
    if count < least:
        said.append(
            f"{counted(count, 'held-out pose')} cannot guard the factor of the statement; "
            f"{least} are needed"
        )
    return tuple(said)


def _where(seen: Applicability, kinds: Sequence[str]) -> str:
    """At how many postures of the goal the statement will hold, grow, or not be made, and why."""
    whole = counted(len(seen.place), "posture")
    inside, edge, outside = (seen.place == word for word in ("inside", "edge", "outside"))
    if inside.all():
        return "Every posture of the goal lies inside what will be proven"
    lie = "lies" if inside.sum() == 1 else "lie"
    parts = [f"{_count(inside)} of the goal's {whole} {lie} inside what will be proven"]
    if edge.any():
        parts.append(f"{_count(edge)} at the edge: {_edge_reasons(seen, edge, kinds)}")
    if outside.any():
        parts.append(f"{_count(outside)} outside, where no region will be stated")
    return "; ".join(parts)


def _count(these: Bool) -> str:
    """How many of the goal's postures, and their share."""
    return f"{int(these.sum())} ({percent(float(these.mean()))})"


def _edge_reasons(seen: Applicability, edge: Bool, kinds: Sequence[str]) -> str:
    """Why postures lie at the edge, and at how many both reasons hold."""
    said = []
    grown = edge & (np.maximum(seen.transfer, seen.leverage) > WARNED)
    if grown.any():
        said.append(
            f"{int(grown.sum())} because the region grows (unmodelled errors or noise have more "
            f"than {WARNED:g} times the variance of the held-out poses)"
        )
    beyond = seen.beyond & edge[:, None]
    far = beyond.any(axis=1)
    if far.any():
        counts = beyond.sum(axis=0)
        joints = [
            f"joint {j + 1} at {counts[j]}" for j in np.argsort(-counts, kind="stable") if counts[j]
        ]
        room = room_words([kinds[j] for j in np.flatnonzero(counts).tolist()])
        said.append(
            f"{int(far.sum())} because a joint is more than {room} beyond its range over the "
            f"held-out poses ({listed(joints)})"
        )
    if (grown & far).any():
        said.append(f"{int((grown & far).sum())} of them for both")
    return ", ".join(said)
