"""Robots drawn and measured: identification, validation and judging poses, each from its streams.

Robots of a kind that arrays can express are measured together over the robot axis. The others are
measured one by one: those with changing payloads, in motion, with drift, or used under other
conditions than measured.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.measurement.observations import POSE, Measurements
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.laboratory.truth.many import ManyTrueRobots
from testbed.laboratory.truth.setting import in_turn, validation_start
from testbed.streams import stream
from testbed.studies.coverage.judge import MeasuredRobot
from testbed.studies.coverage.kinds import Use, apart, drawn, in_random_order, remembering
from testbed.studies.coverage.settings import CoverageSettings

OTHERWISE = ("shift", "drifting", "loaded", "one_move")
"""Kinds that are measured or used in a special way."""


def measure_robots(
    laboratory: Laboratory, truth: str, chosen: Index, robots: Sequence[int], poses: Sequence[Array]
) -> list[MeasuredRobot]:
    """Draw and measure robots of one kind, each as by `measure_robot` to rounding.

    Parameters
    ----------
    laboratory : Laboratory
        Laboratory of the campaign; its robot is replaced.
    truth : str
        Kind of robots.
    chosen : (m,) array
        Places in the pool of the identification poses.
    robots : sequence of int
        Numbers of the robots, from 0.
    poses : sequence of (v + t, n) array
        Validation and judging poses of each robot, from `poses_of` [rad, m].
    """
    scenario = laboratory.scenario
    settings = scenario.table(CoverageSettings).truth_of(scenario, truth)
    uses = [drawn(laboratory, truth, robot, settings) for robot in robots]
    arms = ManyTrueRobots.of([use.laboratory.truth for use in uses])
    plain = uses[0].laboratory.tracker.steady and not laboratory.rounds and truth not in OTHERWISE
    if arms is None or not plain:
        each = zip(uses, robots, poses, strict=True)
        return [_measured(use, truth, chosen, robot, q) for use, robot, q in each]
    q, count = laboratory.pool_q[chosen], _count(laboratory)
    arms.require_same(uses[0].laboratory.truth, q)
    validation_q, judge_q = np.split(np.array(poses), [count], axis=1)
    names = ("coverage", "identification"), ("coverage", "validation")
    seen = _read(uses, arms, robots, q[None], chosen, names[0])
    validation = _read(uses, arms, robots, validation_q, np.arange(count), names[1])
    true = arms.poses(judge_q)[:, :, :3, 3]
    found = zip(seen, validation, judge_q, true, uses, strict=True)
    return [MeasuredRobot(a, b, at, points, use.laboratory, use) for a, b, at, points, use in found]


def _read(
    uses: Sequence[Use],
    arms: ManyTrueRobots,
    robots: Sequence[int],
    q: Array,
    pose_id: Index,
    names: tuple[str, str],
) -> Iterable[Measurements]:
    """Readings of one visit by each robot of poses q (R or 1, m, n) [rad, m]."""
    own, (_, m, n) = uses[0].laboratory, q.shape
    seed = own.scenario.seed

    def normal(name: str, *shape: int) -> Array:
        rngs = (stream(seed, name, *names, robot, 0) for robot in robots)
        return np.array([rng.standard_normal((m, *shape)) for rng in rngs])

    scatter = normal("approach", n) if arms.joint_repeatability.any() else None
    T = arms.poses(q, normal=scatter)
    position, rotation = own.tracker.readings(T, normal("tracker", 3, 3))
    covariance = own.covariance(q.reshape(-1, n)).reshape(-1, m, 6, 6)
    kind, nowhere, first = np.full(m, POSE), np.zeros((m, 3)), np.zeros(m, dtype=np.int64)
    turns = [in_turn(some) for some in q]
    for k in range(len(robots)):
        at = 0 if len(q) == 1 else k
        yield Measurements(
            q[at], position[k], rotation[k], covariance[at], kind, nowhere, pose_id, first,
            conditions=turns[at],
        )  # fmt: skip


def poses_of(laboratory: Laboratory, robot: int) -> Array:
    """Validation and judging poses (v + t, n) of robot number `robot` of every kind [rad, m]."""
    scenario = laboratory.scenario
    return (
        laboratory.candidates()
        .draw(
            stream(scenario.seed, "coverage", "poses", robot),
            size=_count(laboratory) + scenario.test.poses,
            exclude=laboratory.pool_q,
        )
        .q
    )


def _count(laboratory: Laboratory) -> int:
    """Number of validation poses of a robot."""
    return laboratory.scenario.table(CoverageSettings).validation_poses


def measure_robot(laboratory: Laboratory, truth: str, chosen: Index, robot: int) -> MeasuredRobot:
    """Draw robot number `robot` of one kind and measure it; its number is part of every stream.

    Parameters
    ----------
    laboratory : Laboratory
        Laboratory of the campaign; its robot is replaced.
    truth : str
        Kind of robot.
    chosen : (m,) array
        Places in the pool of the identification poses.
    robot : int
        Number of the robot, from 0.
    """
    use, poses = drawn(laboratory, truth, robot), poses_of(laboratory, robot)
    return _measured(use, truth, chosen, robot, poses)


def _measured(use: Use, truth: str, chosen: Index, robot: int, poses: Array) -> MeasuredRobot:
    """Measure one robot by itself; `poses` (v + t, n) from `poses_of` [rad, m]."""
    own, scenario = use.laboratory, use.laboratory.scenario
    count, judged = _count(own), scenario.test.poses
    validation_q, judge_q = np.split(poses, [count])
    if truth == "shift":
        train_q, validation_q, judge_q = apart(own, robot, (len(chosen), count, judged))
        own = own.with_poses(train_q, judge_q)
        chosen = np.arange(len(train_q))
    if truth == "drifting":
        chosen = in_random_order(own, chosen, robot)
    seen = own.measure_pool(chosen, "coverage", "identification", robot)
    start, names = validation_start(scenario), ("coverage", "validation", robot)
    validation = own.measure(validation_q, np.arange(count), *names, start=start)
    if truth == "drifting":
        seen, validation = remembering(own, (seen, validation))
    true = use.used.held_out(judge_q)
    if use.one_move:
        rng = stream(scenario.seed, "coverage", "moves", robot)
        true = use.used.truth.poses(judge_q, rng=rng)
    return MeasuredRobot(seen, validation, judge_q, true[:, :3, 3], own, use)
