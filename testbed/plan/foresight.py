"""What a plan's measurements will leave unknown at the goal, what they will show, and where."""

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.parameters import Parameters
from calib.measurement import tables
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.applicability import Proven, proven_by
from calib.uncertainty.statement.distance import largest_radius, radius_over
from calib.uncertainty.statement.gain import beside_held, least_squares_gain
from calib.uncertainty.statement.instrument import InstrumentErrors
from calib.uncertainty.statement.misfit import detectable_size, evidence_rows
from calib.uncertainty.statement.places import reasons
from calib.uncertainty.statement.shared import SharedErrors, planned_errors
from testbed.laboratory.bench import Bench
from testbed.laboratory.goal import Goal
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.laboratory.tracker.predicted import goal_u
from testbed.plan.records import Foresight
from testbed.plan.rehearsal import Rehearsals, rehearsed
from testbed.plan.task import DesignTask
from testbed.scenario.laboratory import At960Tracker


def foresight(
    bench: Bench,
    goal: Goal,
    task: DesignTask,
    parameters: Parameters,
    places: Index,
    q: Array,
    held_out: Array,
    stated: Rehearsals,
) -> Foresight:
    """What will be known after a plan.

    Parameters
    ----------
    bench : Bench
        The laboratory, at the plan's station.
    goal : Goal
        Where the tool must be right.
    task : DesignTask
        With what was measured already.
    parameters : Parameters
        The numbers to be identified.
    places : (m,) array
        The chosen poses, in the pool.
    q : (b + m, n) array
        All poses that will be identified from, those measured already among them [rad, m].
    held_out : (h, n) array
        Poses kept apart [rad, m].
    stated : Rehearsals
        What calibrations from these poses state.
    """
    M, rows = task.information(places), task.goals.rows
    covariance = task.covariance(M)
    sigma = np.asarray(rows @ covariance @ np.swapaxes(rows, 1, 2))
    u, scale = goal_u(M, rows), parameters.free_scale
    train, apart = planned_rows(bench, q), planned_rows(bench, held_out)
    gain = least_squares_gain(bench.robot.model, parameters, train)
    every = np.ones(len(train), dtype=np.bool_)
    _, evidence = evidence_rows(bench.robot.model, parameters, train, apart, every)
    proven = proof(bench, goal, parameters, gain, train, held_out)
    reach = None if proven is None else proven.applies(goal.q)
    shared = sources(bench, parameters, gain, train, apart if len(apart) else train)
    return Foresight(
        covariance=frozen(covariance * np.outer(scale, scale)),
        noise=frozen(u.noise),
        shared=frozen(u.shared),
        R95_over=radius_over(sigma, goal.weights),
        R95_worst=largest_radius(sigma),
        stated=stated,
        misfit_seen=detectable_size(evidence),
        applies=reach,
        why=() if proven is None or reach is None else reasons(proven, reach, goal.q),
        sources=shared,
    )


def rehearsals(
    bench: Bench, goal: Goal, parameters: Parameters, q: Array, held_out: Array
) -> Rehearsals:
    """What calibrations from poses q (m, n) state, judged by held-out ones (h, n)."""
    train, apart = planned_rows(bench, q), planned_rows(bench, held_out)
    return rehearsed(bench, goal, parameters, train, apart, stated_errors(bench))


def planned_rows(bench: Bench, q: Array) -> Measurements:
    """What the tracker would read of the nominal robot at joints q (m, n), with its noise."""
    T, covariance = bench.robot.model.poses(q), bench.covariance(q)
    numbers = np.arange(len(q))
    if bench.tracker.measures == "pose":
        return tables.poses(q, T, sd=covariance, pose_id=numbers)
    return tables.points(
        q,
        bench.tracker.targets(T),
        sd=covariance[:, :3, :3],
        offset=bench.tracker.reflector,
        pose_id=numbers,
    )


def proof(
    bench: Bench,
    goal: Goal,
    parameters: Parameters,
    gain: Array,
    train: Measurements,
    held_out: Array,
) -> Proven | None:
    """What the statement after the plan will be proven at; None without held-out poses."""
    if not len(held_out):
        return None
    model = bench.robot.model
    noise = beside_held(parameters, np.einsum("mfe,meg,mhg->fh", gain, train.covariance, gain))
    return proven_by(
        model, parameters, gain, noise, train, held_out,
        target=goal.point, up=model.chain.T_world_base[2, :3],
    )  # fmt: skip


def sources(
    bench: Bench, parameters: Parameters, gain: Array, train: Measurements, judged: Measurements
) -> SharedErrors | None:
    """The tracker's systematic errors one by one; None if it states none."""
    model, size, beam = bench.robot.model, stated_errors(bench), bench.tracker.T_world_tracker[None]
    if size is None:
        return None
    return planned_errors(size, model, parameters, gain, train, judged, beam)


def stated_errors(bench: Bench) -> InstrumentErrors | None:
    """How large the tracker's systematic errors are; None if it states none."""
    settings = bench.scenario.tracker
    if not isinstance(settings, At960Tracker) or not settings.systematic:
        return None
    return bias_size(settings)
