"""The least misfit that readings would show: its power, and poses that are read many times."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from calib.calibration import calibrate
from calib.geometry.model import RobotModel
from calib.measurement.observations import joined
from calib.uncertainty.statement.evidence import POWER, SEEN, detectable
from calib.uncertainty.statement.misfit import misfit
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])
STEP = 10 ** (12 / 2000 / 2)
"""Of the sizes that are tried."""


def test_of_rows_alike_it_is_the_size_of_the_plain_score_test():
    rng = np.random.default_rng(1)
    lam = rng.uniform(0.6, 1.8, 210)

    def lacks(t):
        noise = norm.isf(SEEN) * np.sqrt(2 * (lam**2).sum())
        noise += norm.ppf(POWER) * np.sqrt(2 * (lam**2 * (1 + t * lam) ** 2).sum())
        return np.sqrt(1 - 30 / 210) * t * (lam**2).sum() - noise

    size = np.sqrt(brentq(lacks, 1e-3, 1e3))
    assert size <= detectable(lam, 30) <= STEP * size


def test_a_pose_read_many_times_hides_no_misfit():
    """Of a TX60 with 45 poses, and with one of them read up to 20 times more."""
    rng = np.random.default_rng(1)
    true = TX60.moved(3e-4 * rng.normal(size=TX60.n_numbers))
    table = kinds.poses(true, kinds.joints("tx60", rng, 70), rng)
    train, test = table.rows(np.arange(45)), table.rows(np.arange(45, 70))
    sizes = []
    for n in (0, 3, 6, 9, 20):
        more = kinds.poses(true, np.repeat(train.q[:1], n, axis=0), rng)
        more = replace(more, pose_id=np.full(n, train.pose_id[0]), repeat=1 + np.arange(n))
        both = joined([train, more]) if n else train
        sizes.append(misfit(calibrate(TX60, both).identification, both, test).detectable)
    # the identified robot, at which all is derived, moves by a little
    assert max(sizes) <= 1.01 * STEP * sizes[0]
    assert min(sizes) >= 0.95 * sizes[0]


def test_readings_never_hide_a_misfit_that_shows_without_them():
    """Some poses of sets of any size, read up to sixty times."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        n = int(rng.integers(60, 600))
        lam, again = np.exp(rng.normal(0, 0.4, n)), np.ones(n)
        again[: rng.integers(1, rng.choice([12, n + 1]))] = rng.integers(1, 60)
        # the best limit lies between those that are tried
        assert detectable(again * lam, 27) <= 1.02 * detectable(lam, 27)


@pytest.mark.parametrize("n", [120, 400])
def test_it_is_found_about_as_often_as_promised(n):
    """Played: three rows of thirty times the information, with more noise than they have."""
    rng, draws = np.random.default_rng(3), 10000
    lam = rng.uniform(0.6, 1.6, n)
    lam[:3] *= 30
    counts = np.minimum(lam, 2 * np.median(lam))

    def scores(t):
        y = rng.normal(size=(draws, n)) * np.sqrt(1 + t * lam)
        part = counts / lam
        y = np.sqrt(part) * y + np.sqrt(1 - part) * rng.normal(size=(draws, n))
        return (y**2 - 1) @ counts

    limit = np.quantile(scores(0.0), 1 - SEEN)
    # a sum of squares has a longer tail than the normal law of the formula: 95 % become 92 %
    assert (scores(detectable(lam, 0) ** 2) > limit).mean() > 0.9


def test_too_few_rows_show_nothing():
    assert np.isnan(detectable(np.ones(20), 27))
    assert np.isnan(detectable(np.zeros(60), 27))
    assert np.isnan(detectable(np.zeros(0), 27))
