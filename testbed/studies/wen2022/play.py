"""The protocol of Wen et al. 2022 on many robots: its uncertainties, and the errors they miss.

Robot k of every kind is drawn from the same random numbers, meets the same pool and the same noise.
Both estimators move the paper's 24 numbers. Like `comparison`, this module judges by the truth.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.design import random_selection
from calib.errors import InputError
from calib.identification.identify import Identification, Mode, identify
from calib.information.propagation import distance_uncertainty, tool_covariance
from calib.measurement.accuracy import distances, observed_points
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import inside
from calib.uncertainty.type_a import type_a
from calib.uncertainty.wen2022_budget import LOCATION_POSES, POSE_NUMBERS, location_regions
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.laboratory.truth.robot import draw_truth
from testbed.scenario.read import Scenario
from testbed.streams import stream
from testbed.studies.many_robots import TruthName, truth_of_kind
from testbed.studies.trial.compare import INTERVAL, true_step
from testbed.studies.wen2022.one_robot import RANDOM_BUDGET_POSES
from testbed.studies.wen2022.records import ESTIMATORS, PoolSets, Reexamined, TrialSets
from testbed.studies.wen2022.settings import SETS_KEY


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """One robot in the laboratory with its pool, and the secret that judges."""

    robot: int
    """From 0."""
    bench: Laboratory
    true: Array
    """(t, 3) the secret: noise-free tool points at the held-out poses [m]."""

    def measure(self, chosen: Index, name: str, repeat: int = 0) -> Measurements:
        """Visit pool poses (m,) once; repeats follow each other in time."""
        span = len(chosen) * self.bench.tracker.pose_time
        names = ("reexamined", name, self.robot)
        return self.bench.measure_pool(chosen, *names, repeat=repeat, start=repeat * span)

    def fitted(self, seen: Measurements, mode: Mode = "paper") -> Identification:
        """The paper's numbers from one table."""
        return identify(self.bench.setting.nominal, seen, self.bench.free("paper"), mode=mode)

    def steps(self, sets: list[Index], name: str) -> Array:
        """Estimates (k, f) of the paper's estimator from one visit of each set [m, rad]."""
        seen = (self.measure(chosen, name, repeat=k) for k, chosen in enumerate(sets))
        return np.array([self.fitted(table).step for table in seen])

    def random(self, size: int, name: str) -> Index:
        """A random set (m,) of this robot's own."""
        rng = stream(self.bench.scenario.seed, "reexamined", "set", name, self.robot)
        N = len(self.bench.setting.pool_q)
        return random_selection(N, min(size, N), rng)

    def error(self, found: Identification) -> Array:
        """Held-out position errors (t,) against the truth [m]."""
        q = self.bench.setting.test_q
        return distances(self.true, found.model.poses(q)[:, :3, 3])


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """One trial on one robot."""

    own_before: float
    own_after: float
    error: tuple[float, ...]
    """(2,) per estimator."""
    u_best: Array
    """(f,) from repeats; (0,) for other sets than the paper's."""
    inside: tuple[float, ...]
    """(4,) per statement; nothing for other sets."""
    numbers_inside: float
    distance_u: float


def reexamined_study(
    scenario: Scenario, setting: Setting, truth: TruthName, get: Callable[[str], Any]
) -> Reexamined:
    """Play the paper's protocol on `reexamined.robots` robots of one kind.

    References
    ----------
    Wen et al. 2022, eqs. (7) to (9), Tables 1 to 3.
    """
    pools: PoolSets = get(SETS_KEY)
    bench, count = open_laboratory(scenario, setting), scenario.reexamined.robots
    trials = [one for one in pools.sets if one.trial in {t.name for t in scenario.trial}]
    best = [i for i, one in enumerate(trials) if one.by_paper]
    played: list[list[Played]] = []
    before: list[float] = []
    u_r: list[Array] = []
    u_p: list[Array] = []
    u_w: list[Array] = []
    pool = np.arange(count) % len(pools.pool_q)
    for k in range(count):
        visit = visit_robot(bench, truth, pools, k)
        played.append([play(visit, one, int(pool[k])) for one in trials])
        nominal = setting.nominal.poses(visit.bench.setting.test_q)[:, :3, 3]
        before.append(float(distances(visit.true, nominal).mean()))
        parts = random_parts(visit, scenario.uncertainty.repeats)
        for into, part in zip((u_r, u_p, u_w), parts, strict=True):
            into.append(part)

    def per_trial(name: str, rows: list[int] | range) -> Array:
        """One figure of every robot, robots last."""
        found = np.array([[getattr(row[i], name) for i in rows] for row in played])
        return np.moveaxis(found, 0, -1)

    everyone = range(len(trials))
    return Reexamined(
        truth=truth,
        trials=tuple(one.trial for one in trials),
        best=tuple(trials[i].trial for i in best),
        pool=pool,
        before=np.array(before),
        own_before=per_trial("own_before", everyone),
        own_after=per_trial("own_after", everyone),
        error=per_trial("error", everyone),
        u_best=np.swapaxes(per_trial("u_best", best), 1, 2),
        u_r=np.array(u_r),
        u_p=np.array(u_p),
        u_w=np.array(u_w),
        inside=per_trial("inside", best),
        numbers_inside=per_trial("numbers_inside", best),
        distance_u=per_trial("distance_u", best),
    )


def visit_robot(bench: Laboratory, truth: TruthName, pools: PoolSets, robot: int) -> Visit:
    """Draw robot number `robot` of one kind, and give it its pool."""
    scenario, p = bench.scenario, robot % len(pools.pool_q)
    seed = int(stream(scenario.seed, "reexamined", "robot", robot).integers(2**62))
    drawn = draw_truth(bench.robot, truth_of_kind(scenario, truth), seed)
    own = bench.with_poses(pools.pool_q[p], pools.test_q[p]).with_robot(drawn, seed)
    return Visit(robot, own, own.held_out(pools.test_q[p])[:, :3, 3])


def play(visit: Visit, trial: TrialSets, pool: int) -> Played:
    """Calibrate once with each estimator; on the paper's sets repeat, and judge what is stated."""
    chosen = trial.indices[pool] if trial.designed else visit.random(trial.poses, trial.trial)
    seen = visit.measure(chosen, trial.trial)
    fits = tuple(visit.fitted(seen, mode) for mode in MODES)
    nominal = visit.bench.setting.nominal
    own = [
        float(distances(seen.position, observed_points(model, seen)).mean())
        for model in (nominal, fits[0].model)
    ]
    error = tuple(float(visit.error(found).mean()) for found in fits)
    if not trial.by_paper:
        return Played(own[0], own[1], error, np.zeros(0), (), 0.0, 0.0)
    repeats = visit.bench.scenario.uncertainty.repeats
    others = [visit.measure(chosen, trial.trial, repeat=k) for k in range(1, repeats)]
    steps = np.array([fits[0].step, *(visit.fitted(table).step for table in others)])
    u = type_a(steps).standard
    shares, distance_u = held(visit, fits, u)
    off = np.abs(fits[0].step - true_step(visit.bench.setting, fits[1], seen))
    return Played(own[0], own[1], error, u, shares, float((off <= INTERVAL * u).mean()), distance_u)


FEWEST_LOCAL = 10
"""Poses in a region below which its calibration says more of their choice than of the place."""
MODES: tuple[Mode, ...] = ("paper", "whitened")
assert MODES == ESTIMATORS, "the records name the estimators in this order"


def held(
    visit: Visit, fits: tuple[Identification, ...], u: Array
) -> tuple[tuple[float, ...], float]:
    """Share of held-out points inside each of `STATEMENTS` (4,), and the mean stated u of |P|.

    The first three are made from standard uncertainties u (f,) of independent numbers, as in the
    paper; propagation is linear, which claim 17 shows to be enough.
    """
    q, nominal, found = visit.bench.setting.test_q, visit.bench.setting.nominal, fits[0]
    full = np.zeros((nominal.n_numbers, nominal.n_numbers))
    place = found.parameters.free_index
    full[place, place] = u**2
    sigma = tool_covariance(found.model, q, full)[:, :3, :3]
    origin = nominal.chain.T_world_base[:3, 3]
    point = found.model.poses(q)[:, :3, 3]
    u_distance = distance_uncertainty(sigma, point - origin)
    error = visit.true - point
    radial = np.linalg.norm(visit.true - origin, axis=1) - np.linalg.norm(point - origin, axis=1)
    other = fits[1]
    own = tool_covariance(other.model, q, other.full_covariance)[:, :3, :3]
    wrong = visit.true - other.model.poses(q)[:, :3, 3]
    shares = (
        np.abs(radial) <= INTERVAL * u_distance,
        np.linalg.norm(error, axis=1) <= INTERVAL * u_distance,
        inside(error, sigma),
        inside(wrong, own),
    )
    return tuple(float(np.mean(share)) for share in shares), float(u_distance.mean())


def random_parts(visit: Visit, repeats: int) -> tuple[Array, Array, Array]:
    """u_r, u_p, u_w (f,) of the random side, paper estimator [m or rad]."""
    setting, seed = visit.bench.setting, visit.bench.scenario.seed
    one = visit.random(RANDOM_BUDGET_POSES, "u_r")
    sized = [visit.random(size, f"u_p {size}") for size in POSE_NUMBERS]
    regions = location_regions(setting.pool_nominal[:, :3, 3])
    rng = stream(seed, "reexamined", "set", "u_w", visit.robot)
    local = []
    for region in range(4):
        members = np.flatnonzero(regions == region)
        if len(members) < FEWEST_LOCAL:
            raise InputError(
                f"region {region + 1} of the pool has {len(members)} poses, too few to calibrate "
                "there and see how the place matters",
                code="M27",
                field="pool.box_size_mm",
                value=len(members),
                fix="enlarge [pool] size, or let the box reach over x = 250 mm and y = 0",
            )
        local.append(rng.choice(members, min(LOCATION_POSES, len(members)), replace=False))
    u_r, u_p, u_w = (
        type_a(visit.steps(sets, name)).standard
        for sets, name in (([one] * repeats, "u_r"), (sized, "u_p"), (local, "u_w"))
    )
    return u_r, u_p, u_w
