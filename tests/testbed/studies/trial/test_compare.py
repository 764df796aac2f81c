"""Identified against true: by hand, by brute force, and where the answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from calib.identification.identify import identify
from calib.identification.many.fit import fit_many
from calib.measurement import tables
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.compare import (
    compare,
    held_by_repeats,
    noise_free,
    target_prediction,
    true_step,
)
from testbed.studies.trial.replications import binomial_band, chi_square_mean_band
from tests import campaign


def bench_of(name="quick", **changes):
    scenario = changed(load_scenario(name), {"pool.size": 60, "test.poses": 15, **changes})
    return open_laboratory(scenario, campaign.compute(scenario, "setting", None))


def identified(bench, count=30, mode="whitened"):
    seen = bench.measure_pool(np.arange(count), "test")
    return identify(bench.setting.nominal, seen, bench.free(mode), mode=mode), seen


def test_the_true_step_of_the_perturbed_numbers_is_what_was_drawn():
    bench = bench_of()
    found, seen = identified(bench, mode="paper")
    step = bench.setting.nominal.step_to(bench.setting.true)
    # the refit is exact to the rounding of a pose
    assert np.abs(true_step(bench.setting, found, seen) - step[found.parameters.free]).max() < 1e-12


@pytest.mark.parametrize("frames", [0.0, 0.1])
def test_in_any_gauge_the_true_step_predicts_the_true_robot(frames):
    bench = bench_of(**{"truth.frame_sd_mm": frames, "truth.frame_sd_deg": frames})
    found, seen = identified(bench)
    step = true_step(bench.setting, found, seen)
    model = bench.setting.nominal.moved(found.parameters.expand(step))
    q = bench.setting.pool_q
    assert np.abs(model.poses(q) - bench.truth.poses(q)).max() < 1e-12


def test_a_reflector_sees_its_true_step_too():
    bench = bench_of("position_only")
    found, seen = identified(bench)
    step = true_step(bench.setting, found, seen)
    model = bench.setting.nominal.moved(found.parameters.expand(step))
    q, target = bench.setting.test_q, bench.setting.target
    at = [T[:, :3, 3] + T[:, :3, :3] @ target for T in (model.poses(q), bench.truth.poses(q))]
    assert np.abs(at[0] - at[1]).max() < 1e-12


def test_errors_are_those_of_one_pose_at_a_time():
    bench = bench_of("position_only")
    found, seen = identified(bench)
    judged = compare(bench.setting, found, seen, true_step(bench.setting, found, seen))
    target = np.r_[bench.setting.target, 1]
    for k, q in enumerate(bench.setting.test_q):
        true = bench.truth.poses(q[None])[0] @ target
        for model, error in ((bench.setting.nominal, judged.before), (found.model, judged.after)):
            stated = model.poses(q[None])[0] @ target
            assert error[k] == pytest.approx(np.linalg.norm((true - stated)[:3]), abs=1e-15)
        vector, C = judged.error[k], judged.covariance[k, :3, :3]
        distance = vector @ np.linalg.solve(C, vector)
        assert judged.inside[k] == (distance <= stats.chi2.ppf(0.95, 3))
    wrong = found.step - judged.true_step
    assert judged.nees == pytest.approx(wrong @ np.linalg.solve(found.covariance, wrong), rel=1e-6)


def test_the_covariance_of_the_target_is_that_of_moved_models():
    bench = bench_of("position_only")
    found, _ = identified(bench)
    q, target = bench.setting.test_q[:4], bench.setting.target
    _, _, covariance = target_prediction(found.model, q, target, found.full_covariance)
    rng, points = np.random.default_rng(0), []
    draws = rng.multivariate_normal(np.zeros(found.rank), found.covariance, 4000)
    for draw in draws:
        T = found.model.moved(found.parameters.expand(draw)).poses(q)
        points.append(T[:, :3, 3] + T[:, :3, :3] @ target)
    sampled = np.array(points).var(axis=0, ddof=1)
    # a variance of 4000 draws is known to sqrt(2/4000) = 2.2 %; five of those
    expected = np.diagonal(covariance[:, :3, :3], axis1=1, axis2=2)
    assert sampled == pytest.approx(expected, rel=0.11)


def test_noise_free_measurements_are_the_poses_of_the_model():
    bench = bench_of()
    seen = bench.measure_pool(np.arange(10), "test")
    q = bench.setting.test_q
    table = noise_free(bench.setting.true, seen, q)
    np.testing.assert_array_equal(table.covariance, [seen.covariance[0]] * 15)
    T = bench.setting.true.poses(q)
    same = tables.poses(q, T, sd=table.covariance)
    assert np.array_equal(table.position, same.position)
    assert np.array_equal(table.rotation, same.rotation)


@pytest.mark.parametrize(
    ("count", "probability"), [(60, 0.999), (200, 0.999), (200, 1 - 1e-3 / 30)]
)
def test_bands_are_those_of_scipy(count, probability):
    tail = (1 - probability) / 2
    expected = stats.binom.ppf([tail, 1 - tail], count, 0.95) / count
    assert np.array_equal(binomial_band(count, probability=probability), expected)
    band = chi_square_mean_band(24, count, probability)
    assert band == pytest.approx(stats.chi2.ppf([tail, 1 - tail], 24 * count) / count, rel=1e-9)


def test_an_interval_by_five_repeats_holds_the_numbers_of_another_calibration_in_95_percent():
    """300 virtual laboratories repeat five times each; the normal factor would hold 88 %."""
    bench, groups, repeats = bench_of(), 300, 5
    free, first = bench.free("paper"), np.arange(29)
    tables = bench.visits(
        bench.setting.pool_q[first][None], "test", "repeats", count=groups * repeats
    )
    fits = fit_many(bench.setting.nominal, tables, free, mode="paper")
    found, seen = identified(bench, 29, mode="paper")
    truth = true_step(bench.setting, found, seen)
    steps = fits.steps.reshape(groups, repeats, -1)
    s = steps.std(axis=1, ddof=1)

    def shares(judged):
        """Of numbers held, by laboratory."""
        held = []
        for k in range(groups):
            one = SimpleNamespace(
                comparison=SimpleNamespace(true_step=truth),
                identification=SimpleNamespace(step=judged[k]),
                repeated=steps[k],
                type_a=s[k],
            )
            inside, factor = held_by_repeats(one)
            assert factor == pytest.approx(stats.t.ppf(0.975, repeats - 1), rel=1e-12)
            held.append(inside.mean())
        return np.array(held)

    other = shares(np.roll(steps[:, 0], 1, axis=0))
    # laboratories are independent, numbers of one are not: the scatter of the mean is measured
    assert other.mean() == pytest.approx(0.95, abs=4 * other.std() / np.sqrt(groups))
    normal = (np.abs(np.roll(steps[:, 0], 1, axis=0) - truth) <= 1.96 * s).mean()
    assert normal < 0.9
    # one of the five is nearer to their mean than another one: 99 % of a normal number's draws
    draws = np.random.default_rng(7).normal(size=(100_000, repeats))
    near = np.abs(draws[:, 0]) <= stats.t.ppf(0.975, repeats - 1) * draws.std(axis=1, ddof=1)
    own = shares(steps[:, 0])
    assert own.mean() == pytest.approx(near.mean(), abs=4 * own.std() / np.sqrt(groups))
