"""Error sizes and their statistics against numbers worked out by hand."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import exp_so3, transform
from calib.measurement.accuracy import error_statistics, position_errors, rotation_errors


def test_statistics_of_five_known_errors():
    result = error_statistics([3.0, 1.0, 2.0, 4.0, 5.0])
    assert result.mean == 3
    assert result.rms == pytest.approx(np.sqrt(11), rel=1e-15)
    assert result.sd == pytest.approx(np.sqrt(2.5), rel=1e-15)
    assert result.p95 == pytest.approx(4.8, rel=1e-15)  # 0.95 * 4 = 3.8 gaps above the smallest
    assert (result.maximum, result.count) == (5, 5)


def test_mean_square_is_square_of_mean_plus_variance():
    errors = np.random.default_rng(1).gamma(2, size=50)
    result = error_statistics(errors)
    assert result.rms**2 == pytest.approx(result.mean**2 + result.sd**2 * 49 / 50, rel=1e-13)


def test_a_known_shift_and_turn_are_read_back():
    rng = np.random.default_rng(2)
    axis = rng.normal(size=(6, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    angle = np.array([1e-9, 1e-4, 0.3, 2.0, 3.1, np.pi - 1e-9])
    true = transform(exp_so3(rng.normal(size=(6, 3))), rng.normal(size=(6, 3)))
    shift = rng.normal(size=(6, 3)) * 1e-4
    stated = transform(exp_so3(angle[:, None] * axis) @ true[:, :3, :3], true[:, :3, 3] + shift)
    # rotations are orthonormal to a few 1e-16, which is all an angle of 1e-9 can lose
    np.testing.assert_allclose(rotation_errors(true, stated), angle, atol=2e-15)
    np.testing.assert_allclose(
        position_errors(true, stated), np.linalg.norm(shift, axis=1), atol=1e-15
    )


def test_neither_error_depends_on_the_frame_or_on_who_is_true():
    rng = np.random.default_rng(3)
    A, B = (transform(exp_so3(rng.normal(size=(4, 3))), rng.normal(size=(4, 3))) for _ in range(2))
    world = transform(exp_so3(rng.normal(size=3)), rng.normal(size=3))
    for errors in (position_errors, rotation_errors):
        np.testing.assert_allclose(errors(world @ A, world @ B), errors(B, A), atol=1e-13)


def test_one_pose_has_no_spread():
    assert np.isnan(error_statistics([2.0]).sd)


@pytest.mark.parametrize("errors", [[], [1.0, -0.1]])
def test_no_errors_or_negative_ones_are_refused(errors):
    with pytest.raises(InputError, match="errors"):
        error_statistics(errors)
