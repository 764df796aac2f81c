"""Coverage regions: their factors, their axes, and whether they hold what they promise."""

import numpy as np
import pytest
from scipy import stats

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.uncertainty.regions import (
    coverage_factor,
    ellipsoid,
    expanded,
    inside,
    mahalanobis_squared,
    student_factor,
)
from calib.uncertainty.tool_point import tool_statement


def random_covariances(count, dimension, seed=0):
    L = np.random.default_rng(seed).normal(size=(count, dimension, dimension))
    return L @ np.swapaxes(L, 1, 2)


def test_the_factors_are_the_tabled_ones():
    factors = [coverage_factor(m) for m in (1, 2, 3, 6, 24)]
    # half a unit of the fourth printed decimal
    np.testing.assert_allclose(factors, [1.9600, 2.4477, 2.7955, 3.5485, 6.0345], atol=5.1e-5)
    np.testing.assert_allclose(
        [coverage_factor(m, 0.99) for m in (1, 3)],
        np.sqrt(stats.chi2.ppf(0.99, [1, 3])),
        rtol=1e-12,
    )


def test_few_repeats_need_students_factor_and_many_the_normal_one():
    np.testing.assert_allclose(student_factor([9.0, 49.0]), stats.t.ppf(0.975, [9, 49]), rtol=1e-12)
    assert student_factor(np.inf) == pytest.approx(coverage_factor(1), rel=1e-12)


def test_expanded_uncertainty_is_k_times_u():
    u = np.array([1.0, 2.0])
    np.testing.assert_array_equal(expanded(u, dimension=3), coverage_factor(3) * u)


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (-np.eye(3), "covariance has the variance -1"),
        (np.array([[1.0, 0.9], [0.0, 1.0]]), r"covariance\[0, 1\] and \[1, 0\] differ"),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "covariance has the eigenvalue -1"),
    ],
)
def test_what_is_no_covariance_has_no_region(covariance, message):
    """Of one with a negative variance the axes would be zero: the best statement of all."""
    several = np.stack([np.eye(len(covariance)), covariance])
    for wrong in (covariance, several):
        with pytest.raises(InputError, match=message):
            ellipsoid(wrong)
        with pytest.raises(InputError, match=message):
            inside(np.zeros(len(covariance)), wrong)
    model = RobotModel(Chain([[0.0, 0.3, 0.1, 0.0, 0.0]]))
    C = np.zeros((17, 17))
    C[: len(covariance), : len(covariance)] = covariance
    with pytest.raises(InputError, match="covariance"):
        tool_statement(model, [[0.0]], C).region  # noqa: B018  # an indefinite one is found there


def test_rounding_makes_no_covariance_wrong():
    """J C J' of a plane that lies askew: of its smallest eigenvalues rounding decides the sign."""
    L = np.random.default_rng(5).normal(size=(300, 3, 2)) * 1e-5
    C = L @ np.swapaxes(L, 1, 2)
    assert (np.linalg.eigvalsh(C)[:, 0] < 0).any()
    axes, _ = ellipsoid(C)
    assert (axes[:, 2] < 1e-6 * axes[:, 0]).all()
    assert inside(L[:, :, 0], C).all()


def test_no_uncertainty_is_negative_or_unknown():
    for wrong in ([1.0, -1.0], [np.nan]):
        with pytest.raises(InputError, match="standard"):
            expanded(wrong)


def test_axes_and_orientation_rebuild_the_covariance():
    C = random_covariances(50, 3)
    axes, R = ellipsoid(C)
    k = coverage_factor(3)
    np.testing.assert_allclose(
        R @ (axes[:, :, None] ** 2 / k**2 * np.swapaxes(R, 1, 2)), C, atol=1e-13 * np.abs(C).max()
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, rtol=1e-12)
    assert (np.diff(axes, axis=1) <= 0).all()


def test_the_ends_of_the_axes_lie_on_the_border():
    C = random_covariances(50, 3)
    axes, R = ellipsoid(C)
    for i in range(3):
        tip = axes[:, i, None] * R[:, :, i]
        # inverse of the smallest variance costs the condition number, up to 1e5 here
        np.testing.assert_allclose(mahalanobis_squared(tip, C), coverage_factor(3) ** 2, rtol=1e-8)
        assert inside(0.999 * tip, C).all()
        assert not inside(1.001 * tip, C).any()


@pytest.mark.parametrize("dimension", [1, 2, 3, 6])
def test_a_95_percent_region_holds_95_percent_of_normal_errors(dimension):
    rng = np.random.default_rng(dimension)
    C = random_covariances(1, dimension, seed=dimension)[0]
    error = rng.normal(size=(40_000, dimension)) @ np.linalg.cholesky(C).T
    held = inside(error, np.broadcast_to(C, (len(error), dimension, dimension))).mean()
    # binomial sd .0011, band 4 sd
    assert held == pytest.approx(0.95, abs=0.0044)


def test_squared_distance_does_not_care_about_units():
    C, e = random_covariances(5, 6), np.random.default_rng(3).normal(size=(5, 6))
    to_mm = np.array([1e3, 1e3, 1e3, 1, 1, 1])
    np.testing.assert_allclose(
        mahalanobis_squared(e * to_mm, C * to_mm[:, None] * to_mm),
        mahalanobis_squared(e, C),
        rtol=1e-9,
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: coverage_factor(3, 95.0), "probability is 95.0"),
        (lambda: coverage_factor(0), "dimension"),
        (lambda: mahalanobis_squared(np.ones(2), np.diag([1.0, 0.0])), "without variance"),
        (lambda: mahalanobis_squared(np.ones(2), np.ones((2, 2))), "positive definite"),
    ],
)
def test_regions_that_do_not_exist_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_flat_region_holds_only_what_lies_in_its_plane():
    flat = np.diag([4.0, 1.0, 0.0])
    k = coverage_factor(2)
    errors = np.array([[2 * k - 1e-9, 0, 0], [2 * k + 1e-9, 0, 0], [0, 0, 1e-3], [0, 0, 0]])
    covariance = np.broadcast_to(flat, (4, 3, 3))
    assert inside(errors, covariance).tolist() == [True, False, False, True]


def test_inside_of_a_full_region_is_the_mahalanobis_test():
    rng = np.random.default_rng(4)
    A = rng.normal(size=(200, 3, 3)) * [1.0, 0.5, 0.2]
    covariance = A @ np.swapaxes(A, 1, 2)
    error = (A @ rng.normal(size=(200, 3, 1)))[..., 0]
    expected = mahalanobis_squared(error, covariance) <= coverage_factor(3) ** 2
    assert np.array_equal(inside(error, covariance), expected)
