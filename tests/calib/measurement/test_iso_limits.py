"""Confidence limits of ISO 9283 figures hold the truth as often as they say."""

from functools import cache

import numpy as np
import pytest
from scipy import stats

from calib.measurement import iso9283
from calib.measurement.cycles import length_moments
from calib.measurement.iso9283 import accuracy, distance_repeatability, gaps, repeatability
from calib.measurement.iso_limits import (
    largest_limits,
    mean_limits,
    repeatability_limits,
    spread_limits,
)

N = 900
"""Campaigns; 0.95 +- 0.022 is three standard errors."""


@cache
def true_rp(sd):
    """RP of endlessly many normal cycles, by 200,000 of them: within 0.2 %."""
    away = np.linalg.norm(np.random.default_rng(0).standard_normal((200_000, 3)) * sd, axis=1)
    return away.mean() + 3 * away.std()


@pytest.mark.slow
@pytest.mark.parametrize("n", [3, pytest.param(10, marks=pytest.mark.study), 30])
@pytest.mark.parametrize("sd", [(1.0, 1.0, 1.0), (1.0, 0.5, 0.25), (1.0, 1e-3, 1e-3)])
def test_rp_of_endlessly_many_cycles_lies_within_its_limits(sd, n):
    x = np.random.default_rng(n).standard_normal((N, n, 3)) * sd
    found, truth = repeatability_limits(x), true_rp(sd)
    below, above = (found.upper < truth).mean(), (found.lower > truth).mean()
    # 20,000 campaigns each: 0.942 to 0.978 within, at most 0.034 on one side;
    # few cycles look like a line whatever they are, which makes the limits wider, never narrower
    assert 1 - below - above > 0.94 - 0.022
    assert max(below, above) < 0.034 + 0.018
    if n == 30:
        assert 1 - below - above < 0.99


def test_degrees_of_freedom_follow_the_shape_of_the_scatter():
    """Along a line they are nearly n - 1, round ones nearly 2 n: the delta method by hand."""
    rng = np.random.default_rng(1)
    line = repeatability_limits(rng.standard_normal((50, 2000, 3)) * (1.0, 1e-6, 1e-6))
    ball = repeatability_limits(rng.standard_normal((50, 2000, 3)))
    half, maxwell = stats.halfnorm, stats.maxwell
    for found, one in ((line, half), (ball, maxwell)):
        m, v, skew, excess = (float(x) for x in one.stats(moments="mvsk"))
        relative = v * (1 + 9 * (excess + 2) / 4 + 3 * skew) / (m + 3 * np.sqrt(v)) ** 2
        # moments over 2048 even points: 1 %, and the sample covariance of 2000
        assert np.median(found.dof) == pytest.approx(1999 / (2 * relative), rel=0.03)


def test_moments_of_lengths_are_those_of_the_chi_distribution():
    for k, sd in ((3, (1.0, 1.0, 1.0)), (2, (1.0, 1.0, 0.0)), (1, (1.0, 0.0, 0.0))):
        found = length_moments(np.diag(np.square(sd)))
        m, v, skew, excess = stats.chi(k).stats(moments="mvsk")
        # 2048 even points in three dimensions are rough in what far ones decide
        np.testing.assert_allclose(found[:2], [m, np.sqrt(v)], rtol=5e-3)
        np.testing.assert_allclose(found[2:], [skew, excess + 3], rtol=0.03)


def test_three_deviations_of_a_distance_have_the_limits_of_chi_square():
    rng = np.random.default_rng(2)
    first, second = rng.standard_normal((2, N, 12, 3)) * (1e-5, 1e-9, 1e-9)
    value = distance_repeatability(first, second + np.array([0.4, 0, 0])).value
    found = spread_limits(value, 12)
    inside = ((found.lower < 3e-5 * np.sqrt(2)) & (3e-5 * np.sqrt(2) < found.upper)).mean()
    assert inside == pytest.approx(0.95, abs=0.022)
    np.testing.assert_allclose(
        (value / found.upper) ** 2 * 11, stats.chi2(11).ppf(0.025), rtol=1e-9
    )


def test_limits_of_a_mean_are_those_of_student_and_never_below_zero():
    x = np.random.default_rng(3).standard_normal((40, 5, 3))
    figure = repeatability(x)
    found = mean_limits(figure, 4)
    half = stats.t(4).ppf(0.975) * figure.uncertainty
    np.testing.assert_allclose(found.upper, figure.value + half, rtol=1e-12)
    np.testing.assert_allclose(found.lower, np.maximum(figure.value - half, 0), atol=1e-15)


def test_limits_of_five_points_as_by_hand():
    points = np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 0.0]])
    found = repeatability_limits(points)
    RP, f = (0.8 + 3 * 0.2**0.5) * np.sqrt(5 / 4), float(found.dof)
    assert float(found.upper) == pytest.approx(RP * np.sqrt(f / stats.chi2(f).ppf(0.025)))
    assert float(found.lower) == pytest.approx(RP * np.sqrt(f / stats.chi2(f).ppf(0.975)))
    assert 4 < f < 8  # four along a line, about eight if round


def test_cycles_that_do_not_scatter_have_limits_of_zero():
    found = repeatability_limits(np.ones((4, 3)))
    assert (float(found.lower), float(found.upper)) == (0.0, 0.0)


@pytest.mark.parametrize("n", [5, 30])
@pytest.mark.parametrize("sd", [(1.0, 1.0, 1.0), (1.0, 0.5, 0.1)])
def test_scatter_alone_is_no_accuracy_and_no_variation_between_approaches(n, sd, monkeypatch):
    """Truths of zero to a few u: Student's t alone is above them in up to a half of campaigns."""
    for name in ("mean_norm", "mean_widest"):  # floors, which nobody asks for here
        monkeypatch.setattr(iso9283, name, lambda C, *_: np.zeros(C.shape[:-2]))
    rng, few, away = np.random.default_rng(n), 3000, np.array([0.36, 0.48, 0.8])
    for size in (0.0, 1.0, 3.0):
        truth = size / np.sqrt(n)
        x = rng.standard_normal((few, n, 3)) * sd + truth * away
        AP = mean_limits(accuracy(x, np.zeros(3)), n - 1)
        ways = rng.standard_normal((few, 3, n, 3)) * sd
        ways[:, 1] += truth * away
        vAP = largest_limits(gaps(ways), 2 * (n - 1))
        for found in (AP, vAP):
            # 0.025 and three standard errors of 3000
            assert (found.lower > truth).mean() < 0.025 + 0.009
            assert (found.upper < truth).mean() < 0.025 + 0.009


def test_upper_limits_hold_where_scatter_is_along_one_direction_and_the_error_is_not():
    """Student's t alone is below the truth in 6 % of campaigns: a shorter vector looks surer."""
    rng, truth = np.random.default_rng(8), np.array([2.0, 0, 6]) * 1.5 / np.sqrt(30)
    x = rng.standard_normal((3000, 30, 3)) * (1.0, 0.1, 0.1) + truth
    found = mean_limits(accuracy(x, np.zeros(3)), 29)
    # 40,000 campaigns: 0.031; three standard errors of 3000
    assert (found.upper < np.linalg.norm(truth)).mean() < 0.031 + 0.0095
    # along an axis, or of equal scatter, nothing is added
    figure = accuracy(x - truth, [0, 0, 1e9])
    half = stats.t(29).ppf(0.975) * figure.uncertainty
    np.testing.assert_allclose(mean_limits(figure, 29).upper, figure.value + half, rtol=1e-12)


def test_a_length_far_from_its_floor_has_the_limits_of_student():
    rng = np.random.default_rng(6)
    x = rng.standard_normal((40, 8, 3)) + np.array([0, 0, 500.0])
    figure = accuracy(x, np.zeros(3))
    half = stats.t(7).ppf(0.975) * figure.uncertainty
    # what scatter across adds to 500 is a thousandth of u
    np.testing.assert_allclose(mean_limits(figure, 7).lower, figure.value - half, atol=0.02)
    # where the instrument is unsure across the length alone, that does not lower its lower limit
    x = rng.standard_normal((30, 3))
    x += [0, 0, 43] - x.mean(axis=0)
    found = mean_limits(accuracy(x, np.zeros(3), common=np.diag([400.0, 0, 0])), 29)
    assert 42.5 < float(found.lower) < 43
    still = mean_limits(accuracy(np.ones((4, 3)), np.zeros(3)), 3)
    assert (float(still.lower), float(still.upper)) == (3**0.5, 3**0.5)
