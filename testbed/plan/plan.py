"""`plan`: poses for a real robot, with order, readings and what will come out, or a refusal."""

from collections.abc import Callable
from itertools import combinations

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError, refuse
from calib.geometry.parameters import Parameters
from calib.information.goals import Goals, goal_matrix
from calib.uncertainty.statement.conditions import Conditions
from testbed.laboratory.bench import PROBED_POSES, Bench, open_bench
from testbed.laboratory.goal import Goal, goal_of
from testbed.laboratory.joint_lists import read_conditions, read_joints
from testbed.laboratory.pool import PosePool
from testbed.laboratory.tracker.predicted import shared_rows
from testbed.laboratory.tracker.stations import (
    StationComparison,
    compare_stations,
    place_word,
    require_ranges,
    require_station,
    require_stations,
    station_grid,
    visible_from,
)
from testbed.plan.design import (
    check_enough,
    curve_of,
    designed,
    leverages,
    next_poses,
    proof_of,
    quick_design,
    u_while_measuring,
)
from testbed.plan.for_joints import Suited, for_joints
from testbed.plan.foresight import foresight, rehearsals
from testbed.plan.reached import Made, elsewhere, reached
from testbed.plan.records import Plan
from testbed.plan.rehearsal import Rehearsals, may_bend
from testbed.plan.task import DesignTask
from testbed.plan.tour import held_out, mover_of, readings_of, start_of, tour_of
from testbed.progress import Progress
from testbed.robots.file_frames import base_words, chain_words
from testbed.robots.robot import NO_MASS
from testbed.scenario.checks import check_robot
from testbed.scenario.planning import DEFAULT_POSES
from testbed.scenario.scenario import Scenario
from testbed.streams import stream

STEPS = (
    "robot and goal", "stations and candidate poses", "pose set", "measuring order", "files"
)  # fmt: skip
"""What is told while a plan is made; the last one is the writing of its folder."""
EQUAL = 1e-3
"""Stations nearer than this are the same one [m]."""


def plan(scenario: Scenario, *, progress: Progress | None = None, where: str = "scenario") -> Plan:
    """Plan the measurement of a real robot; the truth is never drawn.

    Parameters
    ----------
    scenario : Scenario
        Robot, tracker, pool, cell, what is free, and [plan].
    progress : callable, optional
        Told what begins, steps done, steps in all.
    where : str
        What messages call the scenario.

    Raises
    ------
    InputError
        Too few poses, a goal out of reach, a pool that cannot tell something, a target that no
        number of poses reaches; exit code 2.
    """
    try:
        return _plan(scenario, progress or (lambda *_: None), where)
    except InputError as error:
        raise error.located(where) from error


def _plan(scenario: Scenario, tell: Progress, where: str) -> Plan:
    """`plan`, with errors that do not name the scenario yet."""
    tell(STEPS[0], 0, len(STEPS))
    check_tested(scenario)
    check_one_target(scenario)
    bench = open_bench(scenario, clearance=scenario.plan.clearance_mm / 1e3)
    check_robot(scenario, bench.robot, where=where)
    check_stations(bench)
    goal = goal_of(bench)
    (measured, under), start = _measured(bench), start_of(bench)
    tell(STEPS[1], 1, len(STEPS))
    stations = compared(bench, goal)
    if stations is not None:
        bench = bench.standing_at(stations.stations[stations.best])
    # the same pool that `truebed run` draws
    draw = stream(scenario.seed, "pool")
    pool = bench.candidates().draw(draw, exclude=measured if len(measured) else None)
    tell(STEPS[2], 2, len(STEPS))
    shown = np.vstack([pool.q[:PROBED_POSES], measured])
    parameters, reduction = bench.reduction(shown)
    bench.check_seen(shown, goal.q, goal.point)
    goals = _goals(bench, goal, parameters)
    beside = mover_of(bench).leads_to

    def made(pool: PosePool, lost: Array) -> Made:
        """Set and tour from a pool, with held-out poses that are none of those lost (k, n)."""
        apart = elsewhere(
            lambda lost: held_out(bench, goal, np.vstack([pool.q, measured, lost])), lost, beside
        )
        task = _task(bench, goals, parameters, pool.q, measured)
        check_enough(task)
        rng = stream(scenario.seed, "plan", "select")
        fewest, method, budget = designed(task, rng)

        def rehearse(places: Index) -> Rehearsals:
            """What calibrations from a set, with the poses measured already, state."""
            q = np.vstack([measured, pool.q[places]])
            return rehearsals(bench, goal, parameters, q, apart)

        suited = _suited(bench, parameters, pool.q, task, fewest, rehearse if len(apart) else None)
        places = suited.places
        method = method if places is fewest else "exchange"
        curve = curve_of(task, budget, len(fewest), places, rng)
        require_ranges(bench, np.vstack([pool.q[places], apart]), "the plan")
        tell(STEPS[3], 3, len(STEPS))
        tour = tour_of(
            bench, start, pool.q[places], places, apart, pool.q,
            tell=lambda _: tell(STEPS[3], 3, len(STEPS)),
        )  # fmt: skip
        return Made(pool, apart, task, suited, method, curve, tour)

    pool, apart, task, suited, method, curve, tour = reached(made, pool, beside)
    places, q = suited.places, np.vstack([measured, pool.q[suited.places]])
    stated = suited.stated or rehearsals(bench, goal, parameters, q, apart)
    M = task.information(places)
    ordered = tour.pool_place[tour.pool_place >= 0]
    return Plan(
        scenario=scenario,
        nominal=bench.robot.model,
        parameters=parameters,
        reduction=reduction,
        pool=pool,
        leverage=frozen(leverages(task.blocks, M[: task.p, : task.p])),
        places=ordered,
        controller=bench.robot.controller,
        measured_q=measured,
        measured_under=under,
        tour=tour,
        readings=readings_of(bench, tour.q),
        T_world_tracker=bench.tracker.T_world_tracker,
        goal=goal,
        method=method,
        foresight=foresight(bench, goal, task, parameters, places, q, apart, stated),
        sufficiency=suited.sufficiency,
        u_of_step=frozen(u_while_measuring(task, ordered)),
        proof=proof_of(task, places),
        curve=curve,
        next_poses=next_poses(task, places),
        stations=stations,
        obstacles=bench.cell,
        shapeless=bench.robot.shapeless,
        unread=bench.robot.partly,
        mounted=bench.robot.mounting_height is not None,
        assumed=assumed_of(bench),
        base=(base_words(bench.robot), chain_words(bench.robot)),
    )


def assumed_of(bench: Bench) -> tuple[str, ...]:
    """What was assumed of a robot whose file leaves it open, but for masses: no plan asks them."""
    stated = bench.scenario.truth.joint_repeatability_mdeg is not None
    return tuple(
        note
        for note in bench.robot.notes
        if "assumed" in note
        and not note.startswith(NO_MASS)
        and not (stated and "repeatability" in note)
    )


def compared(bench: Bench, goal: Goal) -> StationComparison | None:
    """The stations of [plan.stations] compared on one common pool; None if none are given."""
    scenario = bench.scenario
    if not scenario.plan.stations.given:
        return None
    rng = stream(scenario.seed, "plan", "stations")
    q = bench.candidates(seen=False).draw(rng).q
    parameters, _ = bench.reduction(q[:PROBED_POSES])
    goals, stations = _goals(bench, goal, parameters), station_grid(scenario.plan.stations)
    # of common candidates a station sees a part: as many as the best one sees, where that will do
    seen = max(int(visible_from(bench.standing_at(one), q)[1].sum()) for one in stations)
    # too few for any calibration are refused for that, not for what stations see
    count = max(scenario.plan.poses or DEFAULT_POSES, parameters.n_free // bench.equations + 1)
    if seen * bench.equations > parameters.n_free:
        count = min(count, seen)

    def designer(blocks: Array, shared: Array) -> Index:
        """A set of the number wanted, from nothing measured before."""
        none = np.zeros((0, blocks.shape[2] + shared.shape[2]))
        settings, names = scenario.plan, parameters.free_names
        task = DesignTask(blocks, shared, goals, none, settings, names)
        return quick_design(task, count, stream(scenario.seed, "plan", "stations", "select"))

    return compare_stations(bench, stations, q, parameters, goals, designer)


def _suited(
    bench: Bench,
    parameters: Parameters,
    q: Array,
    task: DesignTask,
    fewest: Index,
    rehearse: Callable[[Index], Rehearsals] | None,
) -> Suited:
    """The set for the arm that is there, from the fewest poses that its links alone need."""
    settings, seed = bench.scenario.plan, bench.scenario.seed
    bends = not settings.stiff_joints and may_bend(bench.robot.model, parameters, q)
    if task.target is None or not bends:
        return Suited(fewest)
    return for_joints(task, fewest, rehearse, stream(seed, "plan", "joints"))


def _task(
    bench: Bench, goals: Goals, parameters: Parameters, q: Array, measured: Array
) -> DesignTask:
    """What is chosen from a pool q (N, n) beside poses measured already (k, n)."""
    before = np.dstack([bench.blocks(measured, parameters), shared_rows(bench, measured)])
    return DesignTask(
        bench.blocks(q, parameters),
        shared_rows(bench, q),
        goals,
        before.reshape(-1, before.shape[2]),
        bench.scenario.plan,
        parameters.free_names,
    )


def _goals(bench: Bench, goal: Goal, parameters: Parameters) -> Goals:
    """What the identified numbers do to the tool point at the goal."""
    model = bench.robot.model
    return goal_matrix(model, goal.q, parameters, weights=goal.weights, target=goal.point)


def _measured(bench: Bench) -> tuple[Array, Conditions]:
    """Poses measured already (k, n), and under which conditions; none without [plan] measured."""
    file = bench.scenario.plan.measured
    if not file:
        return frozen(np.zeros((0, bench.robot.model.chain.n_joints))), Conditions()
    return read_joints(bench.robot, file), read_conditions(file)


def check_tested(scenario: Scenario) -> None:
    """Refuse a scenario whose pool is not tested for collisions: a plan moves a real robot."""
    if not scenario.pool.self_collision:
        raise refuse(
            "pool.self_collision", False, code="S37", fix="remove that key",
            message="[pool] self_collision is false, and a plan is for a real robot: its poses and "
            "moves must be tested",
        )  # fmt: skip


def check_one_target(scenario: Scenario) -> None:
    """Refuse a scenario with further targets and stations: a plan is for one of each."""
    if scenario.fixtures is not None:
        raise refuse(
            "fixtures", code="S37",
            message="[fixtures] is there, and a plan is for one target seen from one station",
            fix="remove that table, or play the scenario with `truebed run`",
        )  # fmt: skip


def check_stations(bench: Bench) -> None:
    """Refuse stations below the floor, in the robot's work space, or given twice."""
    settings = bench.scenario.plan.stations
    if not settings.given:
        require_stations(bench)
        return
    stations = station_grid(settings)
    for k, station in enumerate(stations):
        name = f"[plan.stations] {place_word(k, station)}"
        require_station(bench, station, name, "plan.stations")
    for a, b in combinations(range(len(stations)), 2):
        if np.linalg.norm(stations[a] - stations[b]) < EQUAL:
            message = f"[plan.stations] {place_word(b, stations[b])} is the same as station {a + 1}"
            raise refuse("plan.stations", code="S37", message=message, fix="remove one of them")
