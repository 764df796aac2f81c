"""The bench of a campaign: the robot, its secret true twin, the tracker, the pool; a visit."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.design.blocks import paper_blocks, scaled_blocks
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import Mode
from calib.information.reduction import reduce
from calib.measurement.observations import Measurements
from testbed.laboratory.cell import cell_from
from testbed.laboratory.pool import Pool, draw_pool
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.station import station_rows
from testbed.laboratory.tracker.tracker import Tracker, tracker_from
from testbed.laboratory.truth.robot import TrueRobot, beyond, draw_truth
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.read import PAPER_SET, At960Tracker, Scenario
from testbed.streams import stream

PROBED_POSES = 200
"""Pool poses from which identifiability is judged before anything is selected."""


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What all trials of a campaign share: the robot nominal and true, the pool, the test poses."""

    nominal: RobotModel
    true: RobotModel
    """The secret: geometry and joint errors of the true robot."""
    joint_repeatability: Array
    """(n,) sd of each joint at each approach [rad or m]."""
    pool_q: Array
    """(N, n) feasible candidate joints [rad, m]."""
    pool_nominal: Array
    """(N, 4, 4) nominal tool poses of the pool in the world [m]."""
    rejected_q: Array
    """(R, n) a sample (at most 100 a reason) of rejected candidates [rad, m]."""
    rejected_reason: tuple[str, ...]
    """(R,) why: one of `rejection_names`."""
    rejection_names: tuple[str, ...]
    """Reasons, in the order they are tested, from `laboratory.pool`."""
    rejection_counts: Index
    """Candidates rejected for each reason, the first that applied."""
    n_drawn: int
    """Candidates drawn in all."""
    test_q: Array
    """(t, n) held-out poses, never used for identification [rad, m]."""
    test_true: Array
    """(t, 4, 4) noise-free true tool poses at the held-out joints [m]."""
    T_world_tracker: Array
    """(4, 4) tracker station [m]."""
    target: Array
    """(3,) the tool point that is judged, in the tool frame: the reflector, else the origin [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """A scenario's laboratory, ready to measure."""

    scenario: Scenario
    setting: Setting
    robot: Robot
    truth: TrueRobot
    tracker: Tracker

    def covariance(self, q: Array) -> Array:
        """Stated covariance (m, 6, 6) of one visit of each pose, from nominal poses [m, rad]."""
        return self.tracker.covariance(self.setting.nominal, q, self.setting.joint_repeatability)

    def measure(
        self,
        q: Array,
        pose_id: Index,
        *names: str | int,
        repeat: int = 0,
        start: float = 0.0,
    ) -> Measurements:
        """Approach and measure poses q (m, n) once; random numbers from streams under `names`.

        The poses are visited in the order given, from joint zero on, the first one at `start`
        after the campaign began [s]. Missed shots leave no row.
        """
        seed = self.scenario.seed
        time, previous = journey(q, start, self.tracker.pose_time)
        T = self.truth.poses(
            q, rng=stream(seed, "approach", *names, repeat), time=time, previous=previous
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

    def measure_pool(
        self, indices: Index, *names: str | int, repeat: int = 0, start: float = 0.0
    ) -> Measurements:
        """Measure pool poses by index (m,)."""
        return self.measure(
            self.setting.pool_q[indices], indices, *names, repeat=repeat, start=start
        )

    def held_out(self, q: Array) -> Array:
        """True poses (m, 4, 4) without scatter at held-out joints q (m, n) [m]."""
        return held_out_poses(self.truth, self.scenario, q)

    def whitened_rows(self, q: Array) -> Array:
        """Whitened Jacobian blocks (m, r, P) of poses not measured yet, all P columns."""
        return station_rows(self.robot, self.tracker, q, self.setting.joint_repeatability)

    def free(self, mode: Mode) -> Parameters:
        """Parameters that an estimator may move, before reduction."""
        return free_parameters(self.scenario, self.robot, mode)

    def kept(self) -> Parameters:
        """Free numbers of the default estimator that generic poses of the pool can tell apart."""
        parameters = self.free("whitened")
        q = self.setting.pool_q[:PROBED_POSES]
        A = self.whitened_rows(q)[:, :, parameters.free] * parameters.free_scale
        found = reduce(
            A.reshape(-1, parameters.n_free), parameters, model=self.setting.nominal, q=q
        )
        return parameters.freeing(found.kept)

    def design_blocks(self, rows: str) -> Array:
        """Blocks (N, r, p) of the whole pool in which an index is computed.

        `rows` is "whitened" (whitened rows, columns scaled to 1 m and 1/L rad) or "paper" (twelve
        unweighted rows, mm and rad, in their six-row equivalent).
        """
        if rows == "whitened":
            return scaled_blocks(self.whitened_rows(self.setting.pool_q), self.kept())
        free = self.free("paper") if PAPER_SET in self.robot.free_sets else self.kept()
        return paper_blocks(self.setting.nominal, free, self.setting.pool_q)


def open_bench(scenario: Scenario, setting: Setting) -> Bench:
    """Set up the laboratory around a setting."""
    robot = load_robot(scenario.robot)
    truth = TrueRobot(setting.true, setting.joint_repeatability, beyond(robot, scenario.truth))
    tracker = tracker_from(scenario.tracker, robot.model.chain, seed=scenario.seed)
    return Bench(scenario, setting, robot, truth, tracker)


def journey(q: Array, start: float, pose_time: float) -> tuple[Array, Array]:
    """Times (m,) at which poses q (m, n) are visited in turn [s], and where each came from."""
    time: Array = start + pose_time * np.arange(len(q), dtype=np.float64)
    return time, np.vstack([np.zeros((1, q.shape[1])), q[:-1]])[: len(q)]


def validation_start(scenario: Scenario) -> float:
    """When held-out poses are visited: after one visit of the largest trial [s]."""
    return scenario.tracker.pose_s * max(trial.poses for trial in scenario.trial)


def held_out_poses(truth: TrueRobot, scenario: Scenario, q: Array) -> Array:
    """True poses (m, 4, 4) without scatter at q (m, n), visited in turn after the trials [m]."""
    time, previous = journey(q, validation_start(scenario), scenario.tracker.pose_s)
    return truth.poses(q, time=time, previous=previous)


def free_parameters(scenario: Scenario, robot: Robot, mode: Mode) -> Parameters:
    """Parameters that the estimator `mode` may move.

    The paper's estimator always identifies the robot's set ``wen2022`` with base and tool fixed.
    """
    table = parameters_of(robot.model)
    if mode == "paper":
        return table.freeing(robot.free_sets[PAPER_SET])
    wanted = scenario.identification.free
    if isinstance(wanted, str):
        names = table.names if wanted == "identifiable" else robot.free_sets[wanted]
    else:
        names = wanted
    fixed = tuple(
        f"{frame}."
        for frame, state in (
            ("base", scenario.identification.base),
            ("tool", scenario.identification.tool),
        )
        if state == "fixed"
    )
    return table.freeing(name for name in names if not name.startswith(fixed or ("\0",)))


def make_setting(scenario: Scenario) -> Setting:
    """Draw the true robot, the feasible pool and the held-out poses of a scenario."""
    robot = load_robot(scenario.robot)
    truth = draw_truth(robot, scenario.truth, scenario.seed)
    chain = robot.model.chain
    tracker = tracker_from(scenario.tracker, chain)
    nominal = Simulator(robot, chain, cell_from(scenario.cell, chain))

    def feasible(name: str, size: int, exclude: Array | None = None) -> Pool:
        return draw_pool(
            robot,
            nominal,
            scenario.pool,
            tracker.station,
            stream(scenario.seed, name),
            size=size,
            aim=tracker.aim(chain),
            acceptance=tracker.acceptance,
            exclude=exclude,
        )

    pool = feasible("pool", scenario.pool.size)
    test = feasible("test", scenario.test.poses, pool.q)
    setting = Setting(
        nominal=robot.model,
        true=truth.model,
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
        T_world_tracker=tracker.T_world_tracker,
        target=tracker.reflector,
    )
    require_poses(open_bench(scenario, setting))
    return setting


def require_poses(bench: Bench) -> None:
    """Refuse a trial with too few poses before anything is played: M27, and how many it needs."""
    rows = 6 if bench.scenario.tracker.measures == "pose" else 3
    most = max(
        bench.kept().n_free if mode == "whitened" else bench.free(mode).n_free
        for mode in bench.scenario.identification.estimators
    )
    tracker = bench.scenario.tracker
    missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
    if bench.scenario.uncertainty.replications:
        missed *= 2  # they visit what was seen, and miss shots again
    for trial in bench.scenario.trial:
        if rows * (trial.poses - missed) <= most:
            raise InputError(
                f'[[trial]] "{trial.name}" poses is {trial.poses}: '
                f"{rows * max(trial.poses - missed, 0)} equations "
                f"for {most} parameters",
                code="M27",
                field="trial.poses",
                value=trial.poses,
                fix=f"write poses = {most // rows + 1 + missed} or more",
            )
