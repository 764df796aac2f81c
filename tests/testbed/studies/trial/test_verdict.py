"""The verdict: what makes a statement believable, and how often chance alone would break it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from testbed.studies.trial.verdict import NOTHING, judge
from tests.reported import played


def trial_of(**changes):
    small = {
        "pool.size": 80,
        "test.poses": 20,
        "uncertainty.repeats": 2,
        "uncertainty.replications": 40,
        "studies.random_sets": 0,
        "trial": [{"name": "one", "poses": 29, "method": "random"}],
    }
    return played("quick", {**small, **changes}).trials[0]


@pytest.fixture(scope="module")
def honest():
    return trial_of()


def test_a_rigid_robot_is_believed_and_the_papers_estimator_is_not(honest):
    default, paper = honest.estimates
    assert judge(honest, default).believable
    assert "this can be believed" in judge(honest, default).sentence
    verdict = judge(honest, paper)
    assert not verdict.believable
    assert "must not be believed" in verdict.sentence
    assert any("NEES" in reason for reason in verdict.reasons)


def test_residuals_unmask_sagging_joints_and_the_region_has_them():
    trial = trial_of(**{"truth.preset": "wen2022", "uncertainty.replications": 0})
    verdict = judge(trial, trial.estimates[0])
    assert verdict.believable
    assert "the stated region allows for it" in verdict.reasons[0]
    assert "the residuals contradict the stated noise" in verdict.reasons[1]
    assert "the believed region contains" in verdict.reasons[-1]


def test_a_model_that_nothing_contradicts_is_not_said_to_lack_something(honest):
    reasons = judge(honest, honest.estimates[0]).reasons
    assert not any("lacks something" in reason for reason in reasons)


def test_a_covariance_ten_times_too_small_is_caught_by_each_test_alone(honest):
    """Of a fit of which nothing else is stated."""
    estimate = replace(honest.estimates[0], statement=None)
    played = estimate.replications
    assert judge(honest, estimate).believable
    small = replace(played, nees=played.nees * 100)
    caught = judge(honest, replace(estimate, replications=small))
    assert not caught.believable
    # three digits say enough of it, thousands included
    mean = re.search(r"mean NEES of 40 replications is (\d+);", " ".join(caught.reasons))[1]
    assert int(mean) == float(f"{small.nees.mean():.3g}") > 1000
    short = replace(played, parameter_coverage=played.parameter_coverage * 0.2)
    assert not judge(honest, replace(estimate, replications=short)).believable
    outside = replace(played, tool_coverage=played.tool_coverage * 0.2)
    assert not judge(honest, replace(estimate, replications=outside)).believable


def test_the_believed_region_is_judged_by_replications_and_by_further_poses(honest):
    estimate = honest.estimates[0]
    played, told = estimate.replications, estimate.statement
    outside = replace(played, region_coverage=played.region_coverage * 0.2)
    assert judge(honest, replace(estimate, replications=outside)).contradicted
    few = replace(told, attained=np.minimum(told.attained, told.honest / 2))
    assert judge(honest, replace(estimate, statement=few)).contradicted
    nothing = replace(told, belief=None, point=None)
    verdict = judge(honest, replace(estimate, statement=nothing))
    assert verdict.mark == NOTHING
    assert not verdict.believable


@pytest.mark.truth
@pytest.mark.slow
@pytest.mark.parametrize("robots", [6, pytest.param(60, marks=pytest.mark.study)])
def test_chance_alone_hardly_ever_breaks_an_honest_statement(robots):
    """Two tests of 99.9 % each; of all robots together one alarm in a thousand is allowed."""
    believed = [
        judge(trial, trial.estimates[0]).believable
        for trial in (
            trial_of(**{"seed": seed, "identification.estimators": ["whitened"]})
            for seed in range(robots)
        )
    ]
    assert np.sum(believed) >= binom.ppf(0.001, robots, 0.999**2)
