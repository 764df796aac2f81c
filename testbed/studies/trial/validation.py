"""The validation visit: the held-out poses measured once after the trials, and further judges."""

import numpy as np

from calib.measurement.accuracy import target_points
from testbed.laboratory.truth.budget import truth_budget
from testbed.laboratory.truth.laboratory import Setting, journey, open_laboratory, validation_start
from testbed.scenario.scenario import Scenario
from testbed.streams import stream
from testbed.studies.trial.statement.records import Validation

JUDGES = 200
"""Poses that judge statements: the validation poses, on which these rest, cannot."""


def validation_visit(scenario: Scenario, setting: Setting) -> Validation:
    """Measure the held-out poses, draw the judging ones, and take the truth apart.

    Streams of its own: no number of a trial moves.
    """
    bench = open_laboratory(scenario, setting)
    start = validation_start(scenario)
    seen = bench.measure(
        setting.test_q, np.arange(len(setting.test_q)), "validation", "visit", start=start
    )
    judges = bench.candidates().draw(
        stream(scenario.seed, "validation", "judges"),
        size=JUDGES,
        exclude=np.concatenate([setting.pool_q, setting.test_q]),
    )
    time, previous = journey(setting.test_q, start, bench.tracker.pose_time)
    budget = truth_budget(
        bench.robot, scenario.truth, scenario.seed, setting.test_q, time=time, previous=previous
    )
    return Validation(
        seen=seen,
        judge_q=judges.q,
        judge_true=target_points(bench.held_out(judges.q), setting.target),
        terms=budget.names,
        term_rms=budget.rms_mm / 1e3,
        together_rms=budget.together_rms_mm / 1e3,
        interaction_rms=budget.interaction_mm / 1e3,
    )
