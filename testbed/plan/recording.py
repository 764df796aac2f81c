"""The recording of a plan: candidates by leverage, the number of poses, the tour, the goal."""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, evenly
from testbed.plan.lengths import curve_unit, unit_of
from testbed.plan.promises import (
    OVER,
    PLANNED,
    factor_words,
    minutes,
    order_words,
    promise,
    reach_warnings,
    reach_words,
)
from testbed.plan.recording_cell import (
    draw_candidates,
    draw_cell,
    draw_chosen,
    draw_goal,
    draw_tour,
)
from testbed.plan.records import Plan
from testbed.plan.words import PROMISED, certificate_word, headline_rows
from testbed.recording import style
from testbed.recording.chart import Chart, Series, level
from testbed.recording.story import Chapter, Story, numbered
from testbed.recording.style import Color
from testbed.recording.timeline import along, spread, visit
from testbed.robots.robot import Robot
from testbed.units import counted, plain

CANDIDATE_FRAMES, BUDGET_FRAMES = 144, 60
CANDIDATES = 24
"""Candidates that the robot leafs through."""
MOST_ROWS = 4
"""Rows of the summary, which has to fit its window."""
MOST_GOALS = 30
"""Goal postures the robot goes to; the others are drawn as points."""


def plan_story(plan: Plan, robot: Robot) -> Story:
    """What the recording of a plan holds.

    Parameters
    ----------
    plan : Plan
        Finished; nothing is computed again but nominal poses.
    robot : Robot
        Whose parts are drawn.
    """
    scenario = plan.scenario
    return Story(
        identity=f"{scenario.name}-plan-{scenario.seed}",
        name=f"{scenario.name}, plan, seed {scenario.seed}",
        summary=summary(plan),
        robot=robot,
        chain=plan.nominal.chain,
        reach=plan.pool.T[:, :3, 3],
        station=plan.T_world_tracker[:3, 3],
        draw=lambda pen: draw_cell(plan, robot, pen),
        chapters=(_candidates(plan), _budget(plan), _tour(plan), _goal(plan)),
    )


def summary(plan: Plan) -> str:
    """The promise first, then the plan in numbers."""
    scenario = plan.scenario
    rows = [row for k, row in enumerate(headline_rows(plan)) if k not in PROMISED]
    lines = [
        f"**{PLANNED}**: plan of {scenario.name}, seed {scenario.seed}",
        "",
        promise(plan),
        "",
        *(f"- {what}: {value} {unit}".rstrip() for what, value, unit in rows[:MOST_ROWS]),
    ]
    return "\n".join(lines)


def _candidates(plan: Plan) -> Chapter:
    """The pool by leverage, and who was refused."""
    pool, leafed = plan.pool, evenly(np.arange(len(plan.pool.q)), CANDIDATES)
    curves = (Series("leverage", plan.leverage[leafed], style.BLUE),)
    refused = [
        f"- refused, {name}: {int(count)}"
        for name, count in zip(pool.rejection_names, pool.rejection_counts, strict=True)
        if count
    ]
    return Chapter(
        name="candidates",
        local="candidate",
        color=style.SEARCH_PHASE,
        motion=visit(pool.q[leafed], CANDIDATE_FRAMES // CANDIDATES),
        text=(
            f"#### 1 Candidates: {len(pool.q)} of {pool.n_drawn} drawn",
            "- gray: candidates; vermilion: refused inside the box",
            *refused,
        ),
        draw=partial(draw_candidates, plan),
        lines=numbered("candidate", len(leafed)),
        charts=(Chart("candidates", "Leverage: how much a candidate shown would tell", curves),),
    )


def _budget(plan: Plan) -> Chapter:
    """Uncertainty by number of poses."""
    curve, k = plan.curve, plan.scenario.plan.coverage
    colors = "- vermilion: no set of that size goes below; gray: random sets"
    scale, unit = curve_unit(plan)
    times, unit = k * scale, plain(unit)
    top = 4.0 * times * float(np.median(curve.u))
    curves = [
        _below("designed", times * curve.u, top, style.BLUE),
        _below("no_set_below", times * curve.bound, top, style.VERMILION, "no set goes below"),
        _below("random", times * curve.random, top, style.MUTED_COLOR, "random sets"),
    ]
    if curve.target is not None:
        count = len(curve.counts)
        curves.append(level("target", count, times * curve.target, style.ORANGE))

    return Chapter(
        name="budget",
        local="number",
        color=(150, 110, 190),
        motion=spread(len(curve.counts), BUDGET_FRAMES, plan.tour.start[None]),
        text=(
            "#### 2 Number of poses",
            f"- blue curve: predicted U ({factor_words(k)}) of designed sets",
            colors if curve.target is None else f"{colors}, amber: target",
            f"- from {curve.counts[0]} to {curve.counts[-1]} poses",
            f"- {curve.sentence or plan.proof.sentence}",
            f"- {certificate_word(plan)}",
        ),
        draw=partial(draw_chosen, plan),
        lines=[
            f"{n} poses, U = {times * u:.3g} {unit}"
            for n, u in zip(curve.counts, curve.u, strict=True)
        ],
        charts=(Chart("budget", f"U [{unit}] by number of poses", curves, curve.counts),),
    )


def _tour(plan: Plan) -> Chapter:
    """The way from pose to pose, and the uncertainty after each of them."""
    tour = plan.tour
    scale, unit = unit_of(plan, plan.u_worst)
    times, unit = plan.coverage * scale, plain(unit)
    motion = visit(tour.q)
    q = along(tour.start, tour.q, tour.vias, motion.steps // len(tour))
    measured = np.cumsum([role == "identify" for role in tour.roles])
    # a held-out pose teaches nothing: the curve stays where it was
    after = np.concatenate([[np.nan], plan.u_of_step])[measured]
    known = after[np.isfinite(after)]
    limit = 4.0 * times * float(np.median(known)) if len(known) else 1.0

    return Chapter(
        name="tour",
        local="pose",
        color=style.MEASURE_PHASE,
        motion=replace(motion, q=q),
        text=(
            f"#### 3 Tour: {counted(len(tour), 'pose')} in {minutes(tour.duration)}",
            "- blue: to identify from; orange: held out; number: the pose that is measured",
            "- line: the way of the tool",
            f"- curve: U ({factor_words(plan.coverage, OVER['V'])}) after each pose",
            f"- {tour.sentence}",
            f"- {order_words(plan)}",
        ),
        draw=partial(draw_tour, plan),
        lines=numbered("pose", len(tour), (_known(u, times, unit) for u in after)),
        charts=(
            Chart(
                "tour",
                f"U [{unit}] by pose measured",
                (_below("U", times * after, limit, style.BLUE, "U after it"),),
            ),
        ),
    )


def _goal(plan: Plan) -> Chapter:
    """Uncertainty at goal postures."""
    k = plan.scenario.plan.coverage
    scale, letter = unit_of(plan, plan.u_worst)
    times, unit = k * scale, plain(letter)
    goals = evenly(np.arange(len(plan.goal.q)), MOST_GOALS)
    curves = (
        Series("U", times * plan.u[goals], style.BLUE),
        level("mean", len(goals), times * plan.u_mean, style.MUTED_COLOR, "RMS"),
    )

    return Chapter(
        name="goal",
        local="goal_pose",
        color=style.IDENTIFY_PHASE,
        motion=visit(plan.goal.q[goals]),
        text=(
            f"#### 4 Goal: {plan.goal.sentence}",
            "- purple over green to yellow: tool points of the goal, with growing uncertainty",
            f"- U ({factor_words(k)}): RMS {times * plan.u_mean:.3g} {letter}, "
            f"worst {times * plan.u_worst:.3g} {letter}",
            *(f"- {text}" for text in (*reach_warnings(plan), *reach_words(plan))),
        ),
        draw=partial(draw_goal, plan),
        lines=numbered(
            "goal pose", len(goals), (f"U = {times * u:.3g} {unit}" for u in plan.u[goals])
        ),
        charts=(Chart("goal", f"U [{unit}] by goal pose", curves),),
    )


def _known(u: float, times: float, unit: str) -> str:
    """The expanded uncertainty after a pose, of a standard one [m]."""
    return f"U = {times * u:.3g} {unit}" if np.isfinite(u) else "too few for a U"


def _below(key: str, values: Array, top: float, color: Color, name: str = "") -> Series:
    """A curve without what is far too large or not there."""
    shown = np.flatnonzero(values <= top)
    return Series(key, values[shown], color, name, shown)
