"""The laboratory: a bench with the secret true robot on it, which measures."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.identification.ladders import ladders_of
from calib.identification.levels import Ladder
from calib.identification.many.tables import ManyTables, known_to_many
from calib.measurement.observations import DISTANCE, Measurements, joined
from testbed.laboratory.bench import Bench, open_bench
from testbed.laboratory.tracker.rounds import Round, first_tracker, true_fixtures
from testbed.laboratory.truth.robot import TrueRobot, draw_truth, unmodelled_terms
from testbed.laboratory.truth.setting import Setting, held_out_poses, in_turn, journey
from testbed.laboratory.truth.springs import ElasticArm
from testbed.robots.catalog import load_robot
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.scenario import Scenario
from testbed.streams import stream


@dataclass(frozen=True, slots=True, eq=False)
class Laboratory(Bench):
    """A scenario's laboratory, ready to measure; its tracker has systematic errors of its own."""

    setting: Setting
    truth: TrueRobot

    @property
    def ladders(self) -> tuple[Ladder, ...]:
        """Joint errors on offer for every robot, by the robot file and not by any reading."""
        robot = self.robot
        return ladders_of(self.setting.nominal, moments=robot.moments, limits=robot.limits)

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
        after the campaign began [s]; rows say from which side joints came. Missed observations
        leave no row. Where there are rounds, the poses are visited once in each, `distances` among
        them unless they are not wanted. Where payloads change, `payload` (m,) hangs on the arm,
        else the usual one, and rows say so [kg].
        """
        loads, hung = self.truth.unmodelled.springs, None
        if loads is not None and len(loads.payloads):
            hung = np.full(len(q), loads.payload) if payload is None else payload
        # by its place: the same pose may come twice, from other sides and under other payloads
        found = self._measured(q, np.arange(len(q)), names, repeat, start, distances, hung)
        row = found.pose_id
        said = in_turn(q).rows(row)
        if loads is not None and hung is not None:
            center = np.tile(loads.payload_center, (len(found), 1))
            said = replace(said, payload=hung[row], center=center)
        return replace(found, pose_id=np.asarray(pose_id)[row], conditions=said)

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
        way = journey(q, start, self.tracker.pose_time)
        rng = stream(seed, "approach", *names, repeat)
        T = self.truth.poses(q, rng=rng, payload=payload, **way._asdict())
        return self.tracker.measure(
            T,
            q,
            pose_id=pose_id,
            repeat=repeat,
            covariance=self.covariance(q),
            rng=stream(seed, "tracker", *names, repeat),
            time=way.time,
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
        way = journey(q, start, self.tracker.pose_time)
        rng = stream(seed, "approach", *names, repeat, one.name)
        T = self.truth.poses(q, rng=rng, payload=payload, **way._asdict())
        return one.measure(
            self.truth.model.fixtures,
            T[seen],
            q[seen],
            pose_id[seen],
            repeat,
            one.covariance(self.robot.model, q[seen], self.sigma_q),
            stream(seed, "tracker", *names, repeat, one.name),
            way.time[seen],
        )

    def visits(
        self,
        q: Array,
        *names: str | int,
        count: int,
        span: float = 0.0,
        payload: Array | None = None,
    ) -> ManyTables | None:
        """What visits of poses q (count or 1, m, n) read, as `measure` makes them one by one.

        Visit k is the one with ``repeat=k`` that starts k times `span` after the campaign began
        [s]. None where arrays do not know it: several rounds, a tracker that is not `steady`, a
        nominal robot that needs what rows say beside their joints.
        """
        if self.rounds or not self.tracker.steady or not known_to_many(self.robot.model):
            return None
        seed, (_, m, n), loads = self.scenario.seed, q.shape, self.truth.unmodelled.springs
        if payload is None and loads is not None and len(loads.payloads):
            payload = np.full(m, loads.payload)

        def normal(name: str, *shape: int) -> Array:
            rngs = (stream(seed, name, *names, k) for k in range(count))
            return np.array([rng.standard_normal((m, *shape)) for rng in rngs])

        scatter, approached = None, q
        if self.truth.joint_repeatability.any():
            scatter = normal("approach", n).reshape(-1, n)
        if scatter is not None or (span and self.truth.unmodelled.thermal is not None):
            approached = np.broadcast_to(q, (count, m, n))
        ways = [journey(one, k * span, self.tracker.pose_time) for k, one in enumerate(approached)]
        time, previous, moves = (np.concatenate(each) for each in zip(*ways, strict=True))
        T = self.truth.poses(
            approached.reshape(-1, n), normal=scatter, time=time, previous=previous, moves=moves,
            payload=None if payload is None else np.tile(payload, len(approached)),
        )  # fmt: skip
        read = self.tracker.readings(T.reshape(-1, m, 4, 4), normal("tracker", 3, 3))
        covariance = self.covariance(q.reshape(-1, n)).reshape(-1, m, 6, 6)
        return ManyTables.read(q, *read, covariance)

    def pool_visits(
        self, sets: Index, *names: str | int, count: int, span: float = 0.0
    ) -> ManyTables | None:
        """The same of sets (count or 1, m) of pool poses, as `measure_pool` makes them."""
        springs, m = self.truth.unmodelled.springs, sets.shape[1]
        hung = None if springs is None else springs.in_turn(m)
        return self.visits(self.pool_q[sets], *names, count=count, span=span, payload=hung)

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

        Both are drawn from the stream under `names`, whatever the truth of the scenario; so is
        where that really lies whose place is to be found.
        """
        seed = int(stream(self.scenario.seed, *names).integers(2**62))
        drawn = draw_truth(self.robot, truth, seed)
        placed = true_fixtures(self.scenario, self.robot.model.fixtures, seed=seed)
        drawn = replace(drawn, model=replace(drawn.model, fixtures=placed))
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
