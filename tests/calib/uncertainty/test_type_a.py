"""Scatter of repeated calibrations: what ten repeats say, and what they cannot."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.type_a import root_sum_square, type_a


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
