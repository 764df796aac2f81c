"""The least misfit that readings would show: its power, and poses that are read many times."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm

from calib.calibration import calibrate
from calib.geometry.model import RobotModel
from calib.measurement.observations import joined
from calib.uncertainty.statement.evidence import POWER, SEEN, NoiseRepeats, PositionRows, detectable
from calib.uncertainty.statement.likelihood import DOUBT, likelihood
from calib.uncertainty.statement.misfit import misfit
from tests.calib import kinds

TX60 = RobotModel(kinds.ARMS["tx60"])


@pytest.mark.parametrize("doubt", [0.02, DOUBT, 1.0])
def test_it_is_where_the_expected_likelihood_gains_enough(doubt):
    """By scipy: the larger noise that explains a misfit best, and the size where it does not."""
    rng = np.random.default_rng(1)
    lam, share = rng.uniform(0.6, 1.8, 210), 1 - 30 / 210

    def lacks(t):
        """Root of the gain less what level and power ask for."""

        def without(L):
            return share * (2 * L + (1 + t * lam) * np.exp(-2 * L)).sum() + (L / doubt) ** 2

        best = minimize_scalar(
            without, bounds=(0.0, 5.0), method="bounded", options={"xatol": 1e-9}
        )
        gain = best.fun - share * (np.log(1 + t * lam) + 1).sum()
        pulls = np.exp(-2 * best.x) - 1 / (1 + t * lam)  # of each squared residual
        variance = share * (pulls**2 * 2 * (1 + t * lam) ** 2).sum()
        root = np.sqrt(max(gain, 1e-12))
        return root - norm.isf(SEEN) - norm.ppf(POWER) * np.sqrt(variance) / (2 * root)

    # sixteen halvings of a factor two: 1e-5 of the variance
    assert detectable(lam, 30, doubt) == pytest.approx(np.sqrt(brentq(lacks, 0.05, 1e3)), rel=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "p", "told"),
    [
        (120, 12, "on trust"),
        (210, 30, "by repeats"),
        (120, 12, "by rows"),
        pytest.param(210, 30, "on trust", marks=pytest.mark.study),
        pytest.param(120, 12, "by repeats", marks=pytest.mark.study),
        pytest.param(210, 30, "by rows", marks=pytest.mark.study),
    ],
)
def test_it_is_found_as_often_as_promised_by_the_likelihood_itself(n, p, told):
    """Played through `likelihood`, which knows the scale of the noise as a statement does."""
    rng, draws = np.random.default_rng(n), 200
    lam = rng.uniform(0.6, 1.8, n)
    repeats, doubt = None, DOUBT
    if told == "by repeats":
        repeats = NoiseRepeats(200.0, 200.0)
        doubt = repeats.log_scale_sd
    if told == "by rows":
        lam[: n // 2] = 0.0  # what readings of one pose differ by shows no misfit
        repeats, doubt = NoiseRepeats(n / 2, n / 2, in_evidence=True), np.inf
    size = detectable(lam, p, doubt)
    A = rng.normal(size=(n, p))
    seen = 0
    for _ in range(draws):
        y = rng.normal(size=n) * np.sqrt(1 + size**2 * lam)
        found = likelihood(PositionRows(A, y, lam, float(n)), 1.0, repeats)
        seen += 2 * (found.value.max() - found.value[0]) > norm.isf(SEEN) ** 2
    # 95 %, four standard errors of 200 draws beside it: 6 %
    assert seen / draws > 0.89


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
    # the identified robot, at which all is derived, moves by a little; readings of one pose tell
    # the scale of the noise as well, and then less shows
    assert max(sizes) <= 1.01 * sizes[0]
    assert min(sizes) >= 0.8 * sizes[0]


@pytest.mark.slow
def test_readings_never_hide_a_misfit_that_shows_without_them():
    """Some poses of sets of any size, read up to sixty times."""
    rng = np.random.default_rng(2)
    for _ in range(60):
        n = int(rng.integers(60, 600))
        lam, again = np.exp(rng.normal(0, 0.4, n)), np.ones(n)
        again[: rng.integers(1, rng.choice([12, n + 1]))] = rng.integers(1, 60)
        # the best limit lies between those that are tried
        assert detectable(again * lam, 27, DOUBT) <= 1.02 * detectable(lam, 27, DOUBT)


def test_too_few_rows_show_nothing():
    assert np.isnan(detectable(np.ones(20), 27, DOUBT))
    assert np.isnan(detectable(np.zeros(60), 27, DOUBT))
    assert np.isnan(detectable(np.zeros(0), 27, DOUBT))
    # where nothing tells the scale of the noise, misfit that all rows share alike passes for it
    assert np.isnan(detectable(np.ones(60), 27, np.inf))
