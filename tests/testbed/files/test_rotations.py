"""Rotations as programs write them, against scipy as the second implementation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbed.files.columns import close_to, covariance_names, is_known
from testbed.files.observed import polar
from testbed.files.rotations import EULER, MAKERS, MATRIX, QUATERNION, VECTOR, rotations

ANGLES = np.random.default_rng(0).uniform(-3, 3, (50, 3))


def test_there_are_twelve_sequences_about_moving_and_twelve_about_fixed_axes():
    assert len(EULER) == 24
    assert sum(word.isupper() for word in EULER) == 12


@pytest.mark.parametrize("form", EULER)
def test_euler_sequences_mean_what_scipy_means(form):
    # scipy's capitals are intrinsic too; float64 products of three turns
    expected = Rotation.from_euler(form, ANGLES).as_matrix()
    np.testing.assert_allclose(rotations(form, ANGLES), expected, atol=1e-15)


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_fixed_axes_are_moving_axes_backwards(angles):
    a = np.array([angles])
    np.testing.assert_allclose(rotations("xyz", a), rotations("ZYX", a[:, ::-1]), atol=1e-15)


def test_quaternions_have_w_first_and_any_length():
    R = Rotation.random(100, random_state=1)
    numbers = R.as_quat()[:, [3, 0, 1, 2]] * np.linspace(0.5, -2, 100)[:, None]
    np.testing.assert_allclose(rotations(QUATERNION, numbers), R.as_matrix(), atol=1e-14)
    np.testing.assert_array_equal(rotations(QUATERNION, [[1.0, 0, 0, 0]])[0], np.eye(3))


def test_rotation_vectors_and_matrices():
    R = Rotation.random(20, random_state=2)
    np.testing.assert_allclose(rotations(VECTOR, R.as_rotvec()), R.as_matrix(), atol=1e-14)
    np.testing.assert_array_equal(rotations(MATRIX, R.as_matrix().reshape(-1, 9)), R.as_matrix())


def test_makers_are_understood():
    # KUKA: A about Z, then B about the new Y, then C about the new X
    kuka = rotations(MAKERS["kuka"], ANGLES)
    np.testing.assert_allclose(kuka, Rotation.from_euler("ZYX", ANGLES).as_matrix(), atol=1e-15)
    # Fanuc: W, P, R about fixed x, y, z
    fanuc = rotations(MAKERS["fanuc"], ANGLES)
    np.testing.assert_allclose(fanuc, Rotation.from_euler("xyz", ANGLES).as_matrix(), atol=1e-15)


def test_polar_readings_invert_to_themselves():
    r, a, e = np.array([[1.0, 2.0, 3.0], [0.1, 2.0, -3.0], [0.2, -1.5, 0.7]])
    x, y, z = polar(r, a, e).T
    np.testing.assert_allclose(np.hypot(np.hypot(x, y), z), r, rtol=1e-15)
    np.testing.assert_allclose(np.arctan2(y, x), a, rtol=1e-14)
    np.testing.assert_allclose(np.arcsin(z / r), e, rtol=1e-14)


def test_every_name_of_the_layout_is_known_and_carries_its_unit():
    for name in ("x_mm", "x_m", "q1_deg", "q7_read_rad", "q3_mm", "U95x_mm", "urx_mdeg"):
        assert is_known(name)
    for name in ("x", "x_deg", "q1", "q0_deg", "ux", "rx_mm", "cov_y_x_m2", "position"):
        assert not is_known(name)
    assert len(covariance_names()) == 21
    assert all(is_known(name) for name in covariance_names())
    assert close_to("x_mmm") == 'did you mean "x_mm"?'
    assert close_to("colour") == ""
    assert close_to("11") == ""  # the eleventh column of a file without names, not r11
