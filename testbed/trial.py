"""One trial: a pose set is selected, visited, measured, identified and compared with the truth."""

import numpy as np

from calib.arrays import Array
from calib.design.sampling import best_of_random
from calib.design.selection import Selection
from calib.identification.identify import Mode
from calib.information.criteria.base import Criterion
from calib.information.criteria.named import NEEDS_GOALS, criterion_named
from calib.information.observability import Observability, indices, singular_values
from calib.measurement.observations import Measurements
from calib.uncertainty.type_a import type_a
from testbed.comparison import compare, true_step
from testbed.estimator import estimator_for
from testbed.goals import goals_of
from testbed.planning.design import METHODS
from testbed.records import Estimate, Setting, Trial
from testbed.records_statement import Validation
from testbed.replication import replicate
from testbed.scenario import Scenario, TrialSettings
from testbed.setting import Bench, open_bench
from testbed.statement import state
from testbed.streams import stream


def play_trial(scenario: Scenario, setting: Setting, validation: Validation, name: str) -> Trial:
    """Select, measure, identify and judge the trial called `name`."""
    settings = scenario.trial_named(name)
    bench = open_bench(scenario, setting)
    selection = select(
        bench.design_blocks(settings.rows),
        settings,
        stream(scenario.seed, "select", name),
        criterion_of(bench, settings),
    )
    chosen = selection.indices
    span = len(chosen) * bench.tracker.pose_time
    visits = [
        bench.measure_pool(chosen, "visit", name, repeat=k, start=k * span)
        for k in range(scenario.uncertainty.repeats)
    ]
    rows = "paper" if scenario.tracker.measures == "pose" else "whitened"
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


def criterion_of(bench: Bench, settings: TrialSettings) -> Criterion:
    """What a trial's set is chosen by, with the scenario's goal where it needs one."""
    goals = goals_of(bench) if settings.criterion in NEEDS_GOALS else None
    return criterion_named(settings.criterion, goals=goals)


def select(
    blocks: Array, settings: TrialSettings, rng: np.random.Generator, criterion: Criterion
) -> Selection:
    """The pose set of a trial from the blocks (N, r, p) of the pool."""
    if settings.method == "best_of_random":
        return best_of_random(blocks, settings.poses, criterion, rng, sets=settings.sets)
    return METHODS[settings.method](blocks, settings.poses, criterion, rng)


def observed(blocks: Array) -> Observability:
    """All indices of the poses whose blocks (m, r, p) are given."""
    return indices(singular_values(blocks.reshape(-1, blocks.shape[-1])), len(blocks))


def estimate(
    bench: Bench, mode: Mode, visits: list[Measurements], validation: Validation, name: str
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
        replications=None if shared else replicate(bench, estimator, first, visits[0], truth, name),
        statement=statement,
    )
