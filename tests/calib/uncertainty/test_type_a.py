"""Scatter of repeated calibrations: what ten repeats say, and what they cannot."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.regions import inside, student_factor
from calib.uncertainty.type_a import effective_freedom, root_sum_square, type_a


def test_the_standard_uncertainty_is_that_of_one_estimate_with_n_minus_one():
    # by hand: deviations -2, 1, 1 and 0, 3, -3 -> sqrt(6 / 2), sqrt(18 / 2)
    found = type_a([[1.0, 5.0], [4.0, 8.0], [4.0, 2.0]])
    np.testing.assert_allclose(found.mean, [3.0, 5.0], rtol=1e-15)
    np.testing.assert_allclose(found.standard, [np.sqrt(3.0), 3.0], rtol=1e-15)
    assert found.degrees_of_freedom == 2
    assert not found.standard.flags.writeable


def test_a_bias_shared_by_all_repeats_leaves_no_trace():
    estimates = np.random.default_rng(0).normal(size=(10, 4))
    # 1000 added to numbers near 1 costs three digits
    np.testing.assert_allclose(
        type_a(estimates + 1000.0).standard, type_a(estimates).standard, rtol=1e-12
    )


def test_root_sum_square_takes_numbers_and_arrays_together():
    np.testing.assert_allclose(root_sum_square([3.0, 0.0], 4.0), [5.0, 4.0], rtol=1e-15)


@pytest.mark.parametrize(
    ("estimates", "message"),
    [([[1.0, 2.0]], "two repeated"), ([1.0, 2.0], "shape"), ([[1.0], [np.nan]], "nan")],
)
def test_unusable_repeats_are_refused_with_the_reason(estimates, message):
    with pytest.raises(InputError, match=message):
        type_a(estimates)


def test_degrees_of_freedom_of_one_number_and_of_many_alike():
    column = np.array([[2.0], [-1.0], [0.5]])
    assert effective_freedom(column, np.array([3.0]), 4.0) == pytest.approx(4.0, rel=1e-12)
    # by hand: (1 + 1 + 4)^2 / (1 / 4 + 1 / 9 + 16 / inf), JCGM 100 (G.2b)
    row, u = np.array([[1.0, -1.0, 2.0]]), np.ones(3)
    found = effective_freedom(row, u, np.array([4.0, 9.0, np.inf]))
    assert found == pytest.approx(36 / (1 / 4 + 1 / 9), rel=1e-12)
    assert effective_freedom(row, u, np.inf) == np.inf
    # f equal scalars have f times the freedom of one
    assert effective_freedom(np.ones((1, 24)), np.ones(24), 4.0) == pytest.approx(96, rel=1e-12)
    # turning the axes changes nothing
    J, R = np.random.default_rng(3).normal(size=(3, 7)), np.linalg.qr(np.eye(3) + column * 0.3)[0]
    turned = effective_freedom(R @ J, np.arange(1.0, 8.0), 4.0)
    assert turned == pytest.approx(effective_freedom(J, np.arange(1.0, 8.0), 4.0), rel=1e-12)


@pytest.mark.parametrize(
    ("repeats", "numbers", "most"), [(5, 3, 1.0), (5, 24, 0.98), (10, 24, 0.97)]
)
def test_what_few_repeats_state_of_a_sum_holds_the_truth_in_95_percent(repeats, numbers, most):
    """Drawn anew 10,000 times: a length in 95 %, a point in more where few numbers move it."""
    rng = np.random.default_rng(repeats * numbers)
    J, sd = rng.normal(size=(3, numbers)), np.exp(0.7 * rng.normal(size=numbers))
    draws = rng.normal(size=(10_000, repeats, numbers)) * sd
    u = draws.std(axis=1, ddof=1)
    error = (rng.normal(size=(10_000, numbers)) * sd) @ J.T
    freedom = np.array([effective_freedom(J, one, repeats - 1.0) for one in u])
    S = np.einsum("if,nf,jf->nij", J, u**2, J)
    held, normal = inside(error, S, freedom=freedom).mean(), inside(error, S).mean()
    assert normal < 0.945
    # 10,000 shares scatter by 0.002; the freedom of a region is that of its worst directions
    assert 0.944 < held < most
    along = np.array([effective_freedom(J[:1], one, repeats - 1.0) for one in u])
    reach = student_factor(along) * np.sqrt(S[:, 0, 0])
    assert (np.abs(error[:, 0]) <= reach).mean() == pytest.approx(0.95, abs=0.015)
