"""What all robots of a scenario share: the nominal arm, its simulator, pool and instrument."""

from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions, approaches
from calib.shown import Shown
from testbed.laboratory.bench import open_bench
from testbed.laboratory.sufficiency import require_poses
from testbed.laboratory.tracker.rounds import true_fixtures
from testbed.laboratory.tracker.stations import require_ranges, require_stations
from testbed.laboratory.truth.robot import TrueRobot, draw_truth
from testbed.laboratory.truth.terms import last_moves
from testbed.scenario.fixtures import rounds_per_visit
from testbed.scenario.scenario import Scenario
from testbed.streams import stream


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Setting(Shown):
    """The setup of a campaign, which all trials share: robot nominal and true, pool, test poses."""

    nominal: RobotModel
    true: RobotModel
    """The secret: geometry and joint errors of the true robot."""
    joint_repeatability: Annotated[Array, "n"]
    """(n,) sd of each joint at each approach [rad or m]."""
    pool_q: Annotated[Array, "N", "n"]
    """(N, n) feasible candidate joints [rad, m]."""
    pool_nominal: Annotated[Array, "N", 4, 4]
    """(N, 4, 4) nominal tool poses of the pool in the world [m]."""
    rejected_q: Annotated[Array, "R", "n"]
    """(R, n) a sample (at most 100 a reason) of rejected candidates [rad, m]."""
    rejected_reason: Annotated[tuple[str, ...], "R"]
    """(R,) why: one of `rejection_names`."""
    rejection_names: Annotated[tuple[str, ...], "w"]
    """(w,) reasons, in the order they are tested, from `laboratory.pool`."""
    rejection_counts: Annotated[Index, "w"]
    """(w,) candidates rejected for each reason, the first that applied."""
    n_drawn: int
    """Candidates drawn in all."""
    test_q: Annotated[Array, "t", "n"]
    """(t, n) held-out poses, never used for identification [rad, m]."""
    test_true: Annotated[Array, "t", 4, 4]
    """(t, 4, 4) noise-free true tool poses at the held-out joints [m]."""
    T_world_tracker: Annotated[Array, 4, 4]
    """(4, 4) tracker station [m]."""
    target: Annotated[Array, 3]
    """(3,) the tool point that is judged, in the tool frame: the reflector, else the origin [m]."""


def validation_start(scenario: Scenario) -> float:
    """When held-out poses are visited: after one visit of the largest trial [s]."""
    poses = max(trial.poses for trial in scenario.trial)
    return scenario.tracker.pose_s * poses * rounds_per_visit(scenario)


def held_out_poses(
    truth: TrueRobot, scenario: Scenario, q: Array, *, rng: np.random.Generator | None = None
) -> Array:
    """True poses (m, 4, 4) at q (m, n), visited in turn after the trials; without `rng` no scatter.

    In meters.
    """
    way = journey(q, validation_start(scenario), scenario.tracker.pose_s)
    return truth.poses(q, rng=rng, **way._asdict())


def make_setting(scenario: Scenario) -> Setting:
    """Draw the true robot, the feasible pool and the held-out poses of a scenario."""
    bench = open_bench(scenario)
    require_stations(bench)
    truth = draw_truth(bench.robot, scenario.truth, scenario.seed)
    candidates = bench.candidates()
    pool = candidates.draw(stream(scenario.seed, "pool"))
    require_ranges(bench, pool.q, "the pool")
    bench.check_views(pool.q)
    test = candidates.draw(stream(scenario.seed, "test"), size=scenario.test.poses, exclude=pool.q)
    setting = Setting(
        nominal=bench.robot.model,
        true=replace(truth.model, fixtures=true_fixtures(scenario, bench.robot.model.fixtures)),
        joint_repeatability=truth.joint_repeatability,
        pool_q=pool.q,
        pool_nominal=pool.T,
        rejected_q=pool.rejected_q,
        rejected_reason=pool.rejected_reason,
        rejection_names=pool.rejection_names,
        rejection_counts=pool.rejection_counts,
        n_drawn=pool.n_drawn,
        test_q=test.q,
        test_true=held_out_poses(truth, scenario, test.q),
        T_world_tracker=bench.tracker.T_world_tracker,
        target=bench.tracker.reflector,
    )
    require_poses(replace(bench, pool_q=pool.q))
    return setting


class Journey(NamedTuple):
    """How poses (m, n) are visited in turn, from joint zero on; as `TrueRobot.poses` asks."""

    time: Array
    """(m,) since the start of the campaign [s]."""
    previous: Array
    """(m, n) where each came from [rad, m]."""
    moves: Array
    """(m, n) direction of each joint's last move."""


def journey(q: Array, start: float, pose_time: float) -> Journey:
    """How poses q (m, n) are visited in turn, the first one at `start` [s]."""
    time: Array = start + pose_time * np.arange(len(q), dtype=np.float64)
    return Journey(time, np.vstack([np.zeros((1, q.shape[1])), q[:-1]])[: len(q)], last_moves(q))


def held_out_conditions(scenario: Scenario, q: Array) -> OperatingConditions:
    """What is known of held-out poses q (m, n), visited in turn: also what hangs on the arm there.

    Where payloads change, rows state them, and a model may ask for them.
    """
    said, truth = in_turn(q), scenario.truth
    if not truth.payloads_kg:
        return said
    hung, center = np.full(len(q), truth.payload_kg), np.array(truth.payload_center_mm) / 1e3
    return replace(said, payload=hung, center=np.tile(center, (len(q), 1)))


def in_turn(q: Array) -> OperatingConditions:
    """What is known of poses q (m, n) visited in turn: from which side each joint came."""
    start = np.zeros((1, q.shape[1]))
    return OperatingConditions(approach=approaches(np.vstack([start, q]))[1:])
