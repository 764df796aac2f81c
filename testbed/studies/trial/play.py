"""A trial played: selected, measured, identified, compared; beside the trials the validation visit.

With the judging poses.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.design import METHODS, Problem, Selection, best_of_random, detmax
from calib.geometry.frames import target_points
from calib.identification.identify import Identification, Mode
from calib.identification.many.tables import ManyTables
from calib.information.criteria import NEEDS_GOALS
from calib.information.criteria.base import Criterion
from calib.information.criteria.named import criterion_named
from calib.information.observability import Observability, indices
from calib.information.rank import singular_values
from calib.measurement.observations import Measurements
from calib.uncertainty.type_a import type_a
from testbed.laboratory.goal import goals_of, wants_goals
from testbed.laboratory.truth.budget import truth_budget
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import (
    Setting,
    held_out_conditions,
    journey,
    make_setting,
    validation_start,
)
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import TrialSettings
from testbed.streams import stream
from testbed.studies.trial.compare import compare, true_step
from testbed.studies.trial.estimator import Estimator, estimator_for
from testbed.studies.trial.records import Estimate, Trial
from testbed.studies.trial.replications import replicate
from testbed.studies.trial.statement.records import Validation
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
    truth = true_step(bench.setting, first, visits[0], bench.truth.unmodelled)
    repeated = np.array([first.step, *repeats(estimator, first, visits[1:])])
    systematic = None if statement is None else statement.systematic
    # repeats of one campaign share what its station gets wrong: they cannot test that part
    shared = systematic is not None and systematic.any()
    return Estimate(
        mode=mode,
        identification=first,
        repeated=repeated,
        type_a=type_a(repeated).standard,
        comparison=compare(
            bench.setting,
            first,
            visits[0],
            truth,
            systematic=systematic,
            at=held_out_conditions(bench.scenario, bench.setting.test_q),
        ),
        replications=(
            None
            if shared
            else replicate(bench, estimator, first, visits[0], truth, name, statement)
        ),
        statement=statement,
    )


def repeats(estimator: Estimator, first: Identification, visits: Sequence[Measurements]) -> Array:
    """Steps (v, f) identified from further visits of the poses of a first one [m, rad]."""
    tables = ManyTables.alike(visits)
    fits = None if tables is None else estimator.fit_many(tables, first)
    if fits is None:
        return np.array([estimator.fit(visit).step for visit in visits])
    return fits.steps


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
    way = journey(setting.test_q, start, bench.tracker.pose_time)
    budget = truth_budget(
        bench.robot, scenario.truth, scenario.seed, setting.test_q, **way._asdict()
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
