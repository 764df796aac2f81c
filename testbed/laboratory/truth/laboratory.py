"""The laboratory: a bench with the secret true robot on it, which measures."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.measurement.observations import DISTANCE, Measurements, joined
from testbed.laboratory.bench import Bench, open_bench
from testbed.laboratory.tracker.rounds import Round, first_tracker, true_fixtures
from testbed.laboratory.tracker.stations import require_ranges, require_stations
from testbed.laboratory.truth.robot import TrueRobot, draw_truth, unmodelled_terms
from testbed.laboratory.truth.springs import ElasticArm
from testbed.robots.catalog import load_robot
from testbed.scenario.fixtures import rounds_per_visit
from testbed.scenario.laboratory import At960Tracker, TruthSettings
from testbed.scenario.scenario import Scenario
from testbed.streams import stream


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
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


@dataclass(frozen=True, slots=True, eq=False)
class Laboratory(Bench):
    """A scenario's laboratory, ready to measure; its tracker has systematic errors of its own."""

    setting: Setting
    truth: TrueRobot

    def measure(
        self,
        q: Array,
        pose_id: Index,
        *names: str | int,
        repeat: int = 0,
        start: float = 0.0,
        distances: bool = True,
        payload: Array | None = None,
    ) -> Measurements:
        """Approach and measure poses q (m, n) once; random numbers from streams under `names`.

        The poses are visited in the order given, from joint zero on, the first one at `start`
        after the campaign began [s]. Missed observations leave no row. Where there are rounds, the
        poses are visited once in each, `distances` among them unless they are not wanted. Where
        payloads change, `payload` (m,) hangs on the arm, else the usual one, and rows say so [kg].
        """
        loads = self.truth.unmodelled.springs
        if loads is None or not len(loads.payloads):
            return self._measured(q, pose_id, names, repeat, start, distances, None)
        hung = np.full(len(q), loads.payload) if payload is None else payload
        found = self._measured(q, pose_id, names, repeat, start, distances, hung)
        order = np.argsort(pose_id)
        said = hung[order[np.searchsorted(pose_id, found.pose_id, sorter=order)]]
        center = np.tile(loads.payload_center, (len(found), 1))
        return replace(found, conditions=OperatingConditions(payload=said, center=center))

    def _measured(
        self,
        q: Array,
        pose_id: Index,
        names: tuple[str | int, ...],
        repeat: int,
        start: float,
        distances: bool,
        payload: Array | None,
    ) -> Measurements:
        """What `measure` sees, with what hangs on the arm (m,) instead of the usual [kg]."""
        if self.rounds:
            kept = [k for k, one in enumerate(self.rounds) if distances or one.kind != DISTANCE]
            seen, span = self.visible(q), self.tracker.pose_time * len(q)
            return joined(
                [
                    self._in_round(
                        self.rounds[k],
                        q,
                        pose_id,
                        seen[:, k],
                        names,
                        repeat,
                        start + i * span,
                        payload,
                    )
                    for i, k in enumerate(kept)
                ]
            )
        seed = self.scenario.seed
        time, previous = journey(q, start, self.tracker.pose_time)
        T = self.truth.poses(
            q,
            rng=stream(seed, "approach", *names, repeat),
            time=time,
            previous=previous,
            payload=payload,
        )
        return self.tracker.measure(
            T,
            q,
            pose_id=pose_id,
            repeat=repeat,
            covariance=self.covariance(q),
            rng=stream(seed, "tracker", *names, repeat),
            time=time,
        )

    def _in_round(
        self,
        one: Round,
        q: Array,
        pose_id: Index,
        seen: Bool,
        names: tuple[str | int, ...],
        repeat: int,
        start: float,
        payload: Array | None,
    ) -> Measurements:
        """One run of the program through poses q (m, n): the rows of those `seen` (m,)."""
        seed = self.scenario.seed
        time, previous = journey(q, start, self.tracker.pose_time)
        rng = stream(seed, "approach", *names, repeat, one.name)
        T = self.truth.poses(q, rng=rng, time=time, previous=previous, payload=payload)
        return one.measure(
            self.truth.model.fixtures,
            T[seen],
            q[seen],
            pose_id[seen],
            repeat,
            one.covariance(self.robot.model, q[seen], self.sigma_q),
            stream(seed, "tracker", *names, repeat, one.name),
            time[seen],
        )

    def measure_pool(
        self, indices: Index, *names: str | int, repeat: int = 0, start: float = 0.0
    ) -> Measurements:
        """Measure pool poses by index (m,), with what hangs on the arm in turn."""
        springs = self.truth.unmodelled.springs
        return self.measure(
            self.pool_q[indices],
            indices,
            *names,
            repeat=repeat,
            start=start,
            payload=None if springs is None else springs.in_turn(len(indices)),
        )

    def held_out(self, q: Array, *, rng: np.random.Generator | None = None) -> Array:
        """True poses (m, 4, 4) at held-out joints q (m, n) [m]; single moves end there with `rng`.

        Without it they have no scatter.
        """
        return held_out_poses(self.truth, self.scenario, q, rng=rng)

    def with_poses(self, pool_q: Array, test_q: Array) -> Self:
        """The same laboratory with other candidates (N, n) and held-out poses (t, n)."""
        nominal = self.setting.nominal.poses(pool_q)
        setting = replace(self.setting, pool_q=pool_q, pool_nominal=nominal, test_q=test_q)
        return replace(self, pool_q=pool_q, setting=setting)

    def with_robot(self, truth: TruthSettings, *names: str | int) -> Self:
        """The same laboratory with another robot, and a station with systematic errors of its own.

        Both are drawn from the stream under `names`, whatever the truth of the scenario.
        """
        seed = int(stream(self.scenario.seed, *names).integers(2**62))
        drawn = draw_truth(self.robot, truth, seed)
        sigma_q = drawn.joint_repeatability
        return replace(
            self,
            truth=drawn,
            sigma_q=sigma_q,
            setting=replace(self.setting, true=drawn.model, joint_repeatability=sigma_q),
            tracker=first_tracker(self.scenario, self.robot.model.chain, seed=seed),
        )


def open_laboratory(scenario: Scenario, setting: Setting) -> Laboratory:
    """Set up the laboratory around a campaign's setup, as it was drawn."""
    bench = open_bench(scenario)
    robot = bench.robot
    return Laboratory(
        scenario,
        robot,
        first_tracker(scenario, robot.model.chain, seed=scenario.seed),
        bench.cell,
        bench.simulator,
        bench.touching,
        setting.joint_repeatability,
        setting.pool_q,
        bench.rounds,
        setting,
        TrueRobot(
            setting.true, setting.joint_repeatability, unmodelled_terms(robot, scenario.truth)
        ),
    )


def resting_arm(scenario: Scenario, setting: Setting) -> ElasticArm | None:
    """The true arm of a campaign at rest on its springs; None where nothing gives way."""
    if not scenario.truth.drive_nm_per_mrad:
        return None
    springs = unmodelled_terms(load_robot(scenario.robot), scenario.truth).springs
    assert springs is not None
    return ElasticArm(setting.true.chain, springs)


def journey(q: Array, start: float, pose_time: float) -> tuple[Array, Array]:
    """Times (m,) at which poses q (m, n) are visited in turn [s], and where each came from."""
    time: Array = start + pose_time * np.arange(len(q), dtype=np.float64)
    return time, np.vstack([np.zeros((1, q.shape[1])), q[:-1]])[: len(q)]


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
    time, previous = journey(q, validation_start(scenario), scenario.tracker.pose_s)
    return truth.poses(q, rng=rng, time=time, previous=previous)


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


def require_poses(bench: Bench) -> None:
    """Refuse a trial with too few poses before anything is played: M27, and how many it needs."""
    rows = bench.equations
    most = max(
        bench.kept().n_free if mode == "whitened" else bench.free(mode).n_free
        for mode in bench.scenario.identification.estimators
    )
    tracker = bench.scenario.tracker
    missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
    if bench.scenario.uncertainty.replications:
        missed *= 2  # they visit what was measured, and miss some again
    for trial in bench.scenario.trial:
        if rows * (trial.poses - missed) <= most:
            has = f"{rows * max(trial.poses - missed, 0)} equations for {most} parameters"
            message = f'[[trial]] "{trial.name}" poses is {trial.poses}: {has}'
            fix = f"write poses = {most // rows + 1 + missed} or more"
            raise refuse("trial.poses", trial.poses, code="M27", message=message, fix=fix)
