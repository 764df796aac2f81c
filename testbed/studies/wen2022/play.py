"""The protocol of Wen et al. 2022 on many robots: its uncertainties, and the true errors.

Robot k of every kind has the same random numbers, pool and noise. Both estimators fit the paper's
24 numbers. Like `compare`, this module uses the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.design import random_selection
from calib.identification.identify import Identification
from calib.measurement.accuracy import point_distances
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predicted_positions
from calib.uncertainty.type_a import root_sum_square, type_a
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.many_robots import alone, together, truth_of_kind
from testbed.studies.trial.compare import true_step
from testbed.studies.wen2022.budget import fitted, location_sets, steps_of
from testbed.studies.wen2022.records import ESTIMATORS, PoolSets, Reexamined, TrialSets, environment
from testbed.studies.wen2022.stated import held_by_covariance, held_by_type_a


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """One robot in the laboratory with its pool, and the truth that judges."""

    robot: int
    """Number of the robot, from 0."""
    laboratory: Laboratory
    true: Array
    """(t, 3) true, noise-free tool points at the held-out poses [m]."""

    def measure(self, chosen: Index, name: str, repeat: int = 0) -> Measurements:
        """Visit pool poses (m,) once; repeats follow each other in time."""
        span = len(chosen) * self.laboratory.tracker.pose_time
        names = ("reexamined", name, self.robot)
        return self.laboratory.measure_pool(chosen, *names, repeat=repeat, start=repeat * span)

    def steps(self, sets: list[Index], name: str) -> Array:
        """Estimates (k, f) of the paper's estimator from one visit of each set [m, rad]."""
        names, own = ("reexamined", name, self.robot), self.laboratory
        return steps_of(own, sets, *names, pose_time=own.tracker.pose_time)

    def random(self, size: int, name: str) -> Index:
        """A random set (m,) drawn for this robot."""
        rng = stream(self.laboratory.scenario.seed, "reexamined", "set", name, self.robot)
        N = len(self.laboratory.setting.pool_q)
        return random_selection(N, min(size, N), rng)

    def error(self, found: Identification) -> Array:
        """Held-out position errors (t,) against the truth [m]."""
        q = self.laboratory.setting.test_q
        return point_distances(self.true, found.model.poses(q)[:, :3, 3])


OF_A_TRIAL = (
    *("own_before", "own_after", "error"),
    *("u_best", "inside", "numbers_inside", "distance_u"),
)
"""Figures of a trial on a robot; the last four only for sets chosen as in the paper."""
AXES = dict.fromkeys(("pool", "before", *OF_A_TRIAL), -1) | {
    "u_best": 1,
    "u_r": 0,
    "u_p": 0,
    "u_w": 0,
}


def play_robots(
    scenario: Scenario, setting: Setting, truth: str, pools: PoolSets, robots: range
) -> Reexamined:
    """Play the paper's protocol on some robots of one kind.

    References
    ----------
    Wen et al. 2022, eqs. (7) to (9), Tables 1 to 3.
    """
    laboratory = open_laboratory(scenario, setting)
    return gather([play_robot(laboratory, truth, pools, k) for k in robots])


def gather(parts: Sequence[Reexamined]) -> Reexamined:
    """The robots of all parts."""
    return together(parts, AXES)


def play_robot(laboratory: Laboratory, truth: str, pools: PoolSets, robot: int) -> Reexamined:
    """Play the paper's protocol on one robot."""
    scenario = laboratory.scenario
    visit = visit_robot(laboratory, truth, pools, robot)
    named = {trial.name for trial in scenario.trial}
    trials = [one for one in pools.sets if one.trial in named]
    pool = robot % len(pools.pool_q)
    played = [play(visit, one, pool) for one in trials]
    nominal = laboratory.setting.nominal.poses(visit.laboratory.setting.test_q)[:, :3, 3]
    u_r, u_p, u_w = random_parts(visit, scenario.uncertainty.repeats)
    return Reexamined(
        truth=truth,
        trials=tuple(trial.trial for trial in trials),
        best=tuple(trial.trial for trial in trials if trial.by_paper),
        **alone(
            AXES,
            pool=pool,
            before=point_distances(visit.true, nominal).mean(),
            u_r=u_r,
            u_p=u_p,
            u_w=u_w,
            **{name: [one[name] for one in played if name in one] for name in OF_A_TRIAL},
        ),
    )


def visit_robot(laboratory: Laboratory, truth: str, pools: PoolSets, robot: int) -> Visit:
    """Draw robot number `robot` of one kind, with its pool."""
    kind, p = truth_of_kind(laboratory.scenario, truth), robot % len(pools.pool_q)
    own = laboratory.with_poses(pools.pool_q[p], pools.test_q[p])
    own = own.with_robot(kind, "reexamined", "robot", robot)
    return Visit(robot, own, own.held_out(pools.test_q[p])[:, :3, 3])


def play(visit: Visit, trial: TrialSets, pool: int) -> dict[str, Any]:
    """Calibrate once with each estimator; for the paper's sets also repeat and judge statements.

    Keys are the fields of `Reexamined`.
    """
    chosen = trial.indices[pool] if trial.designed else visit.random(trial.poses, trial.trial)
    seen = visit.measure(chosen, trial.trial)
    fits = tuple(fitted(visit.laboratory, seen, mode) for mode in ESTIMATORS)
    nominal = visit.laboratory.setting.nominal
    own = [
        float(point_distances(seen.position, predicted_positions(model, seen)).mean())
        for model in (nominal, fits[0].model)
    ]
    error = [float(visit.error(found).mean()) for found in fits]
    figures: dict[str, Any] = {"own_before": own[0], "own_after": own[1], "error": error}
    if not trial.by_paper:
        return figures
    repeats = visit.laboratory.scenario.uncertainty.repeats
    u = type_a(visit.steps([chosen] * repeats, trial.trial)).standard
    off = np.abs(fits[0].step - true_step(visit.laboratory.setting, fits[1], seen))
    combined = root_sum_square(u, environment(visit.laboratory.scenario.budget, fits[0].names))
    shares, factor = held(visit, fits, combined, repeats)
    numbers_inside = float((off <= factor * combined).mean())
    return figures | {"u_best": u, "numbers_inside": numbers_inside} | shares


def held(
    visit: Visit, fits: tuple[Identification, ...], u: Array, count: int
) -> tuple[dict[str, Any], float]:
    """Share of held-out points inside each of `STATEMENTS` (4,), the mean stated u of |P|; and t.

    The first two are of type A, from standard uncertainties u (f,) of `count` repeats, the numbers
    taken as independent.
    """
    setting, true = visit.laboratory.setting, visit.true
    origin = setting.nominal.chain.T_world_base[:3, 3]
    q = setting.test_q
    by_type_a, u_distance, t = held_by_type_a(fits[0], u, count, q, true, origin)
    shares = (*by_type_a, *(held_by_covariance(fit, q, true) for fit in fits))
    inside_each = tuple(float(np.mean(share)) for share in shares)
    return {"inside": inside_each, "distance_u": float(u_distance.mean())}, t


def random_parts(visit: Visit, repeats: int) -> tuple[Array, Array, Array]:
    """u_r, u_p, u_w (f,) of the random side, paper estimator [m or rad]."""
    scenario, budget = visit.laboratory.scenario, visit.laboratory.scenario.budget
    one = visit.random(budget.poses, "u_r")
    sized = [visit.random(size, f"u_p {size}") for size in budget.pose_numbers]
    rng = stream(scenario.seed, "reexamined", "set", "u_w", visit.robot)
    local = location_sets(visit.laboratory.setting, budget, rng)
    u_r, u_p, u_w = (
        type_a(visit.steps(sets, name)).standard
        for sets, name in (([one] * repeats, "u_r"), (sized, "u_p"), (local, "u_w"))
    )
    return u_r, u_p, u_w
