"""Laws of rotations, rotation vectors and rigid transforms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib.geometry.frames import (
    exp_so3,
    inverse,
    is_rigid,
    log_so3,
    nearest_rigid,
    right_jacobian_inverse,
    rot_x,
    rot_y,
    rot_z,
    skew,
    slide,
    step_transform,
    transform_step,
    turn_angle,
)
from tests.calib.slopes import slopes

directions = st.tuples(*[st.floats(-1, 1) for _ in range(3)]).filter(
    lambda v: np.linalg.norm(v) > 1e-3
)
# where series and branches meet: 0, 1e-7, below and above each switch, and up to pi
angles = st.one_of(
    st.sampled_from([0.0, 1e-12, 1e-7, 9e-4, 1.1e-3, np.pi - 1e-3, np.pi - 1e-5, np.pi - 1e-8]),
    st.floats(0, np.pi - 1e-9),
)


def vector(direction, angle):
    v = np.array(direction)
    return v / np.linalg.norm(v) * angle


@given(directions, angles)
def test_log_is_the_inverse_of_exp_up_to_a_half_turn(direction, angle):
    w = vector(direction, angle)
    # rounding of R (1e-16) divided by the sine of the angle between axis and its image
    assert np.abs(log_so3(exp_so3(w)) - w).max() < 1e-11
    # the angle has no axis
    assert abs(turn_angle(exp_so3(w)) - angle) < 1e-15 * 10


@given(directions, angles)
def test_exp_equals_scipy_and_is_a_rotation(direction, angle):
    w = vector(direction, angle)
    R = exp_so3(w)
    assert np.abs(R - Rotation.from_rotvec(w).as_matrix()).max() < 1e-15 * 10
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15 * 10


def test_log_of_exact_half_turns_has_length_pi():
    for axis in (*np.eye(3), np.array([0.6, 0.8, 0]), np.array([-0.6, 0, 0.8])):
        R = 2 * np.outer(axis, axis) - np.eye(3)
        w = log_so3(R)
        assert np.linalg.norm(w) == pytest.approx(np.pi, abs=1e-12)
        assert np.abs(exp_so3(w) - R).max() < 1e-14


def test_stacks_give_the_same_as_single_matrices():
    w = np.random.default_rng(0).normal(size=(50, 3))
    one_by_one = np.array([log_so3(exp_so3(v)) for v in w])
    assert np.array_equal(log_so3(exp_so3(w)), one_by_one)
    steps = np.random.default_rng(1).normal(size=(50, 6))
    moved = [nearest_rigid(step_transform(step)) for step in steps]
    assert np.array_equal(nearest_rigid(step_transform(steps)), moved)


def test_skew_is_the_cross_product():
    a, b = np.random.default_rng(1).normal(size=(2, 20, 3))
    assert np.abs((skew(a) @ b[..., None])[..., 0] - np.cross(a, b)).max() < 1e-15


@given(directions, st.floats(1e-6, 3.0))
def test_right_jacobian_inverse_is_the_derivative_of_log(direction, angle):
    e = vector(direction, angle)
    numeric = slopes(lambda step: log_so3(exp_so3(e) @ exp_so3(step)), np.zeros(3))
    # central difference: truncation h^2 and rounding 1e-16 / h, both amplified near a half turn
    assert np.abs(right_jacobian_inverse(e) - numeric).max() < 2e-8


def test_elementary_turns_equal_exp():
    for turn, axis in ((rot_x, 0), (rot_y, 1), (rot_z, 2)):
        assert np.abs(turn(0.7)[:3, :3] - exp_so3(0.7 * np.eye(3)[axis])).max() < 1e-15


def test_inverse_and_frame_steps_undo_each_other():
    rng = np.random.default_rng(2)
    step = rng.normal(size=6) * 0.5  # within half a turn
    T = step_transform(step)
    assert np.abs(inverse(T) @ T - np.eye(4)).max() < 1e-15 * 10
    assert np.abs(transform_step(T) - step).max() < 1e-14
    assert is_rigid(T)
    assert not is_rigid(T * [[-1], [1], [1], [1]])
    assert is_rigid(slide(1, 2, 3))
