"""What a plan says in words: on the first screen of its report, on the terminal, in the viewer."""

from collections.abc import Iterable

import numpy as np

from calib.arrays import Array
from calib.uncertainty.statement.departure import departure
from testbed.laboratory.tracker.stations import place_word
from testbed.lengths import column_unit
from testbed.plan.cautions import has_program, tests_contact, uncounted, untested
from testbed.plan.lengths import expanded, length, or_dash, unit_of
from testbed.plan.promises import (
    OVER,
    PLANNED,
    efficiency_word,
    factor_words,
    has_shared,
    hidden_words,
    order_words,
    parts_words,
    promise,
    reach_warnings,
    reach_words,
)
from testbed.plan.records import FAR, Plan
from testbed.plan.target import enough_words, falls_short, joint_words, shortfall_step, target_row
from testbed.units import MM, UM, counted, fixed, millimetres, percent, plain, sentence

CLOSE = 0.01
"""Stations whose uncertainty differs by less than this part are called equally good."""
PROMISED = (3, 4, 5, 6, 7, 8)
"""Rows of the headline that say what will come out."""


def headline_rows(plan: Plan) -> list[tuple[str, str, str]]:
    """What, value, unit."""
    settings, tour, target = plan.scenario.plan, plan.tour, plan.curve.target
    count, seen = len(plan.measured_q), plan.foresight
    beyond = f"beyond {counted(count, 'pose')} measured already" if count else ""
    minutes_moving = fixed(float(tour.move.sum()) / 60, 1)
    efficiency, (links, joints) = plan.proof.efficiency, seen.stated.medians[:, 0]
    rows = [
        ("poses to identify from", str(len(plan.places)), beyond),
        ("held-out poses, to check with", str(tour.roles.count("test")), ""),
        ("expected time", fixed(tour.duration / 60, 1),
         f"min, {minutes_moving} min moving at {percent(settings.speed_share)} speed"),
        _row("R95 over the postures of the goal", seen.R95_over, ": 3-D radius, 95 % probability"),
        _row("R95 at the worst of these", seen.R95_worst, ": 3-D radius, 95 % probability"),
        _stated("R95 that the calibration will state", links, seen.stated.links,
                "of an arm whose links alone are off"),
        _stated(f"the same where {joint_words(plan)}", joints, seen.stated.joints,
                "of an arm whose joint errors are identified, too"),
        _row("standard uncertainty u at the goal", plan.u_mean,
             f" (3-D, k = 1, RMS): {parts_words(plan)}"),
        _row("smallest misfit that would show", seen.misfit_seen, " per axis", digits=2),
        ("certified efficiency", "–" if efficiency is None else efficiency_word(efficiency),
         f"of the best possible, {settings.criterion}"),
    ]  # fmt: skip
    if target is not None:
        over = OVER["V" if settings.target_is == "mean" else "G"]
        u = plan.u_mean if settings.target_is == "mean" else plan.u_worst
        scale, unit = unit_of(plan, target, u)
        asked, reached = (expanded(plan, each, scale=scale) for each in (target, u))
        what = f"{unit} for U = {plan.coverage:g} u ({factor_words(plan.coverage, over)})"
        rows.append(("target", asked, f"{what}; predicted {reached}"))
        if plan.curve.fewest is not None:
            rows.append(("proven least number of poses for it", str(plan.curve.fewest), "poses"))
        rows += target_row(plan)
    # a wide value would push the words beside it off a phone
    root, stands = plan.base
    frame, place = "the base frame", plan.station_mm
    if stands:
        frame, place = root, tuple(MM * plan.T_world_tracker[:3, 3])
    rows.append(("tracker station", "", f"{in_mm(place)} mm in {frame}"))
    rows.append(("numbers identified", str(plan.parameters.n_free), ""))
    return rows


def _row(what: str, value: float, about: str, *, digits: int = 3) -> tuple[str, str, str]:
    """A length [m]: what it is, its value, its unit with more about it."""
    number, _, unit = length(value, digits=digits).rpartition(" ")
    return what, number, f"{unit}{about}"


def _stated(what: str, radius: float, radii: Array, arm: str) -> tuple[str, str, str]:
    """A radius that will be stated [m], and how far it may be off.

    One more draw lies within the range of ten with a probability of 9 / 11, whatever their law.
    """
    if not len(radii):
        return what, or_dash(radius * UM, 2), f"µm: nothing will be stated {arm}"
    low, high = radii[:, 0].min(), radii[:, 0].max()
    reached = radii[np.isfinite(radii[:, 1]), 1]
    goal = float(np.median(reached)) if len(reached) else np.nan
    scale, unit = column_unit([radius, low, high, goal])
    digits = 2 if unit == "µm" else 3
    value, least, most, over = (or_dash(x * scale, digits) for x in (radius, low, high, goal))
    said = f"{unit}: {least} to {most} in {len(radii)} rehearsals {arm}"
    return what, value, f"{said}; at the goal {over}" if np.isfinite(goal) else said


def axes_words(plan: Plan) -> str:
    """What the tracker's axes are, which is level however the base is turned."""
    base, axes = (T[:3, :3] for T in (plan.nominal.chain.T_world_base, plan.T_world_tracker))
    if (axes == base).all():
        return "axes parallel to the robot's base"
    name = "x" if axes[:, 0] @ base[:, 0] > axes[:, 0] @ base[:, 2] else "z"
    return f"level axes: z up, x as the {name} of the robot's base points, seen from above"


def certificate_word(plan: Plan) -> str:
    """What the certificate is about."""
    if plan.proof.efficiency is None:
        return "This criterion has no certificate."
    certificate = "The certificate holds for every set of the same size, without repeats, from the"
    if not has_shared(plan):
        return f"{certificate} same pool."
    if plan.scenario.plan.criterion not in OVER:
        return f"{certificate} same pool, and counts the noise alone, as this criterion does."
    return (
        f"{certificate} same pool, whether the estimate finds the tracker's systematic errors or, "
        "as it does, not; the true optimum may lie well above the bound."
    )


def reasons(plan: Plan) -> tuple[str, ...]:
    """The sentences under the promise: warnings, what is proven, how long, from where."""
    said = (
        *warnings(plan),
        *reach_words(plan),
        hidden_words(plan),
        plan.proof.sentence,
        plan.curve.sentence,
        enough_words(plan),
        plan.tour.sentence,
        order_words(plan),
        clearance_words(plan),
        measured_words(plan),
        assumed_words(plan),
        base_frame_words(plan),
        *use_words(plan),
        station_words(plan),
    )
    return tuple(sentence(text) for text in said if text)


def warnings(plan: Plan) -> tuple[str, ...]:
    """Why the plan should not be followed as it is."""
    return (*untested(plan), *uncounted(plan), *reach_warnings(plan))


def clearance_words(plan: Plan) -> str:
    """How near the robot comes to what stands around it."""
    smallest, wanted = plan.tour.clearance, plan.scenario.plan.clearance_mm
    if not tests_contact(plan):
        return ""
    if smallest >= FAR:
        return f"The robot keeps {FAR * MM:g} mm or more from floor and obstacles"
    rule = f"{wanted:g} mm are required" if wanted else "only contact is ruled out"
    return (
        f"The smallest clearance from floor and obstacles along the tested moves is "
        f"{millimetres(smallest)} mm; {rule}"
    )


def base_frame_words(plan: Plan) -> str:
    """Where the base frame stands, if the robot's own file has none there; else nothing."""
    _, stands = plan.base
    if not stands:
        return ""
    return (
        f"The base frame, in which the scenario states the station, {in_mm(plan.station_mm)} mm, "
        f"and boxes, stands on the first joint axis, {stands}"
    )


def measured_words(plan: Plan) -> str:
    """From where the poses measured already were measured; nothing if there are none."""
    if not len(plan.measured_q):
        return ""
    return (
        f"The {counted(len(plan.measured_q), 'pose')} measured already count as measured from "
        f"[tracker] station_mm, {in_mm(plan.station_mm)} mm, with this tracker and base"
    )


def assumed_words(plan: Plan) -> str:
    """What was assumed of the robot; nothing if its file says all."""
    if not plan.assumed:
        return ""
    return f"The robot's file leaves open, and the plan assumes: {'; '.join(plan.assumed)}"


def use_words(plan: Plan) -> tuple[str, ...]:
    """Under which conditions to measure, and what was measured under others already."""
    use = plan.use
    if not use.stated:
        return ()
    apart = departure(plan.measured_under, use, 1)
    said = apart.clauses(lambda _: "the goal", "the poses measured already").values()
    return (
        *(f"Warning: {text}; they count here as if nothing differed" for text in said),
        f"Measure {use.phrase}, as the robot will be used: no statement will hold under other "
        "conditions than those of the measurements",
    )


def station_words(plan: Plan) -> str:
    """Which station is best, by how much, and why; nothing if none were compared."""
    seen = plan.stations
    if seen is None:
        return ""
    top, poses = seen.best, len(seen.designs[seen.best])
    order = np.argsort(seen.u_mean, kind="stable")
    others = [int(n) for n in order if np.isfinite(seen.u_mean[n]) and n != top]
    head = (
        f"Of {counted(len(order), 'station')}, {place_word(top, seen.stations[top])} is best: "
        f"{counted(poses, 'pose')} designed from there {'gives' if poses == 1 else 'give'} U = "
        f"{length(plan.coverage * seen.u_mean[top])} ({factor_words(plan.coverage, OVER['V'])})"
    )
    if not others:
        return f"{head}; no other can be used." if len(order) > 1 else f"{head}."
    second = others[0]
    more = float(seen.u_mean[second] / seen.u_mean[top]) - 1
    ahead = []
    if (sees := int(seen.visible[top] - seen.visible[second])) > 0:
        ahead.append(f"sees {counted(sees, 'candidate')} more")
    if (nearer := float(seen.range_mean[second] - seen.range_mean[top])) > 0:
        ahead.append(f"stands {nearer:.2f} m nearer")
    why = " and ".join(ahead) or "sees the poses from a better side"
    hardly = ", hardly a difference" if more < CLOSE else ""
    return (
        f"{head}; as many from {place_word(second, seen.stations[second])} give {percent(more)} "
        f"more{hardly}. The best one {why}."
    )


def in_mm(place: Iterable[float]) -> str:
    """A place [mm] in whole millimetres."""
    return f"({', '.join(f'{value:.0f}' for value in place)})"


def next_step(plan: Plan) -> str:
    """What a person should do with the plan."""
    held = plan.tour.roles.count("test")
    if plan.tour.blocked:
        return (
            "There are no robot programs, since a move in them would hit something: lead the robot "
            "around by hand at the moves named above, or take the obstacle away and plan again."
        )
    if falls_short(plan):
        return shortfall_step(plan)
    check = (
        f" Keep the {counted(held, 'held-out pose')} out of the identification: they show whether "
        "the prediction holds."
        if held
        else " Hold out some poses (held_out): without them nothing shows whether the prediction "
        "holds."
    )
    moves = "run the program" if has_program(plan) else "go through the rows of plan.csv"
    return (
        f"Compare signs and zeros of the joints with the controller, {moves} once at low "
        f"speed, then measure the poses of plan.csv in order.{check}"
    )


def terminal_text(plan: Plan) -> str:
    """What the command prints: the promise, the numbers, what to do, what to know beside it."""
    from testbed.report.text import table, verdict_lines

    rows = [[plain(cell) for cell in row] for row in headline_rows(plan)]
    title = f"{plan.scenario.name}: what is planned"
    parts = [PLANNED, table(title, ("what", "value", ""), rows, wrap=True), ""]
    parts += verdict_lines(plain(promise(plan)))
    parts += [f"To do: {plain(next_step(plan))}", "Of note:"]
    said = (
        *warnings(plan), enough_words(plan), *reach_words(plan), hidden_words(plan),
        plan.tour.sentence, order_words(plan), measured_words(plan), assumed_words(plan),
        base_frame_words(plan),
        *use_words(plan),
        "The report shows what is proven about this choice of poses",
    )  # fmt: skip
    return "\n".join([*parts, *(f"  {plain(sentence(text))}" for text in said if text)])
