"""The climb of `climb` for many robots at once, which share what depends on the poses alone."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial

import numpy as np

from calib.arrays import Array
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climb import climb
from calib.identification.climbing import (
    Answer,
    Climb,
    Climbing,
    Course,
    Question,
    climb_of,
    climbing,
)
from calib.identification.evidence.model_equations import MOST_TURNS, SETTLED
from calib.identification.folds import parts_of, some_poses
from calib.identification.levels import Ladder, Level
from calib.identification.many.climb_plan import ClimbPlan, apart, plan_of
from calib.identification.many.climb_rows import ClimbRows
from calib.identification.many.climber import Climber, Fitted, Task
from calib.identification.many.settle import settled_many
from calib.identification.many.tables import ManyTables
from calib.identification.prior import Prior
from calib.measurement.observations import Measurements

BLOCK = 12
"""Robots in one pass; the result of a robot does not depend on the others, to the bit. Of twice
as many each takes as long, and all of them 30 MB more."""
SURE = 1e-6
"""Margin of a decision, in log evidence or in standard errors of the mean error, below which
rounding could change it: such a robot climbs alone."""
FEW_PRODUCTS = 128
"""Number of spring products up to which numpy fits springs of many robots at once by normal
equations. With more products there are fewer rows than products, and each robot is fitted by its
rows, as the compiled loop always does."""


def climb_many(
    nominal: RobotModel,
    near: Sequence[RobotModel],
    tables: Sequence[Measurements],
    parameters: Parameters,
    ladders: Sequence[Ladder],
    *,
    prior: Prior,
    robots: int = 0,
) -> list[Climb]:
    """Climb with each of many robots at the same poses, with the folds that `choose` draws.

    A robot climbs by itself (`climb`) if `plan_of` cannot express its rows or models as arrays, if
    rounding could change a decision, and when the richest model, or the evidence of a level that
    the climb did not need, is asked for later.

    Parameters
    ----------
    nominal, parameters, ladders, prior
        As in `climb`, the same for all robots.
    near : sequence of RobotModel
        Each robot after a fit of its geometry.
    tables : sequence of Measurements
        Training rows of each robot.
    robots : int
        Number of robots in all, if these are only some of them; with many of them the fit of
        springs is compiled.
    """
    many = ManyTables.alike(tables)
    plan = None
    if many is not None and len(many.q) == 1:
        count = max(robots, len(tables))
        plan = plan_of(nominal, tables, parameters, tuple(ladders), prior, count)

    def alone(k: int) -> Climb:
        rng = np.random.default_rng(0)
        asked = some_poses(tables[k], rng)
        part = parts_of(asked, rng)
        return climb(nominal, near[k], asked, parameters, ladders, part, prior=prior)

    if many is None or plan is None:
        return [alone(k) for k in range(len(tables))]
    models = ManyModels.each(nominal, near)
    found = []
    for first in range(0, len(tables), BLOCK):
        some = slice(first, first + BLOCK)
        rows = ClimbRows.of(models.some(some), many.some(some), parameters.free_index)
        step = models.some(some).steps()[:, parameters.free_index]
        block = at_their_noise(robots_of(plan, rows, step - plan.mean))
        for k, (robot, course) in enumerate(zip(block, courses(block), strict=True), first):
            found.append(_climb(robot, course, near[k], parameters, k, alone))
    return found


def _climb(
    robot: Climber, course: Course, near: RobotModel, parameters: Parameters, k: int,
    alone: Callable[[int], Climb],
) -> Climb:  # fmt: skip
    """Climb of robot k from its course; by itself if rounding could have changed a decision."""
    if course.margin < SURE:
        return alone(k)
    by_itself = cache(partial(alone, k))

    def gain(level: Level) -> float:
        return next(one.gain for one in by_itself().offered if one.level == level.name)

    reached = robot.moved(course.levels, near, parameters.free_names)
    return climb_of(
        course, robot.plan.ladders, gain, robot.scale, reached, lambda: by_itself().richest()
    )


def robots_of(plan: ClimbPlan, rows: ClimbRows, offset: Array) -> list[Climber]:
    """Robots of a block, whose geometry is `offset` (R, f) from the prior mean [m, rad]."""
    metres = np.broadcast_to(rows.metres, (len(offset), *rows.metres.shape[1:]))
    parts = zip(rows.geometry, rows.bends, rows.r, offset, metres, strict=True)
    return [Climber(plan, *each) for each in parts]


def at_their_noise(robots: Sequence[Climber]) -> list[Climber]:
    """Robots with rows in units of the noise that their richest model leaves."""
    found, turning = list(robots), list(range(len(robots)))
    richest = tuple(ladder.levels[-1] for ladder in robots[0].plan.ladders)
    for _ in range(MOST_TURNS):
        new = [found[k].noise(richest) for k in turning]
        still = []
        for k, scale in zip(turning, new, strict=True):
            if abs(scale / found[k].scale - 1) >= SETTLED:
                still.append(k)
            if scale != found[k].scale:
                found[k] = found[k].at_noise(scale)
        turning = still
        if not turning:
            break
    return found


def courses(robots: Sequence[Climber]) -> list[Course]:
    """Course of each robot; what several robots ask for in one round is computed together."""
    walks: list[Climbing] = [climbing(robot.plan.ladders) for robot in robots]
    asked: dict[int, Question] = {k: next(walk) for k, walk in enumerate(walks)}
    ended: dict[int, Course] = {}
    while asked:
        fit_all(
            task
            for k, question in asked.items()
            for levels in question.models
            for task in robots[k].tasks(levels, question.left_out)
        )
        after: dict[int, Question] = {}
        for k, question in asked.items():
            try:
                after[k] = walks[k].send(_answer(robots[k], question))
            except StopIteration as end:
                ended[k] = end.value
        asked = after
    return [ended[k] for k in range(len(robots))]


def _answer(robot: Climber, question: Question) -> Answer:
    if question.left_out:
        return robot.missed(question.models[0])
    return [robot.evidence(levels) for levels in question.models]


def fit_all(tasks: Iterable[Task]) -> None:
    """Fit springs of many models, those with the same few products together in numpy."""
    few: dict[Level, list[Task]] = defaultdict(list)
    for task in tasks:
        robot, ground, levels, k = task
        sprung = apart(robot.plan, levels)[1]
        assert sprung is not None
        springs = robot.plan.springs[sprung][0]
        if robot.plan.loop is None and len(springs.columns) <= FEW_PRODUCTS:
            few[sprung].append(task)
            continue
        rows = robot.sprung(sprung)
        one = rows.settled(ground.rows, loop=robot.plan.loop)
        robot.fits[levels, k] = Fitted(one.numbers, one.loss, one.spread)
    for sprung, alike in few.items():
        springs = alike[0][0].plan.springs[sprung][0]
        systems = [robot.normal(sprung, levels, ground) for robot, ground, levels, _ in alike]
        normal, pull = (np.array(part) for part in zip(*systems, strict=True))
        found = settled_many(springs, normal, pull)
        for (robot, _, levels, k), x, loss, spread in zip(alike, *found, strict=True):
            robot.fits[levels, k] = Fitted(x, float(loss), float(spread))
