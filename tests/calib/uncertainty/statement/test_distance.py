"""How far a point may lie: closed forms, draws, and the factors that every U names."""

import numpy as np
import pytest
from scipy.stats import binom, chi2, ncx2

from calib.errors import InputError
from calib.uncertainty.statement.distance import (
    content,
    density,
    distance_radius,
    largest_radius,
    least_content,
    probability_within,
    radius_over,
    spread_over_directions,
)

# R95 / u_3D of round, flat, straight and two oblong regions: reference values to 4 digits
RATIOS = [
    ((1, 1, 1), 1.6140),
    ((1, 1, 0), 1.7308),
    ((1, 0, 0), 1.9600),
    ((4, 2, 1), 1.6783),
    ((9, 1, 1), 1.8273),
]


def turned(rng, count):
    """Covariances (count, 3, 3) of every shape and direction, some um wide [m^2]."""
    Q = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    sd = rng.uniform(0.02, 1, (count, 1, 3)) * 20e-6
    return (Q * sd**2) @ np.swapaxes(Q, 1, 2)


@pytest.mark.parametrize(("variances", "ratio"), RATIOS)
def test_radius_of_known_shapes(variances, ratio):
    S = np.diag(np.array(variances, dtype=float))
    assert distance_radius(S[None])[0] / np.sqrt(S.trace()) == pytest.approx(ratio, abs=5e-5)


def test_the_largest_radius_need_not_be_that_of_the_largest_uncertainty():
    """A line has more of it than a ball of slightly larger u."""
    ball, line = np.eye(3) / 2.9, np.diag([1.0, 0, 0])
    others = 0.1 * np.broadcast_to(np.eye(3), (4, 3, 3))
    S = np.concatenate([ball[None], others, line[None]])
    assert largest_radius(S) == pytest.approx(distance_radius(line[None])[0], rel=1e-12)
    S = turned(np.random.default_rng(4), 40)
    assert largest_radius(S) == pytest.approx(distance_radius(S).max(), rel=1e-12)


def test_round_regions_are_chi_square():
    # 1e-7 is what the nodes promise
    k = np.array([0.1, 1.0, 2.0, 4.0])
    S = np.broadcast_to(np.eye(3), (4, 3, 3))
    np.testing.assert_allclose(probability_within(k, S), chi2.cdf(k**2, 3), atol=1e-7)
    for T, d in ((3, (1, 1, 0)), (8, (6, 1, 2)), (20, (17, 0, 0))):
        expected = ncx2.cdf(T**2, 3, np.dot(d, d))
        assert probability_within(T, np.eye(3), d)[0] == pytest.approx(expected, abs=1e-7)


def test_flat_regions_are_chi_square_of_fewer_dimensions():
    disk, line = np.diag([1.0, 1, 0]), np.diag([1.0, 0, 0])
    k = np.sqrt(chi2.ppf(0.95, [2, 1]))
    np.testing.assert_allclose(probability_within(k, np.array([disk, line])), 0.95, atol=1e-6)


def test_twice_the_standard_uncertainty_of_a_distance_holds_at_least_95_percent():
    S = turned(np.random.default_rng(1), 40)
    held = probability_within(2 * np.sqrt(np.trace(S, axis1=1, axis2=2)), S)
    assert (held > 0.9544).all()
    assert (held < 0.9927).all()


@pytest.mark.parametrize("probability", [0.5, 0.95, 0.999])
def test_radius_holds_what_it_says_and_follows_units(probability):
    S = turned(np.random.default_rng(2), 25)
    R = distance_radius(S, probability)
    np.testing.assert_allclose(probability_within(R, S), probability, atol=1e-6)
    np.testing.assert_allclose(distance_radius(1e6 * S, probability), 1e3 * R, rtol=1e-9)


def test_against_draws():
    rng = np.random.default_rng(3)
    (S,), d, draws = turned(rng, 1), 1e-5 * rng.normal(size=3), 200_000
    T = 25e-6
    e = d + rng.normal(size=(draws, 3)) @ np.linalg.cholesky(S).T
    held = int((np.linalg.norm(e, axis=1) <= T).sum())
    low, high = binom.ppf([1e-4, 1 - 1e-4], draws, probability_within(T, S, d)[0])
    assert low <= held <= high


@pytest.mark.parametrize("factor", [1.0, 1.5, 2.0, 3.0])
def test_what_a_multiple_of_u_holds_at_least_is_that_of_the_worst_shape(factor):
    S = np.array([np.diag(d) for d in np.random.default_rng(4).dirichlet([0.3] * 3, 400) + 1e-9])
    held = probability_within(factor * np.sqrt(np.trace(S, axis1=1, axis2=2)), S)
    least = least_content(factor)
    # 400 shapes come within 1 % of the extreme one; the nodes promise 1e-7
    assert least - 1e-7 <= held.min() <= least + 0.01


def test_the_density_is_the_slope_of_the_content():
    length, step = np.array([0.3, 1.0, 4.0]), 1e-5
    slope = (content(1.5 + step, length) - content(1.5 - step, length)) / (2 * step)
    # differences of numbers below one, by 2e-5: 1e-11; curvature times step squared: 1e-10
    np.testing.assert_allclose(density(1.5, length), slope, atol=1e-9)


def test_the_radius_over_several_points_holds_the_share_it_says():
    rng = np.random.default_rng(5)
    S = turned(rng, 12) * rng.uniform(0.1, 10, 12)[:, None, None]
    weights = rng.dirichlet(np.ones(12))
    R = radius_over(S, weights)
    assert weights @ probability_within(R, S) == pytest.approx(0.95, abs=1e-6)
    same = np.broadcast_to(S[:1], S.shape)
    assert radius_over(same, weights) == pytest.approx(distance_radius(S[:1])[0], rel=1e-5)
    assert radius_over(1e6 * S, weights) == pytest.approx(1e3 * R, rel=1e-6)


def test_no_regions_no_radii():
    assert distance_radius(np.zeros((0, 3, 3))).shape == (0,)


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        (lambda: distance_radius(np.zeros((1, 3, 3))), "no variance at all"),
        (lambda: distance_radius(np.eye(3)[None], 1.0), "probability"),
        (lambda: probability_within(-1.0, np.eye(3)), "zero or more"),
    ],
)
def test_what_is_refused(bad, sentence):
    with pytest.raises(InputError, match=sentence):
        bad()


def test_directions_and_nested_lines_are_one_probability():
    """Two ways to the same number; the nested one is good to 5e-6 for thin shapes."""
    S = turned(np.random.default_rng(4), 60)
    S[:20] = np.array([np.diag([1.0, 10.0**-k, 10.0 ** -(2 * k)]) for k in range(20)])
    length, weight = spread_over_directions(S)
    assert weight.sum() == pytest.approx(1, abs=1e-14)
    for factor in (0.7, 1.5, 2.5):
        R = factor * np.sqrt(np.linalg.eigvalsh(S)[:, -1])
        np.testing.assert_allclose(
            content(R[:, None], length) @ weight, probability_within(R, S), atol=5e-6
        )
