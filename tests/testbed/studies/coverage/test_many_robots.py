"""Robots of a study computed together: the record of each is that of one robot after the other."""

import numpy as np
import pytest

from calib.uncertainty.regions import coverage_factor, inside
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.streams import stream
from testbed.studies import load_scenario
from testbed.studies.coverage.errors import many_parameter_errors, parameter_errors
from testbed.studies.coverage.judge import regions_hold
from testbed.studies.coverage.play import gather, many_models, play_robot, play_robots
from testbed.studies.coverage.visits import measure_robots, poses_of
from testbed.studies.trial.play import criterion_of, select

NEAR = {"rtol": 1e-9, "atol": 0.0}
KINDS = ("rigid", "wen2022", "soft", "elastic", "unmodelled")


def begun(**smaller):
    """Scenario, setting, laboratory and the first trial's selection."""
    scenario = changed(load_scenario("coverage"), smaller)
    setting = make_setting(scenario)
    laboratory, trial = open_laboratory(scenario, setting), scenario.trial[0]
    chosen = select(
        laboratory.design_blocks(trial.rows), trial,
        stream(scenario.seed, "select", trial.name), criterion_of(laboratory, trial),
    )  # fmt: skip
    return scenario, setting, laboratory, chosen


class Selected:
    """What a study asks of a trial."""

    def __init__(self, selection):
        self.selection = selection


def held_to_each(robots, kinds, **smaller):
    """Every figure of some robots of some kinds against those of each alone."""
    scenario, setting, laboratory, chosen = begun(**smaller)
    found = play_robots(scenario, setting, kinds, Selected(chosen), range(robots))
    for kind in kinds:
        one = found[kind]
        alone = gather([play_robot(laboratory, kind, chosen.indices, k) for k in range(robots)])
        assert one.names == alone.names
        for name in ("extended", "flagged", "converged"):
            np.testing.assert_array_equal(getattr(one, name), getattr(alone, name))
        # counts of points, and chances from counts of permutations
        for name in ("inside", "believed", "p_drift"):
            np.testing.assert_array_equal(getattr(one, name), getattr(alone, name))
        # sums of squares over readings of micrometres at meters, and what their tails magnify
        for name in ("radius", "growth", "mean_error", "before", "nees"):
            np.testing.assert_allclose(getattr(one, name), getattr(alone, name), **NEAR)
        for name in ("p_value", "held_out_p"):
            np.testing.assert_allclose(
                getattr(one, name), getattr(alone, name), rtol=1e-7, atol=1e-12
            )
        np.testing.assert_allclose(one.normal_error, alone.normal_error, rtol=0, atol=1e-9)
        np.testing.assert_allclose(one.log_evidence, alone.log_evidence, rtol=1e-9, atol=1e-8)


def test_robots_together_are_those_of_each():
    small = {"pool.size": 60, "test.poses": 20, "coverage.validation_poses": 20}
    held_to_each(2, ("rigid", "soft", "elastic"), **small)


@pytest.mark.study
def test_eight_robots_of_five_kinds_are_those_of_each():
    """As the shipped scene has them."""
    held_to_each(8, KINDS)


def test_errors_of_numbers_are_those_against_each_true_step():
    """One fit of the noise-free calibration poses, against one of 200 poses of the pool each."""
    small = {"pool.size": 60, "test.poses": 20, "coverage.validation_poses": 20}
    _, _, laboratory, chosen = begun(**small)
    robots = range(3)
    poses = [poses_of(laboratory, k) for k in robots]
    for kind in ("rigid", "wen2022"):
        measured = measure_robots(laboratory, kind, chosen.indices, robots, poses)
        fits = [one[0][0] for one in many_models(measured, laboratory.ladders)]
        for k, found in enumerate(many_parameter_errors(fits, measured)):
            alone = parameter_errors(fits[k], measured[k])
            assert (found is None) == (alone is None) == (kind == "wen2022")
            if found is not None:
                np.testing.assert_allclose(found[0], alone[0], rtol=0, atol=1e-9)
                assert found[1] == pytest.approx(alone[1], rel=1e-9)


def test_regions_of_many_robots_hold_what_each_holds():
    """By factors written out, and where a region is flat or a point, by its axes."""
    rng = np.random.default_rng(8)
    root = rng.normal(size=(6, 50, 3, 3)) * [1.0, 0.1, 0.01]
    root[1, :5, :, 2], root[2, :5] = 0.0, 0.0
    error = (root @ rng.normal(size=(6, 50, 3, 1)))[..., 0] * 1.4
    covariance, factor = root @ np.swapaxes(root, 2, 3), rng.uniform(2, 4, 6)
    found, radius = regions_hold(error, covariance, factor, 0.95)
    stretch = (factor / coverage_factor(3, 0.95)) ** 2
    own = inside(error, stretch[:, None, None, None] * covariance, probability=0.95)
    np.testing.assert_array_equal(found, own)
    assert 0.3 < own.mean() < 0.99
    # of as much volume: the square root of the product of three variances, of which nothing cancels
    sizes = np.prod(np.linalg.svd(root, compute_uv=False), axis=2) ** (1 / 3)
    np.testing.assert_allclose(radius, factor[:, None] * sizes, rtol=1e-6, atol=1e-9)
