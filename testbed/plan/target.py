"""What a plan says of its target where joints sag and wave, as those of most arms do."""

from collections.abc import Iterator

import numpy as np

from testbed.lengths import column_unit
from testbed.plan.lengths import length, or_dash
from testbed.plan.records import Plan
from testbed.store.quantities import METRE, Quantity
from testbed.units import counted, significant


def joint_words(plan: Plan) -> str:
    """Which joint errors the second kind of rehearsal identifies."""
    slides = plan.nominal.chain.prismatic > 0
    said = ["joints sag and wave"] if not slides.all() else []
    return " and ".join([*said, "slides travel too far"] if slides.any() else said)


def falls_short(plan: Plan) -> bool:
    """Whether the target is missed where joints sag and wave, as far as that was asked."""
    return plan.sufficiency is not None and not plan.sufficiency.reached


def shortfall_words(plan: Plan) -> str:
    """A sentence: the target is missed, by how much, what more poses would bring; else empty."""
    seen = plan.sufficiency
    if seen is None or seen.reached:
        return ""
    head = f"The target is missed if {joint_words(plan)}, as those of most arms do"
    if np.isfinite(seen.radius):
        up_to = length(seen.radius, seen.allowed)
        more = f"more than {length(seen.allowed, seen.radius)}"
        said = f"the calibration will state up to {up_to} {over_words(plan)}, {more}"
    else:
        said = f"the calibration will mostly state no radius {over_words(plan)}"
    if seen.most > len(plan.places) and np.isfinite(seen.least):
        poses = counted(seen.most, "more pose" if len(plan.measured_q) else "pose")
        said += f"; {poses} would leave {length(seen.least, seen.radius)}"
    return f"{head}: {said}. "


def shortfall_step(plan: Plan) -> str:
    """What to do instead of measuring a plan that falls short."""
    seen = plan.sufficiency
    pool = seen is not None and seen.most == len(plan.pool.q)
    wider = "enlarge [pool] size, " if pool else ""
    return (
        "Do not measure this plan: change what it is asked for, and plan again. Let the tracker "
        f"stand nearer or see more of the goal, {wider}raise target_um, or, if the joints are "
        "known not to sag and wave, write [plan] stiff_joints = true."
    )


def enough_words(plan: Plan) -> str:
    """Why there are more poses than the target asks of the links alone; else empty."""
    fewest, seen = plan.curve.reached, plan.sufficiency
    if not fewest or len(plan.places) <= fewest:
        return ""
    head = (
        f"{counted(fewest, 'pose')} would do for the links alone; with {len(plan.places)} the "
        f"calibration can tell as well whether {joint_words(plan)}"
    )
    if seen is None or not seen.reached:
        return head
    return (
        f"{head}, and if so it will state at most {length(seen.radius)} {over_words(plan)} "
        "(9 of 10 rehearsals, and a quarter more for misfit)"
    )


def target_row(plan: Plan) -> tuple[tuple[str, str, str], ...]:
    """The row of the headline that compares the target with what will be stated; or none."""
    seen = plan.sufficiency
    if seen is None:
        return ()
    finite = seen.radius if np.isfinite(seen.radius) else seen.allowed
    scale, unit = column_unit([finite, seen.allowed])
    said = (
        f"{unit} {over_words(plan)}: 9 of 10 rehearsals, and a quarter more for misfit; the "
        f"target allows {significant(seen.allowed * scale)}"
    )
    return ((f"R95 stated where {joint_words(plan)}", or_dash(seen.radius * scale), said),)


def over_words(plan: Plan) -> str:
    """Where the target holds."""
    worst = plan.scenario.plan.target_is == "worst"
    return "at the worst of the goal" if worst else "over the goal"


def target_numbers(plan: Plan) -> Iterator[Quantity]:
    """The same for plan.json."""
    seen = plan.sufficiency
    if seen is None:
        return
    radius, least = (r if np.isfinite(r) else np.nan for r in (seen.radius, seen.least))
    yield Quantity("budget/joints/reached", seen.reached)
    yield Quantity("budget/joints/R95_stated_um", radius, METRE)
    yield Quantity("budget/joints/R95_allowed_um", seen.allowed, METRE)
    yield Quantity("budget/joints/poses_tried", seen.most)
    yield Quantity("budget/joints/R95_stated_of_these_um", least, METRE)
