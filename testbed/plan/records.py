"""What a plan holds: frozen records of finished values, SI inside."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.reduction import Reduction
from calib.shown import ResultTable, Shown, length_words
from calib.uncertainty.statement.applicability import Applicability
from calib.uncertainty.statement.conditions import Conditions
from calib.uncertainty.statement.shared import SharedErrors
from testbed.laboratory.cell import Obstacle
from testbed.laboratory.goal import Goal
from testbed.laboratory.pool import PosePool
from testbed.laboratory.tracker.stations import StationComparison
from testbed.plan.rehearsal import Rehearsals
from testbed.plan.sufficiency import Sufficiency
from testbed.robots.controller import Controller
from testbed.scenario.scenario import Scenario

FAR = 0.5
"""Distances to floor and obstacles are looked at up to here [m]."""
Role = Literal["identify", "test"]
Move = Literal["free", "around", "blocked"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Curve(Shown):
    """Predicted uncertainty against the number of poses, and what no set can go below."""

    counts: Index
    """(k,) numbers of poses, beyond those measured already."""
    u: Array
    """(k,) goal uncertainty of the designed set, k = 1 [m]."""
    shared: Array
    """(k,) the part of it from errors that all readings share [m]."""
    bound: Array
    """(k,) no set of so many poses from this pool goes below; nan where nothing is proven [m]."""
    random: Array
    """(k,) median over random sets of the same size; nan where half of them tell nothing [m]."""
    random_sets: int
    """Random sets behind each value; 0 if none were drawn."""
    target: float | None
    """Standard uncertainty wanted [m]; None without a target."""
    reached: int | None
    """Smallest number of poses whose designed set reaches the target; None if none does, 0 if those
    measured already do."""
    fewest: int | None
    """Proven: no set of fewer poses from this pool reaches the target."""
    sentence: str
    """What the curve says."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Proof(Shown):
    """How far the chosen set can be from the best one of its size."""

    efficiency: float | None
    """Certified part of the best possible figure; None where nothing can be proven."""
    bound: float | None
    """Best figure that any set of this size from this pool could have."""
    sentence: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Foresight(Shown):
    """What the measurements will leave unknown, and what they will show."""

    covariance: Array
    """(p, p) predicted, of the numbers to identify in their own units, all included [m, rad]."""
    noise: Array
    """(g,) 3-D standard uncertainty of the tool point at each goal posture from what scatters
    anew at each reading [m]."""
    shared: Array
    """(g,) from the tracker's systematic errors, which all readings share; zero if it states none
    [m]."""
    R95_over: float
    """Distance within which the tool point is with 95 % probability, over the goal's postures
    [m]."""
    R95_worst: float
    """The same at the worst posture [m]."""
    stated: Rehearsals
    """Radii that the calibration will state if the robot has no misfit."""
    misfit_seen: float
    """Size per axis of a misfit of the model that the measurements will show [m]."""
    applies: Applicability | None
    """Whether the statement will reach the goal's postures; None without held-out poses."""
    why: tuple[str, ...]
    """(g,) what will warn of each of them, or refuse it; empty where nothing does."""
    sources: SharedErrors | None
    """The systematic errors one by one, at the held-out poses; None if the tracker states none."""

    @property
    def u(self) -> Array:
        """(g,) noise and shared errors together, k = 1 [m]."""
        return np.hypot(self.noise, self.shared)


@dataclass(frozen=True, slots=True, eq=False)
class NextPose:
    """A pose that could be measured in addition, and what it would bring."""

    place: int
    """Its place in the pool."""
    u: float
    """Goal uncertainty with it, k = 1 [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What the tracker will show of one target, in its own axes, if the robot were nominal."""

    target: str
    """``"tool"``, ``"probe"`` or ``"reflector"``."""
    position: Array
    """(s, 3) x, y, z in the tracker frame [m]."""
    azimuth: Array
    """(s,) about z from x [rad]."""
    elevation: Array
    """(s,) above the x-y plane [rad]."""
    range: Array
    """(s,) distance [m]."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Tour(Shown):
    """Every pose to go to, in measuring order, and the way between them."""

    q: Array
    """(s, n) joint targets [rad, m]."""
    roles: tuple[Role, ...]
    """(s,) measured to identify, or kept apart to test."""
    pool_place: Index
    """(s,) place in the pool, -1 for held-out poses."""
    start: Array
    """(n,) where the robot stands before [rad, m]."""
    vias: tuple[Array, ...]
    """(s,) postures (v, n) to pass through before each pose, mostly none [rad, m]."""
    move: Array
    """(s,) time of the move to each pose, stops on the way included [s]."""
    speeds: Array
    """(n,) joint speeds of the moves [rad/s, m/s]."""
    other: float
    """Time of all moves in the order not chosen: at random, or the shortest found; inf if one of
    them is blocked [s]."""
    settle: float
    """Rest at each pose [s]."""
    blocked: tuple[int, ...]
    """Places in the tour that no free move was found to."""
    cut_off: tuple[int, ...]
    """Places in the tour that no way leads to from the start, by whatever poses."""
    clearance: float
    """Smallest distance of the moving robot to floor and obstacles on all free ways, poses
    included, as far as was looked; negative: they overlap; nan: no part has a shape [m]."""
    sentence: str
    """How long it takes and whether every move is free."""

    def move_word(self, k: int) -> Move:
        """How the robot gets to the k-th pose."""
        if k in self.blocked:
            return "blocked"
        return "around" if len(self.vias[k]) else "free"

    @property
    def duration(self) -> float:
        """Moves and rests together [s]."""
        return float(self.move.sum() + self.settle * len(self.q))

    @property
    def other_duration(self) -> float:
        """The same in the order not chosen [s]."""
        return self.other + self.settle * len(self.q)

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(Shown):
    """Everything `truebed plan` says."""

    scenario: Scenario
    nominal: RobotModel
    """The robot as its maker describes it; a plan knows no other."""
    parameters: Parameters
    """Numbers that will be identified; those free that can be told apart."""
    reduction: Reduction
    """Which free numbers can be told apart, and what stands for the others."""
    pool: PosePool
    leverage: Array
    """(N,) trace of K_jj: how much each candidate adds to the chosen set's information."""
    places: Index
    """(m,) the chosen poses in the pool, in measuring order."""
    controller: Controller
    """How the robot's controller counts joints, in tables and programs."""
    measured_q: Array
    """(k, n) poses measured already [rad, m]."""
    measured_under: Conditions
    """Their payload, tool and temperature, as far as they are stated."""
    tour: Tour
    readings: tuple[Reading, ...]
    T_world_tracker: Array
    """(4, 4) the station the plan is for [m]."""
    goal: Goal
    method: str
    """By which the chosen set was found."""
    foresight: Foresight
    sufficiency: Sufficiency | None
    """Whether the target is reached of an arm whose joints sag and wave; None where not asked."""
    u_of_step: Array
    """(m,) goal uncertainty after each identification pose in measuring order; nan before all
    numbers can be told apart [m]."""
    proof: Proof
    curve: Curve
    next_poses: tuple[NextPose, ...]
    """Best poses to add after these, best first."""
    stations: StationComparison | None
    """Tracker stations compared; the plan is for the best one. None: only the tracker's own."""
    obstacles: tuple[Obstacle, ...]
    """Of the cell."""
    shapeless: tuple[int, ...]
    """Moving bodies (1 ... n) whose shape the robot's file does not give: what they hit was not
    tested."""
    unread: tuple[int, ...]
    """Moving bodies (1 ... n) tested without some shape of theirs, which is not read."""
    mounted: bool
    """Whether the robot's file states how high above the level floor of the room its base is."""
    assumed: tuple[str, ...]
    """What the robot's file leaves open and the promise rests on, in words."""
    base: tuple[str, str]
    """The root of a URDF or MJCF, and where the base frame stands in it; empty if they are one."""

    def __repr__(self) -> str:
        R95, count = length_words(self.foresight.R95_over, um=".3g"), len(self.places)
        return (
            f"Plan({self.scenario.name!r}: {count} poses to identify of {len(self.tour)}, "
            f"R95 {R95} over the goal, {self.tour.duration:.0f} s)"
        )

    def tables(self) -> dict[str, ResultTable]:
        """``stops`` in measuring order, joints [rad, m]; ``goal``: u at each posture [um]."""
        tour, q = self.tour, self.tour.q.T
        stops = {
            "role": tour.roles,
            **{f"q{k + 1}": values for k, values in enumerate(q)},
            "move": [tour.move_word(k) for k in range(len(tour))],
            "move_s": tour.move,
        }
        parts = {
            "noise_um": self.foresight.noise,
            "shared_um": self.foresight.shared,
            "u_um": self.u,
        }
        goal = {name: 1e6 * u for name, u in parts.items()}
        return {"stops": ResultTable(stops), "goal": ResultTable(goal)}

    @property
    def coverage(self) -> float:
        """Factor k of expanded uncertainties."""
        return self.scenario.plan.coverage

    @property
    def use(self) -> Conditions:
        """One row: under which conditions the goal will be worked at."""
        use = self.scenario.plan.use
        return Conditions() if use is None else use.rows(1)

    @property
    def station_mm(self) -> tuple[float, float, float]:
        """The station in the base frame [mm]."""
        T_world_base = self.nominal.chain.T_world_base
        offset = self.T_world_tracker[:3, 3] - T_world_base[:3, 3]
        x, y, z = (float(value) * 1e3 for value in T_world_base[:3, :3].T @ offset)
        return x, y, z

    @property
    def u(self) -> Array:
        """(g,) predicted 3-D standard uncertainty of the tool point at each goal posture [m]."""
        return self.foresight.u

    @property
    def u_mean(self) -> float:
        """Weighted root mean square of `u` [m]."""
        return self.over_goal(self.u)

    def over_goal(self, u: Array) -> float:
        """Weighted root mean square of values (g,) over the goal."""
        return float((self.goal.weights @ u**2) ** 0.5)

    @property
    def u_worst(self) -> float:
        """Largest of `u` [m]."""
        return float(self.u.max())
