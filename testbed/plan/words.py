"""What a plan says in words: on the first screen of its report, on the terminal, in the viewer."""

import numpy as np

from testbed.plan.records import FAR, Plan
from testbed.report.page import SIMULATED
from testbed.units import MM, UM, counted, fixed, percent, sentence, significant

CLOSE = 0.01
"""Stations whose uncertainty differs by less than this part are called equally good."""
PROMISED = (3, 4)
"""Rows of the headline that say what will come out."""


def promise(plan: Plan) -> str:
    """The one sentence of a plan."""
    k = plan.scenario.plan.coverage
    more = " more" if len(plan.measured_q) else ""
    return (
        f"{len(plan.places)}{more} {'pose' if len(plan.places) == 1 else 'poses'} in about "
        f"{minutes(plan.tour.duration)} will make the tool point known to "
        f"U = {significant(k * plan.u_mean * UM, 3)} µm (k = {k:g}, RMS over the goal), "
        f"{significant(k * plan.u_worst * UM, 3)} µm at its worst, if the robot is as its model "
        "says."
    )


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


def headline_rows(plan: Plan) -> list[tuple[str, str, str]]:
    """What, value, unit."""
    settings, tour, k = plan.scenario.plan, plan.tour, plan.scenario.plan.coverage
    held = tour.roles.count("test")
    rows = [
        ("poses to identify from", str(len(plan.places)), _already(plan)),
        ("held-out poses, to check with", str(held), ""),
        (
            "expected time",
            fixed(tour.duration / 60, 1),
            f"min, {fixed(float(tour.move.sum()) / 60, 1)} min moving at "
            f"{percent(settings.speed_share)} speed",
        ),
        (f"predicted U over the goal (k = {k:g})", significant(k * plan.u_mean * UM, 3),
         f"µm, RMS; u = {significant(plan.u_mean * UM, 3)} µm"),
        (f"predicted U at the worst of the goal (k = {k:g})",
         significant(k * plan.u_worst * UM, 3),
         f"µm; u = {significant(plan.u_worst * UM, 3)} µm"),
        ("certified efficiency", _efficiency(plan), f"of the best possible, {settings.criterion}"),
    ]  # fmt: skip
    if plan.curve.target is not None:
        rows.append(
            (
                "target",
                significant(k * plan.curve.target * UM, 3),
                f"µm, {'RMS over the goal' if settings.target_is == 'mean' else 'worst'}",
            )
        )
        if plan.curve.fewest is not None:
            rows.append(("proven least number of poses for it", str(plan.curve.fewest), "poses"))
    x, y, z = plan.station_mm
    rows.append(("tracker station", f"({x:.0f}, {y:.0f}, {z:.0f})", "mm in the base frame"))
    rows.append(("numbers identified", str(plan.parameters.n_free), ""))
    return rows


def _already(plan: Plan) -> str:
    """Beside how many measured already."""
    count = len(plan.measured_q)
    return f"beyond {counted(count, 'pose')} measured already" if count else ""


def _efficiency(plan: Plan) -> str:
    """The certified part of the best, or a dash."""
    return "–" if plan.proof.efficiency is None else fixed(plan.proof.efficiency, 4)


def certificate_word(plan: Plan) -> str:
    """What the certificate is about."""
    if plan.proof.efficiency is None:
        return "This criterion has no certificate."
    return (
        "The certificate holds for every set of the same size, without repeats, from the same pool."
    )


def reasons(plan: Plan) -> tuple[str, ...]:
    """The sentences under the promise: warnings, what is proven, how long, from where."""
    said = (
        *untested(plan),
        plan.proof.sentence,
        plan.curve.sentence,
        plan.tour.sentence,
        clearance_words(plan),
        measured_words(plan),
        station_words(plan),
    )
    return tuple(sentence(text) for text in said if text)


def mark(plan: Plan) -> str:
    """What holds of every pose and move, as far as it was tested."""
    if plan.tour.blocked:
        return "✗ Not every move is free"
    tested = ["is free of collisions"]
    if tests_cone(plan):
        tested.append("faces the tracker")
    if plan.scenario.pool.line_of_sight:
        tested.append("is in its line of sight" if tests_cone(plan) else
                      "is in the tracker's line of sight")  # fmt: skip
    listed = " and ".join([", ".join(tested[:-1]), tested[-1]] if tested[1:] else tested)
    return f"{'!' if untested(plan) else '✓'} Every pose {listed}, and every move is free"


def tests_cone(plan: Plan) -> bool:
    """Whether poses were tested for facing the tracker."""
    return plan.scenario.tracker.acceptance_deg < 180.0


def untested(plan: Plan) -> tuple[str, ...]:
    """Warnings, one for each thing that decides whether a pose can be measured and was not asked.

    A reflector alone may be seen from all around; a 6-D target never is.
    """
    said = []
    if plan.scenario.tracker.measures == "pose" and not tests_cone(plan):
        said.append(
            "Warning: whether the probe faces the tracker was not tested, since [tracker] "
            "acceptance_deg is 180; write what the probe can take, such as 60, or some of these "
            "poses cannot be measured"
        )
    if not plan.scenario.pool.line_of_sight:
        said.append(
            "Warning: whether the beam is blocked was not tested, since [pool] line_of_sight is "
            "false; some of these poses may be hidden"
        )
    return tuple(said)


def clearance_words(plan: Plan) -> str:
    """How near the robot comes to what stands around it."""
    smallest, wanted = plan.tour.clearance, plan.scenario.plan.clearance_mm
    if smallest >= FAR:
        return f"The robot keeps {FAR * MM:g} mm or more from floor and obstacles"
    rule = f"at least {wanted:g} mm was kept" if wanted else "only no touch was asked for"
    return (
        f"The robot comes to {significant(smallest * MM, 3)} mm from floor or obstacles where the "
        f"moves were tested; {rule}"
    )


def measured_words(plan: Plan) -> str:
    """From where the poses measured already were measured; nothing if there are none."""
    if not len(plan.measured_q):
        return ""
    x, y, z = plan.station_mm
    return (
        f"The {counted(len(plan.measured_q), 'pose')} measured already count as measured from "
        f"[tracker] station_mm, ({x:.0f}, {y:.0f}, {z:.0f}) mm, with this tracker and base"
    )


def station_words(plan: Plan) -> str:
    """Which station is best, by how much, and why; nothing if none were compared."""
    seen = plan.stations
    if seen is None:
        return ""
    k, top = plan.scenario.plan.coverage, seen.best
    order = np.argsort(seen.u_mean, kind="stable")
    usable = [int(n) for n in order if np.isfinite(seen.u_mean[n])]
    head = (
        f"Of {counted(len(order), 'station')}, {_station(plan, top)} is best: "
        f"{counted(len(seen.designs[top]), 'pose')} designed from there "
        f"{'gives' if len(seen.designs[top]) == 1 else 'give'} U = "
        f"{significant(k * float(seen.u_mean[top]) * UM, 3)} µm (k = {k:g}, RMS over the goal)"
    )
    if len(usable) < 2:
        return f"{head}; no other can be used." if len(order) > 1 else f"{head}."
    second = next(n for n in usable if n != top)
    more = float(seen.u_mean[second] / seen.u_mean[top]) - 1
    ahead = []
    if seen.visible[top] > seen.visible[second]:
        ahead.append(
            f"sees {counted(int(seen.visible[top] - seen.visible[second]), 'candidate')} more"
        )
    if seen.range_mean[top] < seen.range_mean[second]:
        ahead.append(f"stands {float(seen.range_mean[second] - seen.range_mean[top]):.2f} m nearer")
    why = " and ".join(ahead) or "sees the poses from a better side"
    hardly = ", hardly a difference" if more < CLOSE else ""
    return (
        f"{head}; as many from {_station(plan, second)} give {percent(more)} more{hardly}. The "
        f"best one {why}."
    )


def _station(plan: Plan, number: int) -> str:
    """A compared station as people name it."""
    assert plan.stations is not None
    x, y, z = plan.stations.stations[number] * MM
    return f"station {number + 1} at ({x:.0f}, {y:.0f}, {z:.0f}) mm"


def next_step(plan: Plan) -> str:
    """What a person should do with the plan."""
    held = plan.tour.roles.count("test")
    if plan.tour.blocked:
        return (
            "There are no robot programs, since a move in them would hit something: lead the robot "
            "around by hand at the moves named above, or take the obstacle away and plan again."
        )
    check = (
        f" Keep the {counted(held, 'held-out pose')} out of the identification: they tell whether "
        "the promise was kept."
        if held
        else " Hold out some poses (held_out): without them nobody can tell whether the promise "
        "was kept."
    )
    return (
        "Compare signs and zeros of the joints with the controller, run the program once at low "
        f"speed, then measure the poses of plan.csv in order.{check}"
    )


def terminal_text(plan: Plan) -> str:
    """What the command prints: the promise, the numbers, what is proven."""
    from testbed.report.text import table

    rows = [list(row) for row in headline_rows(plan)]
    parts = [SIMULATED, table(promise(plan), ("what", "value", ""), rows, wrap=True), ""]
    return "\n".join([*parts, *(f"- {sentence}" for sentence in reasons(plan))])
