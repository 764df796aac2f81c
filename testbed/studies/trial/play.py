"""A trial played: selected, measured, identified, compared; and the whole again and again.

Only a laboratory that knows the truth can ask whether intervals hold it. The same robot visits the
same poses K times with fresh noise; every replication states its intervals and regions anew. Beside
the trials stands the validation visit, with the judging poses.
"""

from dataclasses import replace

import numpy as np
from scipy.special import bdtr, chdtri

from calib.arrays import Array, Index
from calib.design import (
    METHODS,
    Problem,
    Selection,
    best_of_random,
    detmax,
)
from calib.identification.identify import Identification, Mode
from calib.information.criteria import NEEDS_GOALS
from calib.information.criteria.base import Criterion
from calib.information.criteria.named import criterion_named
from calib.information.observability import Observability, indices
from calib.information.rank import singular_values
from calib.measurement.accuracy import point_distances, target_points
from calib.measurement.observations import Measurements
from calib.uncertainty.regions import inside, mahalanobis_squared
from calib.uncertainty.type_a import type_a
from testbed.laboratory.goal import goals_of, wants_goals
from testbed.laboratory.truth.budget import truth_budget
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import (
    Setting,
    in_turn,
    journey,
    make_setting,
    validation_start,
)
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import TrialSettings
from testbed.streams import stream
from testbed.studies.trial.compare import INTERVAL, compare, target_prediction, true_step
from testbed.studies.trial.estimator import Estimator, estimator_for
from testbed.studies.trial.records import Estimate, Replications, Trial
from testbed.studies.trial.statement.records import Statement, Validation
from testbed.studies.trial.statement.state import state


def campaign_setting(scenario: Scenario) -> Setting:
    """The laboratory set up; a goal out of reach is refused here, before any trial."""
    setting = make_setting(scenario)
    if wants_goals(scenario):
        goals_of(open_laboratory(scenario, setting))
    return setting


def play_trial(scenario: Scenario, setting: Setting, validation: Validation, name: str) -> Trial:
    """Select, measure, identify and judge the trial called `name`."""
    settings = scenario.trial_named(name)
    bench = open_laboratory(scenario, setting)
    selection = select(
        bench.design_blocks(settings.rows),
        settings,
        stream(scenario.seed, "select", name),
        criterion_of(bench, settings),
    )
    chosen = selection.indices
    visits = visits_of(bench, name, chosen)
    rows = bench.usual_rows
    return Trial(
        name=name,
        method=settings.method,
        rows=settings.rows,
        selection=selection,
        observability=observed(bench.design_blocks(rows)[chosen]),
        whitened_observability=observed(bench.design_blocks("whitened")[chosen]),
        measurements=visits[0],
        estimates=tuple(
            estimate(bench, mode, visits, validation, name)
            for mode in scenario.identification.estimators
        ),
    )


def visits_of(bench: Laboratory, name: str, chosen: Index) -> list[Measurements]:
    """All visits of the poses of the trial called `name`, the same ones whenever they are made."""
    span = bench.visit_time(len(chosen))
    return [
        bench.measure_pool(chosen, "visit", name, repeat=k, start=k * span)
        for k in range(bench.scenario.uncertainty.repeats)
    ]


def criterion_of(bench: Laboratory, settings: TrialSettings) -> Criterion:
    """What a trial's set is chosen by, with the scenario's goal where it needs one."""
    goals = goals_of(bench) if settings.criterion in NEEDS_GOALS else None
    return criterion_named(settings.criterion, goals=goals)


def select(
    blocks: Array, settings: TrialSettings, rng: np.random.Generator, criterion: Criterion
) -> Selection:
    """The pose set of a trial from the blocks (N, r, p) of the pool."""
    problem = Problem.of_blocks(blocks, settings.poses, criterion)
    if settings.method == "best_of_random":
        return best_of_random(problem, rng, sets=settings.sets)
    if settings.method == "detmax":
        a, b, c, d = settings.detmax
        return detmax(problem, rng, a=a, b=b, c=c, d=d)
    return METHODS[settings.method](problem, rng)


def observed(blocks: Array) -> Observability:
    """All indices of the poses whose blocks (m, r, p) are given."""
    return indices(singular_values(blocks.reshape(-1, blocks.shape[-1])), len(blocks))


def estimate(
    bench: Laboratory, mode: Mode, visits: list[Measurements], validation: Validation, name: str
) -> Estimate:
    """Identify from the first visit; repeat for type A; say what to believe; replicate to check."""
    estimator = estimator_for(bench, mode, visits[0])
    first = estimator.fit(visits[0])
    statement = (
        state(bench, estimator, first, visits, validation, name) if mode == "whitened" else None
    )
    truth = true_step(bench.setting, first, visits[0])
    repeated = np.array([first.step, *(estimator.fit(visit).step for visit in visits[1:])])
    systematic = None if statement is None else statement.systematic
    # repeats of one campaign share what its station gets wrong: they cannot test that part
    shared = systematic is not None and systematic.any()
    return Estimate(
        mode=mode,
        identification=first,
        repeated=repeated,
        type_a=type_a(repeated).standard,
        comparison=compare(bench.setting, first, visits[0], truth, systematic=systematic),
        replications=(
            None
            if shared
            else replicate(bench, estimator, first, visits[0], truth, name, statement)
        ),
        statement=statement,
    )


BAND = 0.999
"""Probability of the bands in which an honest statement stays."""
COVERAGE = 0.95


def replicate(
    bench: Laboratory,
    estimator: Estimator,
    first: Identification,
    visited: Measurements,
    truth: Array,
    name: str,
    statement: Statement | None = None,
) -> Replications | None:
    """Replicate the calibration of one trial; None if the scenario asks for none.

    What is believed of the first visit is judged as a region of that size about each replicated
    point: the proof behind it is not repeated.

    Nor are fits with a prior replicated: one robot's repeats cannot show what a prior is worth.
    """
    count, setting = bench.scenario.uncertainty.replications, bench.setting
    if not count or first.prior is not None:
        return None
    p_true = target_points(setting.test_true, setting.target)
    # each pose once, in the order in which it was visited first
    once = np.sort(np.unique(visited.pose_id, return_index=True)[1])
    q, pose_id = visited.q[once], visited.pose_id[once]
    hung = visited.conditions.rows(once).payload
    believed = None
    if statement is not None and statement.belief is not None:
        believed = statement.belief.regions(
            setting.test_q, target=setting.target, at=in_turn(setting.test_q)
        )
    played = []
    for k in range(count):
        seen = bench.measure(q, pose_id, "replication", name, repeat=k, payload=hung)
        found = estimator.fit(seen, first.parameters)
        point, _, covariance = target_prediction(
            found.model, setting.test_q, setting.target, found.full_covariance
        )
        nees = float(mahalanobis_squared(found.step - truth, found.covariance))
        held = inside(p_true - point, covariance[:, :3, :3])
        error = point_distances(p_true, point)
        again = held if believed is None else replace(believed, position=point).holds(p_true)
        played.append((found.step, found.standard_uncertainty, nees, error, held, again))
    f = len(truth)
    steps, stated, all_nees, errors, hits, again = map(np.array, zip(*played, strict=True))
    return Replications(
        count=count,
        nees=all_nees,
        parameter_coverage=(np.abs(steps - truth) <= INTERVAL * stated).mean(axis=0),
        tool_coverage=hits.mean(axis=0),
        region_coverage=None if believed is None else again.mean(axis=0),
        sd_ratio=stated.mean(axis=0) / steps.std(axis=0, ddof=1),
        mean_error=errors.mean(axis=1),
        nees_band=chi_square_mean_band(f, count),
        # one alarm in a thousand campaigns for all parameters together, not for each
        coverage_band=binomial_band(count, probability=1 - (1 - BAND) / f),
    )


def chi_square_mean_band(freedom: int, count: int, probability: float = BAND) -> Array:
    """Band (2,) of the mean of `count` chi-square values with `freedom` degrees of freedom."""
    tail = (1 - probability) / 2
    return np.array([chdtri(freedom * count, p) / count for p in (1 - tail, tail)])


def binomial_band(count: int, expected: float = COVERAGE, probability: float = BAND) -> Array:
    """Band (2,) of the share of `count` independent intervals that hold what they should."""
    below = bdtr(np.arange(count + 1.0), count, expected)
    tail = (1 - probability) / 2
    return np.array([np.searchsorted(below, tail), np.searchsorted(below, 1 - tail)]) / count


JUDGES = 200
"""Poses that judge statements: the validation poses, on which these rest, cannot."""


def validation_visit(scenario: Scenario, setting: Setting) -> Validation:
    """Measure the held-out poses, draw the judging ones, and take the truth apart.

    Streams of its own: no number of a trial moves.
    """
    bench = open_laboratory(scenario, setting)
    start = validation_start(scenario)
    ids = np.arange(len(setting.test_q))
    seen = bench.measure(setting.test_q, ids, "validation", "visit", start=start, distances=False)
    judges = bench.candidates().draw(
        stream(scenario.seed, "validation", "judges"),
        size=JUDGES,
        exclude=np.concatenate([setting.pool_q, setting.test_q]),
    )
    moves = stream(scenario.seed, "validation", "moves")
    time, previous = journey(setting.test_q, start, bench.tracker.pose_time)
    budget = truth_budget(
        bench.robot, scenario.truth, scenario.seed, setting.test_q, time=time, previous=previous
    )
    return Validation(
        seen=seen,
        judge_q=judges.q,
        judge_true=target_points(bench.held_out(judges.q), setting.target),
        judge_moved=target_points(bench.held_out(judges.q, rng=moves), setting.target),
        terms=budget.names,
        term_rms=budget.rms_mm / 1e3,
        together_rms=budget.together_rms_mm / 1e3,
        interaction_rms=budget.interaction_mm / 1e3,
    )
