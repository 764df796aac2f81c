"""What a real laboratory has: robot, tracker, cell, candidate poses, noise stated; no truth."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from calib.arrays import Array, Bool
from calib.design.blocks import paper_blocks, scaled_blocks
from calib.errors import refuse
from calib.geometry.parameters import Parameters
from calib.identification.identify import Mode
from calib.information.goals import goal_matrix, hidden_numbers
from calib.information.reduction import Reduction, reduce
from calib.measurement.observations import DISTANCE
from calib.measurement.residual import point_blocks, whitened_blocks
from testbed.laboratory.cell import Obstacle, cell_from
from testbed.laboratory.pool import Candidates
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.tracker.rounds import (
    Round,
    first_tracker,
    free_fixtures,
    nominal_fixtures,
    rounds_of,
    stacked_rows,
)
from testbed.laboratory.tracker.tracker import Tracker
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.checks import free_parameters
from testbed.scenario.laboratory import TruthSettings
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import PAPER_SET, PoolSettings
from testbed.units import counted, listed

PROBED_POSES = 200
"""Pool poses from which identifiability is judged before anything is selected."""


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """A scenario's laboratory without its secret."""

    scenario: Scenario
    robot: Robot
    """Nominal."""
    tracker: Tracker
    """At its station."""
    cell: tuple[Obstacle, ...]
    simulator: Simulator
    """Of the nominal robot in its cell, with the clearance that poses and moves must keep."""
    touching: Simulator
    """The same without clearance: the robot works as near to things as it likes."""
    sigma_q: Array
    """(n,) stated repeatability of each joint [rad or m]."""
    pool_q: Array
    """(N, n) candidates that designs choose from; none before they are drawn [rad, m]."""
    rounds: tuple[Round, ...]
    """What is measured from where, in turn; none: the tracker's own target from its own station."""

    def covariance(self, q: Array) -> Array:
        """Stated covariance (m, 6, 6) of one visit of each pose, from nominal poses [m, rad]."""
        return self.tracker.covariance(self.robot.model, q, self.sigma_q)

    def whitened_rows(self, q: Array) -> Array:
        """Whitened Jacobian blocks (m, r, P) of poses q (m, n) not measured yet, all P columns.

        Rows of all rounds one below the other, zero where a round does not see the pose.
        """
        if self.rounds:
            seen = self.visible(q)
            return stacked_rows(self.rounds, self.robot.model, q, self.sigma_q, seen)
        covariance = self.covariance(q)
        if self.tracker.measures == "pose":
            return whitened_blocks(self.robot.model, q, covariance)
        offset = np.broadcast_to(self.tracker.reflector, (len(q), 3))
        return point_blocks(self.robot.model, q, covariance[:, :3, :3], offset)

    def blocks(self, q: Array, parameters: Parameters) -> Array:
        """Whitened blocks (m, r, p) of the free numbers in scaled units."""
        if not len(q):
            return np.zeros((0, self.equations, parameters.n_free))
        return scaled_blocks(self.whitened_rows(q), parameters)

    @property
    def equations(self) -> int:
        """Scalar equations of a pose that every round sees."""
        own = 6 if self.tracker.measures == "pose" else 3
        return sum(one.equations for one in self.rounds) if self.rounds else own

    @property
    def usual_rows(self) -> str:
        """Rows in which indices are compared with the literature: the paper's for full poses."""
        paper = self.tracker.measures == "pose" and not self.rounds
        return "paper" if paper else "whitened"

    def visit_time(self, poses: int) -> float:
        """How long one visit of so many poses takes, in all rounds [s]."""
        return poses * self.tracker.pose_time * max(len(self.rounds), 1)

    def visible(self, q: Array) -> Bool:
        """Whether (m, k) each round sees poses q (m, n): the nominal robot in its cell."""
        candidates = self.candidates()
        chain, tests = self.robot.model.chain, []
        for one in self.rounds:
            aim = one.tracker.aim(chain)
            there = replace(candidates, station=one.tracker.station, aim=aim, others=())
            tests.append(there.measurable(q))
        return np.stack(tests, axis=1)

    def free(self, mode: Mode) -> Parameters:
        """Parameters that an estimator may move, before reduction."""
        table = free_parameters(self.scenario, self.robot, mode)
        fixtures = self.robot.model.fixtures
        if not fixtures.n_numbers:
            return table
        own = set(fixtures.names)
        found = free_fixtures(self.scenario, fixtures)
        return table.freeing((*(name for name in table.free_names if name not in own), *found))

    def reduction(self, q: Array) -> tuple[Parameters, Reduction]:
        """Free numbers that poses like q (m, n) can tell apart, and the account of the others."""
        free = self.free("whitened")
        if not free.n_free:
            message, fix = "[identification] leaves nothing free", "free at least one number"
            raise refuse("identification.free", code="M27", message=message, fix=fix)
        found = reduce(self._scaled_rows(q, free), free, model=self.robot.model, q=q)
        return free.freeing(found.kept), found

    def _scaled_rows(self, q: Array, free: Parameters) -> Array:
        """Whitened rows (m r, f) of poses q (m, n), columns scaled."""
        A = self.whitened_rows(q)[:, :, free.free] * free.free_scale
        return np.asarray(A.reshape(-1, free.n_free))

    def kept(self) -> Parameters:
        """Free numbers of the default estimator that generic poses of the pool can tell apart."""
        return self.reduction(self.pool_q[:PROBED_POSES])[0]

    def design_blocks(self, rows: str) -> Array:
        """Blocks (N, r, p) of the whole pool in which an index is computed.

        `rows` is "whitened" (whitened rows, columns scaled to 1 m and 1/L rad) or "paper" (twelve
        unweighted rows, mm and rad, in their six-row equivalent).
        """
        if rows == "whitened":
            return self.blocks(self.pool_q, self.kept())
        free = self.free("paper") if PAPER_SET in self.robot.free_sets else self.kept()
        return paper_blocks(self.robot.model, free, self.pool_q)

    def check_seen(self, q: Array, goal_q: Array, point: Array) -> None:
        """Refuse a goal that moves with something the poses q (m, n) never show.

        Raises
        ------
        InputError
            Names the numbers that move the tool point at the goal and nothing measured.
        """
        free = self.free("whitened")
        A = self._scaled_rows(q, free)
        goals = goal_matrix(self.robot.model, goal_q, free, target=point)
        names = hidden_numbers(A, goals, free.free_names)
        if not names:
            return
        together = listed(names)
        message = (
            f"{together} can change together so that the tool point at the goal moves, and no pose "
            "of the pool shows it"
        )
        ways = "measure full poses, widen the pool, or ask for a point that the tracker sees"
        fix = f"{ways} ([plan] point_mm)"
        raise refuse("plan.goal", names, code="M28", message=message, fix=fix)

    def check_views(self, q: Array) -> None:
        """Refuse a station, an anchor or a target that no pose of q (m, n) shows.

        Raises
        ------
        InputError
            Names it, and what to move.
        """
        if not self.rounds:
            return
        seen = np.asarray(self.visible(q).any(axis=0))
        every = counted(len(q), "pose")
        for place in dict.fromkeys(one.place for one in self.rounds):
            own = [k for k, one in enumerate(self.rounds) if one.place == place]
            if seen[own].any():
                continue
            first = self.rounds[own[0]]
            at = ", ".join(f"{value * 1e3:.0f}" for value in first.tracker.station)
            key = "anchors_mm" if first.kind == DISTANCE else "stations_mm"
            name = f'anchor "{place}"' if first.kind == DISTANCE else place
            raise refuse(
                f"fixtures.{key}" if place != "station 1" else "tracker.station_mm",
                place,
                code="M28",
                message=f"{name} at ({at}) mm sees nothing: no target faces it at any of the "
                f"{every} of the pool, or something always stands between",
                fix="move it to where the tool turns towards it",
            )
        for target in dict.fromkeys(one.target for one in self.rounds):
            own = [k for k, one in enumerate(self.rounds) if one.target == target]
            optical = [k for k in own if self.rounds[k].kind != DISTANCE] or own
            if not seen[optical].any():
                raise refuse(
                    "fixtures.reflectors_mm",
                    target,
                    code="M28",
                    message=f'the reflector "{target}" is hidden from all stations at each of the '
                    f"{every} of the pool",
                    fix="move it to where the tool does not hide it, or remove it",
                )

    def standing_at(self, station: Array) -> Self:
        """The same laboratory with the tracker at a station (3,) in the base frame [m]."""
        settings = self.scenario.tracker.model_copy(update={"station_mm": tuple(station * 1e3)})
        return replace(self, tracker=tracker_from(settings, self.robot.model.chain))

    def candidates(
        self, settings: PoolSettings | None = None, *, seen: bool = True, near: bool = False
    ) -> Candidates:
        """Poses of [pool], or of other settings, and the tests they must pass here.

        Unless `seen`, the tracker is not asked, only the robot and its cell. `near` lets poses come
        as near to the cell as the robot can without touching it.
        """
        settings = self.scenario.pool if settings is None else settings
        if not seen:
            settings = settings.model_copy(update={"line_of_sight": False})
        return Candidates(
            self.robot,
            self.touching if near else self.simulator,
            settings,
            self.tracker.station,
            aim=self.tracker.aim(self.robot.model.chain),
            acceptance=self.tracker.acceptance if seen else np.pi,
            others=tuple(
                (one.tracker.station, one.tracker.aim(self.robot.model.chain))
                for one in self.rounds[1:]
                if one.kind != DISTANCE
            ),
        )


def open_bench(scenario: Scenario, *, clearance: float = 0.0) -> Bench:
    """Set up the laboratory; poses and moves keep a `clearance` from the cell [m].

    No truth is drawn, and no candidates.
    """
    robot = load_robot(scenario.robot)
    chain = robot.model.chain
    fixtures = nominal_fixtures(scenario, chain)
    if fixtures.n_numbers:
        robot = replace(robot, model=replace(robot.model, fixtures=fixtures))
    tracker = first_tracker(scenario, chain)
    cell = cell_from(scenario.cell, chain)
    touching = Simulator(robot, chain, cell)
    return Bench(
        scenario,
        robot,
        tracker,
        cell,
        Simulator(robot, chain, cell, clearance=clearance) if clearance else touching,
        touching,
        joint_repeatability(robot, scenario.truth),
        np.zeros((0, chain.n_joints)),
        rounds_of(scenario, tracker, fixtures),
    )


def joint_repeatability(robot: Robot, truth: TruthSettings) -> Array:
    """Standard deviation of each joint (n,) [rad or m]; the robot's where truth has None.

    A number in the scenario is an angle: sliding joints keep theirs, or none if it is zero.
    """
    if truth.joint_repeatability_mdeg is None:
        return robot.repeatability
    value = float(np.radians(truth.joint_repeatability_mdeg * 1e-3))
    slides = robot.model.chain.prismatic.astype(bool)
    return np.where(slides, robot.repeatability * bool(value), value)
