"""Indices of random pose sets: against their size, and beside those of the designed sets."""

import numpy as np

from calib.design import PoseCount, Problem, pose_count, random_sets
from calib.information.observability import CRITERIA, Form
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import Setting
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.protocol import Records
from testbed.studies.trial.play import criterion_of
from testbed.studies.trial.records import Trial
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets, RandomSetsStudy

SPARE_POSES = 2
"""Poses beyond the fewest where the curves begin."""


def pose_count_study(scenario: Scenario, setting: Setting) -> PoseCountStudy:
    """Mean index of random sets against their size, in the paper's rows where poses are full."""
    bench = open_laboratory(scenario, setting)
    rows = bench.usual_rows
    blocks = bench.design_blocks(rows)
    largest = min(scenario.studies.pose_count_max, len(blocks))
    # with fewer poses some random sets are singular to rounding, and the printed O5 is infinite
    problem = Problem.of_blocks(blocks, len(blocks), "D")
    sizes = range(problem.fewest + SPARE_POSES, largest + 1)

    def curves(form: Form) -> tuple[PoseCount, ...]:
        rng = stream(scenario.seed, "pose_count")  # the same random sets in every form
        return pose_count(problem, rng, counts=sizes, form=form)

    printed, per_pose = curves("printed"), curves("per_pose")
    return PoseCountStudy(
        counts=printed[0].counts,
        names=CRITERIA,
        mean=np.array([curve.mean for curve in printed]),
        mean_per_pose=np.array([curve.mean for curve in per_pose]),
        spread=np.array([curve.sd for curve in printed]),
        chosen=tuple(curve.chosen for curve in per_pose[:2]),
    )


def random_sets_study(scenario: Scenario, setting: Setting, needed: Records) -> RandomSetsStudy:
    """Each designed trial's figure beside that of random sets of the same size."""
    bench, sets = open_laboratory(scenario, setting), []
    for settings in scenario.designed:
        blocks, criterion = bench.design_blocks(settings.rows), criterion_of(bench, settings)
        drawn = random_sets(
            Problem.of_blocks(blocks, settings.poses, criterion),
            stream(scenario.seed, "random_sets", settings.name),
            sets=scenario.studies.random_sets,
        )
        trial, known = needed.get(settings.name, Trial), np.isfinite(drawn.values)
        known &= drawn.values > 0  # the worst there is: a number is undetermined
        sets.append(
            RandomSets(
                trial=settings.name,
                criterion=settings.criterion,
                unit=criterion.unit if settings.rows == "whitened" else "1",
                larger_is_better=criterion.larger_is_better,
                n_poses=settings.poses,
                chosen_value=trial.selection.value,
                values=drawn.values[known],
                undetermined=int((~known).sum()),
            )
        )
    return RandomSetsStudy(tuple(sets))
