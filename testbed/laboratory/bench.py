"""The laboratory as a planner sees it: the nominal robot, the tracker, the noise it will state."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.design.blocks import scaled_blocks
from calib.errors import InputError
from calib.geometry.parameters import Parameters
from calib.information.goals import goal_matrix
from calib.information.rank import RANK_TOLERANCE
from calib.information.reduction import Reduction, reduce
from testbed.laboratory.campaign_bench import free_parameters
from testbed.laboratory.cell import Obstacle, cell_from
from testbed.laboratory.pool import Pool, draw_pool
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.station import station_rows
from testbed.laboratory.tracker.tracker import Tracker, tracker_from
from testbed.laboratory.truth.robot import joint_repeatability
from testbed.robots.catalog import Robot, load_robot
from testbed.scenario.read import PoolSettings, Scenario

FELT = 1e-6
"""Part of a unit step's effect on the goal below which a hidden direction does not matter."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanBench:
    """A scenario's laboratory without its secret."""

    scenario: Scenario
    robot: Robot
    simulator: Simulator
    """Of the cell with the clearance that poses and moves of a plan keep."""
    touching: Simulator
    """Of the same cell without: the robot works as near to things as it likes."""
    cell: tuple[Obstacle, ...]
    tracker: Tracker
    sigma_q: Array
    """(n,) stated repeatability of each joint [rad or m]."""

    def whitened_rows(self, q: Array) -> Array:
        """Whitened Jacobian blocks (m, r, P) of poses q (m, n), all P columns."""
        return station_rows(self.robot, self.tracker, q, self.sigma_q)

    def blocks(self, q: Array, parameters: Parameters) -> Array:
        """Whitened blocks (m, r, p) of the free numbers in scaled units."""
        if not len(q):
            return np.zeros((0, 6 if self.tracker.measures == "pose" else 3, parameters.n_free))
        return scaled_blocks(self.whitened_rows(q), parameters)

    def reduction(self, q: Array) -> tuple[Parameters, Reduction]:
        """Free numbers that poses like q (m, n) can tell apart, and the account of the others."""
        free = free_parameters(self.scenario, self.robot, "whitened")
        if not free.n_free:
            raise InputError(
                "[identification] leaves nothing free",
                code="M27",
                field="identification.free",
                fix="free at least one number",
            )
        A = self.whitened_rows(q)[:, :, free.free] * free.free_scale
        found = reduce(A.reshape(-1, free.n_free), free, model=self.robot.model, q=q)
        return free.freeing(found.kept), found

    def check_seen(self, q: Array, goal_q: Array, point: Array) -> None:
        """Refuse a goal that moves with something the poses q (m, n) never show.

        Raises
        ------
        InputError
            Says in words which numbers move the tool point at the goal and nothing measured.
        """
        free = free_parameters(self.scenario, self.robot, "whitened")
        A = self.whitened_rows(q)[:, :, free.free].reshape(-1, free.n_free) * free.free_scale
        goals = goal_matrix(self.robot.model, goal_q, free, target=point).rows
        size = np.linalg.norm(A, axis=0)
        size = np.where(size > RANK_TOLERANCE * size.max(), size, size.max())
        _, singular, Vt = np.linalg.svd(np.linalg.qr(A / size, mode="r"))
        hidden = Vt[int((singular > RANK_TOLERANCE * singular[0]).sum()) :].T / size[:, None]
        effect = goals.reshape(-1, free.n_free) @ hidden
        if not hidden.size or np.abs(effect).max() < FELT * np.abs(goals @ (1 / size)).max():
            return
        way = hidden @ np.linalg.svd(effect, full_matrices=False)[2][0]
        order = np.argsort(-np.abs(way), kind="stable")[:4]
        names = [free.free_names[k] for k in order if abs(way[k]) > 0.05 * abs(way[order[0]])]
        together = " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
        raise InputError(
            f"{together} can change together so that the tool point at the goal moves, and no pose "
            "of the pool shows it",
            code="M28",
            field="plan.goal",
            value=names,
            fix="measure full poses, widen the pool, or ask for a point that the tracker sees "
            "([plan] point_mm)",
        )

    def standing_at(self, station: Array) -> "PlanBench":
        """The same laboratory with the tracker at a station (3,) in the base frame [m]."""
        settings = self.scenario.tracker.model_copy(update={"station_mm": tuple(station * 1e3)})
        return replace(self, tracker=tracker_from(settings, self.robot.model.chain))

    def pool(
        self,
        settings: PoolSettings,
        rng: np.random.Generator,
        *,
        size: int,
        seen: bool = True,
        near: bool = False,
        exclude: Array | None = None,
    ) -> Pool:
        """Feasible poses; `seen` False asks the robot and its cell only, not the tracker.

        `near` lets them come as near to the cell as the robot can without touching it.
        """
        if not seen:
            settings = settings.model_copy(update={"line_of_sight": False})
        return draw_pool(
            self.robot,
            self.touching if near else self.simulator,
            settings,
            self.tracker.station,
            rng,
            size=size,
            aim=self.tracker.aim(self.robot.model.chain),
            acceptance=self.tracker.acceptance if seen else np.pi,
            exclude=exclude,
        )


def open_plan_bench(scenario: Scenario) -> PlanBench:
    """Set up the laboratory for planning; no truth is drawn."""
    robot = load_robot(scenario.robot)
    chain = robot.model.chain
    cell = cell_from(scenario.cell, chain)
    return PlanBench(
        scenario,
        robot,
        Simulator(robot, chain, cell, clearance=scenario.plan.clearance_mm / 1e3),
        Simulator(robot, chain, cell),
        cell,
        tracker_from(scenario.tracker, chain),
        joint_repeatability(robot, scenario.truth),
    )
