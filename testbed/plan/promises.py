"""What a plan promises, in words: how near, with which probability, and what it cannot promise."""

from math import floor

import numpy as np

from calib.held_out_counts import fewest_poses
from calib.uncertainty.statement.applicability import REFUSED, WARNED, Applicability
from calib.uncertainty.statement.distance import least_content
from testbed.plan.records import Plan
from testbed.units import NARROW, UM, counted, listed, micrometres, percent, significant

OVER = {"V": "RMS over the goal", "G": "worst of the goal"}
"""What a figure of each criterion of the goal is."""
BEYOND_COUNTS = 0.05
"""Share of the goal's postures from which a joint outside its proven range is named."""


def promise(plan: Plan) -> str:
    """What will come out, and what no plan can promise."""
    poses = counted(len(plan.places), "more pose" if len(plan.measured_q) else "pose")
    seen = plan.foresight
    far = "noise and the tracker's systematic errors go" if has_shared(plan) else "noise goes"
    return (
        f"{poses} in about {minutes(plan.tour.duration)} will make the mean tool point known to "
        f"within {micrometres(seen.R95_over)} µm with 95{NARROW}% probability (3-D radius, over "
        f"the goal; {micrometres(seen.R95_worst)} µm at its worst), as far as {far}. What the "
        f"model misses cannot be promised: {misfit_words(plan)}."
    )


def misfit_words(plan: Plan) -> str:
    """Which misfit the measurements would show, and what becomes of a smaller one."""
    size = plan.foresight.misfit_seen
    if not np.isfinite(size):
        return "these measurements are too few to show any misfit"
    return (
        f"a misfit of {micrometres(size, 2)} µm per axis or more would be seen by these "
        "measurements; less may hide, and the region will hold what the readings then allow"
    )


def has_shared(plan: Plan) -> bool:
    """Whether the tracker states systematic errors."""
    return bool(plan.foresight.shared.any())


def factor_words(factor: float, over: str = "") -> str:
    """What a U is: factor, dimension, probability, and over which postures."""
    least = floor(100 * least_content(factor))
    words = f"k = {factor:g}, 3-D, at least {least}{NARROW}%"
    return f"{words}, {over}" if over else words


def expanded(plan: Plan, u: float, digits: int = 3) -> str:
    """Expanded uncertainty [µm] of a standard one [m]."""
    return or_dash(plan.coverage * u * UM, digits)


def parts_words(plan: Plan) -> str:
    """The parts of the standard uncertainty over the goal."""
    if not has_shared(plan):
        return "noise alone: the tracker states no systematic errors"
    noise, shared = map(plan.over_goal, (plan.foresight.noise, plan.foresight.shared))
    return f"noise {micrometres(noise)}, systematic errors {micrometres(shared)}"


def or_dash(value: float, digits: int = 3) -> str:
    """A number with so many digits, a dash where there is none."""
    return significant(float(value), digits) if np.isfinite(value) else "–"


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
        f"No held-out pose of this tracker can show what it gets wrong by {listed(seen.hidden)}: "
        "that is promised as stated"
    )


def order_words(plan: Plan) -> str:
    """What the measuring order lets the calibration tell, and what the other one would take."""
    other = plan.tour.other_duration
    takes = f"takes about {minutes(other)}" if np.isfinite(other) else "finds no free way"
    if plan.scenario.plan.order == "random":
        return (
            "The poses are in random order: drift of the station can be told from misfit of the "
            f'model; [plan] order = "tour" {takes}'
        )
    return (
        "The poses are in a tour, where neighbors follow each other: drift of the station and "
        "misfit of the model look alike, and the test for noise that remembers is void; [plan] "
        f'order = "random" {takes}'
    )


def reach_warnings(plan: Plan) -> tuple[str, ...]:
    """A warning where the statement will not reach the goal."""
    seen = plan.foresight.applies
    if seen is None or seen.reaches:
        return ()
    share = percent(float((seen.place == "outside").mean()))
    return (
        f"Warning: the statement will not reach there: at {share} of the goal's postures what no "
        f"model holds, or noise, arrives with more than {REFUSED:g} times the variance that it has "
        "at the held-out poses; let the tracker see the goal, so that 20 poses can be held out "
        "there",
    )


def reach_words(plan: Plan) -> tuple[str, ...]:
    """Where the statement will hold, as far as can be known before measuring."""
    seen, count = plan.foresight.applies, plan.tour.roles.count("test")
    least = fewest_poses(0.95)
    if seen is None:
        return (
            "No pose is held out: nobody can say where the statement will hold, and nothing guards "
            f"it; write held_out = {least + 1}",
        )
    said = [_where(seen)] if seen.reaches else []
    if count < least:
        said.append(
            f"{counted(count, 'held-out pose')} cannot guard the factor of the statement, which "
            f"{least} can"
        )
    return tuple(said)


def _where(seen: Applicability) -> str:
    """At which part of the goal the statement will hold, grow, or not be made."""
    outside, edge = (float((seen.place == word).mean()) for word in ("outside", "edge"))
    if not outside and not edge:
        return "Every posture of the goal lies inside what will be proven"
    parts = []
    if outside:
        parts.append(f"{percent(outside)} lie outside, where no region will be stated")
    grown = float((np.maximum(seen.transfer, seen.leverage) > WARNED).mean()) - outside
    if grown > 0:
        parts.append(
            f"{percent(grown)} lie at the edge: what no model holds, or noise, arrives with more "
            f"than {WARNED:g} times the variance that it has at the held-out poses, and the region "
            "grows"
        )
    shares = seen.beyond.mean(axis=0)
    far = [
        f"joint {j + 1} at {percent(float(shares[j]))}"
        for j in np.argsort(-shares, kind="stable")
        if shares[j] >= BEYOND_COUNTS
    ]
    if far:
        parts.append(
            f"a joint goes more than 10 deg beyond its range over the held-out poses: {listed(far)}"
        )
    inside = percent(1 - outside - edge)
    return f"Of the goal's postures {inside} lie inside what will be proven: {'; '.join(parts)}"
