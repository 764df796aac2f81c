"""The same pose sets on many virtual robots, since results on one robot depend on luck.

Poses of one robot share its parameter error, so the robot is the unit of every statement. All
trials use the same robots; comparisons between them are made in pairs. A designed set is the same
for every robot, as in practice, since it was chosen on the nominal one. A random set is drawn anew
for each.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, Index
from calib.design import random_selection
from calib.design.blocks import information
from calib.geometry.frames import target_points
from calib.information.criteria.base import Criterion
from calib.information.criteria.linear import v_of
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import point_distances
from calib.uncertainty.regions import inside
from testbed.laboratory.goal import goals_of
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import Setting, held_out_conditions
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.many_robots import alone, together
from testbed.studies.pose_sets.compare import PopulationStudy
from testbed.studies.pose_sets.together import judged, numbers_of, true_points, true_robots
from testbed.studies.trial.compare import target_prediction
from testbed.studies.trial.estimator import estimator_for
from testbed.studies.trial.records import Trial
from testbed.studies.trial.statement.sources import systematic_covariance

AXES = dict.fromkeys(("mean_error", "rms_error", "stated_u", "inside", "before", "goal_u"), -1)


def play_robots(
    scenario: Scenario, setting: Setting, trials: Sequence[Trial], robots: range
) -> PopulationStudy:
    """Play every trial's pose set on some robots."""
    laboratory = open_laboratory(scenario, setting)
    blocks, goal = laboratory.design_blocks("whitened"), v_of(goals_of(laboratory))
    found = play_together(laboratory, trials, blocks, goal, robots)
    if found is not None:
        return found
    return gather([play_robot(laboratory, trials, blocks, goal, k) for k in robots])


def gather(parts: Sequence[PopulationStudy]) -> PopulationStudy:
    """The robots of all parts."""
    return together(parts, AXES)


def play_robot(
    laboratory: Laboratory, trials: Sequence[Trial], blocks: Array, goal: Criterion, robot: int
) -> PopulationStudy:
    """Play every trial's pose set on one robot.

    Parameters
    ----------
    laboratory : Laboratory
        Laboratory of the campaign; its robot is replaced.
    trials : sequence of Trial
        Trials whose pose sets are played.
    blocks : (N, r, p) array
        Whitened blocks of the pool.
    goal : Criterion
        V over the goal poses, by which the uncertainty that a set promises is computed.
    robot : int
        Number of the robot, from 0.
    """
    scenario = laboratory.scenario
    own = laboratory.with_robot(scenario.truth, "population", "robot", robot)
    q, target = own.setting.test_q, own.setting.target
    true = target_points(own.held_out(q), target)
    sets = [set_for(own, trial, robot) for trial in trials]
    judged = [
        _judged(own, trial.name, chosen, robot, true)
        for trial, chosen in zip(trials, sets, strict=True)
    ]
    mean, rms, stated, held = np.moveaxis(np.array(judged), -1, 0)
    return PopulationStudy(
        trials=tuple(trial.name for trial in trials),
        **alone(
            AXES,
            mean_error=mean,
            rms_error=rms,
            stated_u=stated,
            inside=held,
            before=point_distances(
                true, target_points(own.setting.nominal.poses(q), target)
            ).mean(),
            goal_u=[goal.figure(information(blocks[chosen]), len(chosen)) for chosen in sets],
        ),
    )


def play_together(
    laboratory: Laboratory,
    trials: Sequence[Trial],
    blocks: Array,
    goal: Criterion,
    robots: Sequence[int],
) -> PopulationStudy | None:
    """Play the trials on some robots at once; None if robots have to be played one by one."""
    truth = laboratory.scenario.truth
    owns = [laboratory.with_robot(truth, "population", "robot", robot) for robot in robots]
    arms = true_robots(owns)
    if arms is None:
        return None
    setting, free = owns[0].setting, numbers_of(owns[0])
    true = true_points(arms, setting.test_q, setting.target)
    figures, promised = [], []
    for trial in trials:
        sets = [set_for(own, trial, robot) for own, robot in zip(owns, robots, strict=True)]
        found = judged(owns, arms, trial.name, sets, robots, true, free, trial.method != "random")
        if found is None:
            return None
        figures.append(found)
        promised.append(_promises(blocks, goal, sets))
    mean, rms, stated, held = np.moveaxis(np.array(figures), 1, 0)
    nominal = target_points(setting.nominal.poses(setting.test_q), setting.target)
    return PopulationStudy(
        trials=tuple(trial.name for trial in trials),
        mean_error=mean,
        rms_error=rms,
        stated_u=stated,
        inside=held,
        before=np.linalg.norm(true - nominal, axis=2).mean(axis=1),
        goal_u=np.array(promised),
    )


def _promises(blocks: Array, goal: Criterion, sets: Sequence[Index]) -> Array:
    """RMS tool-point uncertainty (R,) at the goal that each set promises [m]."""
    found: dict[bytes, float] = {}
    for chosen in sets:
        if chosen.tobytes() not in found:
            found[chosen.tobytes()] = goal.figure(information(blocks[chosen]), len(chosen))
    return np.array([found[chosen.tobytes()] for chosen in sets])


def set_for(laboratory: Laboratory, trial: Trial, robot: int) -> Index:
    """Places (m,) in the pool of a trial's set for one robot."""
    chosen = trial.selection.indices
    if trial.method != "random":
        return chosen
    rng = stream(laboratory.scenario.seed, "population", "select", trial.name, robot)
    return random_selection(len(laboratory.setting.pool_q), len(chosen), rng)


def _judged(
    laboratory: Laboratory, name: str, chosen: Index, robot: int, true: Array
) -> list[tuple[float, float, float, float]]:
    """Mean and rms error, stated u and share inside, per estimator."""
    setting, out = laboratory.setting, []
    seen = laboratory.measure_pool(chosen, "population", name, repeat=robot)
    for mode in laboratory.scenario.identification.estimators:
        found = estimator_for(laboratory, mode, seen).fit(seen)
        shared = systematic_covariance(laboratory, found, seen)
        point, _, covariance = target_prediction(
            found.model,
            setting.test_q,
            setting.target,
            replace(found, covariance=found.covariance + shared).full_covariance,
            held_out_conditions(laboratory.scenario, setting.test_q),
        )
        error = point_distances(true, point)
        out.append(
            (
                float(error.mean()),
                float(np.sqrt(np.mean(error**2))),
                float(np.sqrt(np.mean(point_uncertainty(covariance) ** 2))),
                float(inside(true - point, covariance[:, :3, :3]).mean()),
            )
        )
    return out
