"""The same pose sets on many virtual robots: what one robot's luck would hide.

Poses of one robot share its parameter error, so the robot is the unit of every statement. All
trials meet the same robots; comparisons between them are made in pairs. A designed set is the same
for every robot, as in life: it was chosen on the nominal one. A random set is drawn anew for each.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from calib.arrays import Array, Index
from calib.design import random_selection
from calib.design.blocks import information
from calib.information.criteria.linear import v_of
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import distances, target_points
from calib.uncertainty.regions import inside
from testbed.laboratory.goal import goals_of
from testbed.laboratory.truth.laboratory import Laboratory, Setting, open_laboratory
from testbed.laboratory.truth.robot import draw_truth
from testbed.scenario.read import Scenario
from testbed.streams import stream
from testbed.studies.trial.compare import target_prediction
from testbed.studies.trial.estimator import estimator_for
from testbed.studies.trial.records import PopulationStudy, Trial
from testbed.studies.trial.statement.sources import full_covariance, systematic_covariance


def population_study(
    scenario: Scenario, setting: Setting, get: Callable[[str], Any]
) -> PopulationStudy:
    """Play every trial's pose set on `studies.population` further robots, one visit each."""
    bench, count = open_laboratory(scenario, setting), scenario.studies.population
    trials: list[Trial] = [get(trial.name) for trial in scenario.trial]
    shape = (len(trials), len(scenario.identification.estimators), count)
    mean, rms, stated, held = (np.zeros(shape) for _ in range(4))
    before, promised = np.zeros(count), np.zeros((len(trials), count))
    blocks, goal = bench.design_blocks("whitened"), v_of(goals_of(bench))
    nominal = target_points(setting.nominal.poses(setting.test_q), setting.target)
    for k in range(count):
        seed = int(stream(scenario.seed, "population", "robot", k).integers(2**62))
        other = bench.with_robot(draw_truth(bench.robot, scenario.truth, seed), seed)
        true = target_points(other.held_out(setting.test_q), setting.target)
        before[k] = distances(true, nominal).mean()
        for i, trial in enumerate(trials):
            chosen = set_for(bench, trial, k)
            promised[i, k] = goal.figure(information(blocks[chosen]), len(chosen))
            for j, judged in enumerate(_judged(other, trial.name, chosen, k, true)):
                mean[i, j, k], rms[i, j, k], stated[i, j, k], held[i, j, k] = judged
    names = tuple(trial.name for trial in trials)
    return PopulationStudy(names, mean, rms, stated, held, before, promised)


def set_for(bench: Laboratory, trial: Trial, robot: int) -> Index:
    """Places (m,) in the pool of a trial's set for one robot."""
    chosen = trial.selection.indices
    if trial.method != "random":
        return chosen
    rng = stream(bench.scenario.seed, "population", "select", trial.name, robot)
    return random_selection(len(bench.setting.pool_q), len(chosen), rng)


def _judged(
    bench: Laboratory, name: str, chosen: Index, robot: int, true: Array
) -> list[tuple[float, float, float, float]]:
    """Mean and rms error, stated u and share inside, per estimator."""
    setting, out = bench.setting, []
    seen = bench.measure_pool(chosen, "population", name, repeat=robot)
    for mode in bench.scenario.identification.estimators:
        found = estimator_for(bench, mode, seen).fit(seen)
        shared = systematic_covariance(bench, found, seen)
        point, _, covariance = target_prediction(
            found.model,
            setting.test_q,
            setting.target,
            full_covariance(found, found.covariance + shared),
        )
        error = distances(true, point)
        out.append(
            (
                float(error.mean()),
                float(np.sqrt(np.mean(error**2))),
                float(np.sqrt(np.mean(point_uncertainty(covariance) ** 2))),
                float(inside(true - point, covariance[:, :3, :3]).mean()),
            )
        )
    return out
