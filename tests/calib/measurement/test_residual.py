"""Residuals and Jacobians of tables: against differences, laws, and the other row forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.frames import exp_so3
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.measurement import tables
from calib.measurement.observations import POINT, POSE, Measurements
from calib.measurement.residual import Stack, linearize, paper_stack, point_blocks, whitened_blocks
from tests.calib.slopes import slopes
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, pool_r, tx60


def correlated(rng: np.random.Generator, m: int) -> Array:
    """Covariances (m, 6, 6) with every correlation."""
    root = rng.normal(size=(m, 6, 9)) * np.repeat([SIGMA_POSITION, SIGMA_ROTATION], 3)[:, None]
    return root @ np.swapaxes(root, -1, -2)


def mixed_table(model: RobotModel, rng: np.random.Generator, size: float) -> Measurements:
    """Three poses and three reflectors, off by about `size` [m, rad]."""
    q = pool_r(6)
    T = model.poses(q)
    T[:, :3, 3] += rng.normal(size=(6, 3)) * size
    T[:, :3, :3] = exp_so3(rng.normal(size=(6, 3)) * size) @ T[:, :3, :3]
    poses = tables.poses(q, T, sd=correlated(rng, 6))
    kind = np.where(np.isin(np.arange(6), [1, 3, 4]), POINT, POSE)
    offset = np.where((kind == POINT)[:, None], rng.normal(size=(6, 3)) * 0.1, 0.0)
    return replace(poses, kind=kind, offset=offset)


@pytest.mark.parametrize("size", [0.0, 1e-4, 0.5], ids=["no error", "small", "half a radian"])
def test_jacobian_is_minus_the_difference_quotient_of_the_residual(size):
    """Also where residuals are large: the rotation part carries the inverse right Jacobian."""
    rng = np.random.default_rng(1)
    terms = gravity_terms(6)
    model = RobotModel(tx60().chain, JointErrors(terms, rng.normal(size=3) * 1e-3)).moved(
        rng.normal(size=45) * 1e-3
    )
    table = mixed_table(model, rng, size)
    A = linearize(model, table).A
    change = slopes(lambda step: linearize(model.moved(step), table).r, np.zeros(A.shape[1]), 1e-5)
    # central difference: h^2 / 6 of the third derivative, and rounding 1e-16 / h, both < 1e-9
    assert np.abs(change + A).max() <= 1e-8 * np.abs(A).max()


def test_a_small_step_changes_the_residual_by_the_jacobian():
    rng, model = np.random.default_rng(2), tx60()
    table = mixed_table(model, rng, 1e-4)
    stack, dx = linearize(model, table), rng.normal(size=42) * 1e-7
    change = linearize(model.moved(dx), table).r - stack.r
    # the second order is 1e-7 of the first
    np.testing.assert_allclose(change, -stack.A @ dx, atol=1e-6 * np.abs(change).max())


def test_rows_are_six_per_pose_and_three_per_point_in_table_order():
    table = mixed_table(tx60(), np.random.default_rng(3), 1e-4)
    stack = linearize(tx60(), table)
    assert np.bincount(stack.row_of).tolist() == [6, 3, 6, 3, 3, 6]
    assert (np.diff(stack.row_of) >= 0).all()
    alone = [linearize(tx60(), table.rows([j])) for j in range(6)]
    # row by row or in one batch: only the order of additions may differ
    np.testing.assert_allclose(stack.r, np.concatenate([s.r for s in alone]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(stack.A, np.concatenate([s.A for s in alone]), rtol=1e-9, atol=1e-6)


def test_sum_of_squares_is_the_mahalanobis_distance_by_another_rotation_library():
    rng, model = np.random.default_rng(4), tx60()
    q, T = pool_r(5), model.poses(pool_r(5))
    S = T.copy()
    S[:, :3, :3] = exp_so3(rng.normal(size=(5, 3)) * 0.4) @ T[:, :3, :3]
    S[:, :3, 3] += rng.normal(size=(5, 3)) * 0.1
    C = correlated(rng, 5)
    total = 0.0
    for j in range(5):
        turn = Rotation.from_matrix(S[j, :3, :3] @ T[j, :3, :3].T).as_rotvec()
        e = np.concatenate([S[j, :3, 3] - T[j, :3, 3], turn])
        total += e @ np.linalg.solve(C[j], e)
    r = linearize(model, tables.poses(q, S, sd=C)).r
    assert r @ r == pytest.approx(total, rel=1e-9)


def test_blocks_for_planning_equal_the_rows_of_a_perfect_measurement():
    rng, model, q = np.random.default_rng(5), tx60(), pool_r(4)
    C = correlated(rng, 4)
    table = tables.poses(q, model.poses(q), sd=C)
    blocks = whitened_blocks(model, q, C)
    np.testing.assert_allclose(
        blocks.reshape(-1, 42), linearize(model, table).A, rtol=1e-9, atol=1e-7
    )
    offset = rng.normal(size=(4, 3)) * 0.1
    points = replace(table, kind=np.full(4, POINT), offset=offset)
    rows = point_blocks(model, q, C[:, :3, :3], offset).reshape(-1, 42)
    np.testing.assert_allclose(rows, linearize(model, points).A, rtol=1e-9, atol=1e-7)


def test_a_point_row_ignores_rotation_and_its_covariance():
    rng, model = np.random.default_rng(6), tx60()
    table = mixed_table(model, rng, 1e-4)
    points = table.rows(~table.is_pose)
    other = replace(points, rotation=np.tile(np.eye(3), (3, 1, 1)), covariance=points.covariance)
    spoiled = other.covariance.copy()
    spoiled[:, 3:, :], spoiled[:, :, 3:] = 0, 0
    other = replace(other, covariance=spoiled)
    np.testing.assert_array_equal(linearize(model, points).r, linearize(model, other).r)


def test_twelve_rows_hold_the_gram_matrix_of_six_weighted_ones():
    """H'H = 2 Jw'Jw + Jp'Jp, in mm and rad: the paper's estimator is one of six rows."""
    model, q = tx60(), pool_r(29)
    table = tables.poses(q, model.poses(q), sd=(1e-3, np.sqrt(0.5)))
    H, A = paper_stack(model, table).A, linearize(model, table).A
    assert H.shape == (29 * 12, 42)
    assert np.abs(H.T @ H - A.T @ A).max() < 1e-12 * np.abs(H.T @ H).max()


def test_twelve_row_jacobian_is_minus_the_difference_quotient():
    rng, model = np.random.default_rng(7), tx60()
    q = pool_r(3)
    table = tables.poses(
        q, model.moved(rng.normal(size=42) * 1e-2).poses(q), sd=np.eye(6)[None] * np.ones((3, 1, 1))
    )
    A = paper_stack(model, table).A
    change = slopes(lambda step: paper_stack(model.moved(step), table).r, np.zeros(42), 1e-5)
    assert np.abs(change + A).max() <= 1e-8 * np.abs(A).max()


def test_twelve_rows_refuse_a_table_with_points():
    table = mixed_table(tx60(), np.random.default_rng(8), 1e-4)
    with pytest.raises(InputError, match="row 1 is a point"):
        paper_stack(tx60(), table)


def test_a_stack_cannot_be_written_to():
    stack = Stack(np.zeros(2), np.zeros((2, 3)), np.zeros(2, dtype=np.int64))
    assert not any(a.flags.writeable for a in (stack.r, stack.A, stack.row_of))
