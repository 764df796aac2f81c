"""Covariances against simulated shots, and whitening against its definition."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import exp_so3, inverse, log_so3, transform
from calib.geometry.model import RobotModel
from calib.measurement.noise import (
    inverse_covariance,
    spherical_covariance,
    whiteners,
    with_joint_noise,
)
from calib.measurement.tables import covariances_of_sd
from tests.reference import DEG, UM, pool_r, tx60

RANGE, ACROSS, CENTER = (2 * UM, 0.15 * UM), (3 * UM, 1.5 * UM), 2.5 * UM
TURN = (0.002 * DEG, 0.002 * DEG, 0.0035 * DEG)
STATION = transform(np.eye(3), np.array([2.6, -2.0, 0.3]))


def spherical(target: Array, station: Array = STATION, **more: Array) -> Array:
    return spherical_covariance(
        target,
        station,
        range_sd=RANGE,
        transverse_sd=ACROSS,
        rotation_sd=TURN,
        centering_sd=CENTER,
        **more,
    )


def random_spd(rng: np.random.Generator, m: int) -> Array:
    root = rng.normal(size=(m, 6, 6)) * [1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4]
    return np.swapaxes(root, -1, -2) @ root


def test_noise_of_inverse_transforms_is_that_of_what_was_read():
    """Steps of each kind, and what they do to the inverse: what turns a board moves the camera."""
    rng = np.random.default_rng(5)
    T = transform(exp_so3(rng.normal(size=(20, 3))), rng.normal(scale=0.5, size=(20, 3)))
    covariance, step = random_spd(rng, 20), 1e-6
    columns = []
    for k in range(6):
        d, w = np.split(step * np.eye(6)[k], 2)
        moved = inverse(transform(exp_so3(w) @ T[:, :3, :3], T[:, :3, 3] + d))
        turned = moved[:, :3, :3] @ T[:, :3, :3]
        columns.append(np.hstack([moved[:, :3, 3] - inverse(T)[:, :3, 3], log_so3(turned)]) / step)
    J = np.stack(columns, axis=-1)
    expected = J @ covariance @ np.swapaxes(J, -1, -2)
    # one-sided differences: their step, relative to the size of what is compared
    np.testing.assert_allclose(
        inverse_covariance(T, covariance), expected, atol=3 * step * np.abs(expected).max()
    )


def test_whitened_noise_has_unit_covariance():
    covariance = random_spd(np.random.default_rng(1), 20)
    N = whiteners(covariance)
    # condition of these matrices is up to 1e5, so a few 1e-12 is rounding
    assert np.abs(N @ covariance @ np.swapaxes(N, -1, -2) - np.eye(6)).max() < 1e-9


def test_squared_whitened_residual_is_the_mahalanobis_distance():
    rng = np.random.default_rng(2)
    covariance, r = random_spd(rng, 5), rng.normal(size=(5, 6)) * 1e-5
    direct = [r[j] @ np.linalg.solve(covariance[j], r[j]) for j in range(5)]
    white = (whiteners(covariance) @ r[:, :, None])[:, :, 0]
    np.testing.assert_allclose((white**2).sum(1), direct, rtol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda C: C - 2 * C[0, 0] * np.eye(6), "smallest eigenvalue -"),
        (lambda C: C * (np.arange(6) != 4) * (np.arange(6) != 4)[:, None], "smallest eigenvalue 0"),
        (lambda C: np.full((6, 6), C[0, 0]), "not positive definite"),
        (lambda C: C + C[0, 0] * np.eye(6, k=1), "not symmetric"),
    ],
    ids=["negative", "one axis without noise", "fully correlated", "one triangle"],
)
def test_a_covariance_that_is_none_is_refused_with_its_row_and_eigenvalue(spoil, says):
    covariance = np.array(covariances_of_sd((17 * UM, 17 * UM), 6, 5))
    covariance[3] = spoil(covariance[3])
    with pytest.raises(InputError, match=r"covariance\[3\]") as caught:
        whiteners(covariance)
    assert says in str(caught.value)
    assert caught.value.code == "M34"


def test_meters_and_radians_of_very_different_size_are_not_mistaken_for_singular():
    covariance = covariances_of_sd((1e-9, 1.0), 6, 1)
    np.testing.assert_allclose(np.diagonal(whiteners(covariance)[0]), [1e9] * 3 + [1.0] * 3)


def test_spherical_covariance_is_that_of_range_and_angle_shots():
    """1e5 shots drawn as a tracker makes them: errors of range, of two angles, of centering."""
    rng, n = np.random.default_rng(3), 100_000
    target, origin = np.array([0.4, 0.2, 0.5]), STATION[:3, 3]
    beam = target - origin
    rho = np.linalg.norm(beam)
    u = beam / rho
    side = np.cross(u, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(u, side)
    angle = rng.normal(size=(n, 2)) * (ACROSS[0] + ACROSS[1] * rho) / rho
    turned = exp_so3(angle[:, :1] * side + angle[:, 1:] * up) @ u
    length = rho + rng.normal(size=(n, 1)) * (RANGE[0] + RANGE[1] * rho)
    shots = origin + length * turned + rng.normal(size=(n, 3)) * CENTER
    sample = np.cov(shots.T)
    stated = spherical(target[None])[0, :3, :3]
    # sd of a sample covariance entry: sqrt((s_ij^2 + s_ii s_jj) / n)
    spread = np.sqrt((stated**2 + np.outer(np.diag(stated), np.diag(stated))) / n)
    assert np.abs((sample - stated) / spread).max() < 4


def test_rotating_tracker_and_target_together_rotates_the_covariance():
    rng = np.random.default_rng(4)
    target, R = rng.normal(size=(7, 3)), exp_so3(np.array([0.3, -0.7, 1.1]))
    turn = transform(R, np.array([0.5, 0.1, -0.3]))
    axes = np.tile(np.eye(3), (7, 1, 1))
    before = spherical(target, R_world_target=axes)
    after = spherical(target @ R.T + turn[:3, 3], turn @ STATION, R_world_target=R @ axes)
    big = np.kron(np.eye(2), R)
    np.testing.assert_allclose(after, big @ before @ big.T, rtol=0, atol=1e-12 * before.max())


def test_along_the_beam_the_spread_is_that_of_the_range():
    target = STATION[:3, 3] + np.array([[3.0, 0, 0]])
    sd = np.sqrt(np.diag(spherical(target)[0]))
    np.testing.assert_allclose(sd[0], np.hypot(2 * UM + 0.45 * UM, CENTER), rtol=1e-12)
    np.testing.assert_allclose(sd[1:3], np.hypot(3 * UM + 4.5 * UM, CENTER), rtol=1e-12)
    np.testing.assert_allclose(sd[3:], TURN, rtol=1e-12)


def test_a_target_at_the_gimbal_point_is_refused():
    with pytest.raises(InputError, match=r"target\[1\]"):
        spherical(np.array([[1.0, 0, 0], STATION[:3, 3]]))


def test_joint_noise_is_the_covariance_of_poses_reached_with_scattered_joints():
    rng, model, q = np.random.default_rng(5), tx60(), pool_r(1)
    sigma, n = np.array([10, 20, 15, 30, 25, 40]) * 1e-6, 40_000
    T = model.poses(q + rng.normal(size=(n, 6)) * sigma)
    base = inverse(model.poses(q))
    turned = T[:, :3, :3] @ base[0, :3, :3]
    twist = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], -1)  # small angles
    sample = np.cov(np.hstack([T[:, :3, 3], twist]).T)
    stated = with_joint_noise(model, q, np.zeros((1, 6, 6)), sigma)[0]
    spread = np.sqrt((stated**2 + np.outer(np.diag(stated), np.diag(stated))) / n)
    assert np.abs((sample - stated) / spread).max() < 4


def test_default_joint_noise_gives_the_arm_its_catalog_repeatability():
    """14.5 urad per joint: 5.7 um per axis, 3.53 times that is ISO 9283's 0.020 mm."""
    q = pool_r()
    covariance = with_joint_noise(tx60(), q, np.zeros((1000, 6, 6)), np.full(6, 14.5e-6))
    per_axis = np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2).mean() / 3)
    assert per_axis == pytest.approx(5.7 * UM, abs=0.05 * UM)
    assert 3.534 * per_axis == pytest.approx(20 * UM, abs=0.3 * UM)


def test_joint_noise_of_a_reflector_is_that_of_a_tool_moved_there():
    model, q, c = tx60(), pool_r(4), np.array([0.05, 0.03, 0.08])
    sigma = np.full(6, 1e-5)
    moved = RobotModel(replace(model.chain, T_flange_tool=transform(np.eye(3), c)))
    zero = np.zeros((4, 6, 6))
    here = with_joint_noise(model, q, zero, sigma, offset=np.tile(c, (4, 1)))
    np.testing.assert_allclose(here, with_joint_noise(moved, q, zero, sigma), atol=1e-22)


def test_a_sliding_joint_scatters_along_its_axis():
    model = RobotModel(Chain(np.zeros((1, 5)), kinds=("prismatic",)))
    covariance = with_joint_noise(model, [[0.3]], np.zeros((1, 6, 6)), [2e-5])
    np.testing.assert_allclose(covariance[0], np.diag([0, 0, 4e-10, 0, 0, 0]), atol=1e-25)
