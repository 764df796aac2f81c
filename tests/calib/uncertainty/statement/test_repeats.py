"""Repeats: the noise they show, how well joints come back, and what a burst is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib.geometry.model import RobotModel
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import joined
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.repeats import joint_scatter, noise_repeats
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
SD = np.full(6, 30e-6)


def visited(rng, times, poses=20, scatter=0.0):
    """Visits of the same poses, joints coming back within `scatter` times `SD`."""
    q, tables = kinds.joints("tx60", rng, poses), []
    for k in range(times):
        moved = q + scatter * SD * rng.normal(size=q.shape)
        seen = kinds.poses(TX60, moved, rng)
        tables.append(replace(seen, q=q, pose_id=np.arange(poses), repeat=np.full(poses, k)))
    return joined(tables)


def test_squares_about_the_means_are_those_of_textbooks():
    """Equal covariances: the pooled variance; against numpy's own, pose by pose."""
    rng = np.random.default_rng(1)
    table = visited(rng, 3)
    same = replace(table, covariance=np.broadcast_to(table.covariance[0], (60, 6, 6)))
    told = noise_repeats(TX60, same)
    N = same.covariance[0, :3, :3]
    y = same.position.reshape(3, 20, 3)
    square = 0.0
    for pose in range(20):
        apart = y[:, pose] - y[:, pose].mean(axis=0)
        square += np.trace(apart @ np.linalg.solve(N, apart.T))
    assert told.degrees_of_freedom == 120
    # differences of metres: 1e-16 of them against 1e-5 of noise
    assert told.sum_of_squares == pytest.approx(square, rel=1e-8)


def test_squares_scatter_as_chi_square_with_unequal_covariances_too():
    rng = np.random.default_rng(2)
    table = visited(rng, 4)
    factor = rng.uniform(0.5, 3.0, len(table))
    position = TX60.poses(table.q)[:, :3, 3]
    noise = (table.position - position) * factor[:, None]
    uneven = replace(
        table, position=position + noise, covariance=table.covariance * factor[:, None, None] ** 2
    )
    told = noise_repeats(TX60, uneven)
    assert told.degrees_of_freedom == 180
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 180)
    assert low < told.sum_of_squares < high
    # the mean of each pose does not matter: a robot that is wrong everywhere scatters alike
    off = replace(uneven, position=uneven.position + 0.01 * table.q[:, :3])
    assert noise_repeats(TX60, off).sum_of_squares == pytest.approx(told.sum_of_squares, rel=1e-6)


def test_few_repeats_tell_nothing():
    rng = np.random.default_rng(3)
    table = visited(rng, 2, poses=20)
    assert noise_repeats(TX60, table.rows(np.arange(20))) is None
    assert noise_repeats(TX60, table.rows(np.arange(29))) is None  # 27 degrees of freedom
    assert noise_repeats(TX60, table.rows(np.arange(30))).degrees_of_freedom == 30


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.0, 1.0, 3.0])
def test_how_well_joints_come_back_is_found(scatter):
    rng = np.random.default_rng(4)
    found = []
    for _ in range(12):
        table = visited(rng, 3, scatter=scatter)
        own = table.covariance[:, :3, :3]
        moved = with_joint_noise(TX60, table.q, np.zeros((len(table), 6, 6)), SD)[:, :3, :3]
        found.append(joint_scatter(TX60, table, own, moved))
    best, upper = np.array(found).T
    assert (upper >= scatter).mean() >= 9 / 12  # 95 % each: 8 or fewer of 12 once in 5000
    if scatter:
        assert best.mean() == pytest.approx(scatter, rel=0.15)
        assert (upper > best).all()
    else:
        assert best.mean() < 0.4
    assert joint_scatter(TX60, table.rows(np.arange(20)), own[:20], moved[:20]) is None


def with_wrong_shots(table, rows):
    """The same with a millimeter more in some readings."""
    position = table.position.copy()
    position[rows] += 1e-3 / np.sqrt(3)
    return replace(table, position=position)


@pytest.mark.parametrize("times", [2, 3])
def test_a_few_wrong_shots_are_no_noise_of_all(times):
    """As of a real UR10: two shots a millimeter off, of 1493, tripled the noise of 291 pairs."""
    rng = np.random.default_rng(4)
    table = visited(rng, times, poses=60, scatter=1.0)
    told = noise_repeats(TX60, with_wrong_shots(table, [7, 11]))
    others = table.rows(~np.isin(table.pose_id, [7, 11]))
    plain = noise_repeats(TX60, others)
    assert told.degrees_of_freedom == 58 * 3 * (times - 1)
    # the same sums of the same rows
    assert told.sum_of_squares == pytest.approx(plain.sum_of_squares, rel=1e-12)
    moved = with_joint_noise(TX60, table.q, np.zeros((len(table), 6, 6)), SD)[:, :3, :3]
    own, kept = table.covariance[:, :3, :3], ~np.isin(table.pose_id, [7, 11])
    of_all = joint_scatter(TX60, with_wrong_shots(table, [7, 11]), own, moved)
    assert of_all == pytest.approx(joint_scatter(TX60, others, own[kept], moved[kept]))


def test_good_repeats_all_count_however_wrong_the_stated_noise_is():
    """By chance a pose is left out in one of 1e4 tables: in 200, in none."""
    rng = np.random.default_rng(5)
    q = kinds.joints("tx60", rng, 40)
    one, two = (
        replace(kinds.poses(TX60, q, rng), pose_id=np.arange(40), repeat=np.full(40, k))
        for k in range(2)
    )
    table, p = joined([one, two]), np.tile(TX60.poses(q)[:, :3, 3], (2, 1))
    root = np.linalg.cholesky(table.covariance[:, :3, :3])
    for k in range(200):
        noise = (root @ rng.standard_normal((80, 3, 1)))[..., 0] * (0.1, 1.0, 10.0)[k % 3]
        told = noise_repeats(TX60, replace(table, position=p + noise))
        assert told.degrees_of_freedom == 120


def test_the_scale_of_the_noise_is_known_as_the_likelihood_of_the_repeats_curves():
    """Standard deviation 1 / sqrt(2 nu): second differences of minus the log-likelihood."""
    repeats = NoiseRepeats(60.0, 75.0)
    step = 1e-3
    low, middle, high = repeats.against(repeats.log_scale + step * np.array([-1.0, 0.0, 1.0]))
    assert middle < min(low, high)
    curvature = (low - 2 * middle + high) / step**2
    # rounding: 1e-14 of some 50 over 1e-6
    assert repeats.log_scale_sd == pytest.approx(curvature**-0.5, rel=1e-5)
