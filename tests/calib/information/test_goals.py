"""Goals: what V and G predict is what linear propagation says of the tool point."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.information.criteria.named import criterion_named
from calib.information.goals import Goals, goal_matrix
from calib.information.propagation import point_uncertainty, tool_covariance
from tests.calib.design.design_cases import goal_set, whitened_pool
from tests.calib.slopes import slopes
from tests.reference import WEN24, pool_r, tx60

Q = pool_r(12, 99)


def test_v_and_g_are_the_mean_and_the_worst_of_propagated_covariances():
    model, parameters = tx60(), parameters_of(tx60(), WEN24)
    A = whitened_pool(40).reshape(-1, 24)
    full = np.zeros((model.n_numbers, model.n_numbers))
    free, scale = parameters.free_index, parameters.free_scale
    full[np.ix_(free, free)] = np.linalg.inv(A.T @ A) * scale * scale[:, None]
    u = point_uncertainty(tool_covariance(model, Q, full))
    goals = goal_matrix(model, Q, parameters)
    # two ways to the same variance, condition of M about 100
    assert criterion_named("V", goals=goals).figure(A.T @ A, 40) == pytest.approx(
        np.sqrt(np.mean(u**2)), rel=1e-9
    )
    assert criterion_named("G", goals=goals).figure(A.T @ A, 40) == pytest.approx(u.max(), rel=1e-9)
    weights = np.arange(12.0)
    weighted = goal_matrix(model, Q, parameters, weights=weights)
    assert criterion_named("V", goals=weighted).figure(A.T @ A, 40) == pytest.approx(
        np.sqrt(weights @ u**2 / weights.sum()), rel=1e-9
    )


def test_rows_are_the_motion_of_a_point_on_the_tool():
    model, parameters, target = tx60(), parameters_of(tx60(), WEN24), np.array([0.03, 0.1, 0.2])
    rows = goal_matrix(model, Q, parameters, target=target).rows
    seen = slopes(
        lambda step: (model.moved(step).poses(Q) @ np.append(target, 1))[:, :3],
        np.zeros(model.n_numbers), by=parameters.free_index,
    )  # fmt: skip
    # central difference: rounding 1e-16 / 1e-6 on values up to 3
    np.testing.assert_allclose(rows, seen * parameters.free_scale, atol=2e-9)


def test_a_goal_pose_of_no_weight_does_not_count_as_the_worst():
    goals = goal_set(n=5)
    some = Goals(goals.rows, np.array([1.0, 0, 1, 0, 1]))
    M = np.eye(24)
    assert criterion_named("G", goals=some).figure(M, 1) == pytest.approx(
        np.sqrt(np.square(goals.rows[[0, 2, 4]]).sum((1, 2)).max())
    )


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Goals(np.zeros((0, 3, 4)), np.zeros(0)), "the goal has no poses"),
        (lambda: Goals(np.zeros((2, 3, 4)), np.ones(2)), "no free number moves the tool point"),
        (lambda: Goals(np.ones((2, 3, 4)), np.array([1.0, -1])), "must not be negative"),
        (lambda: Goals(np.ones((2, 3, 4)), np.zeros(2)), "nor all zero"),
        (lambda: goal_matrix(tx60(), np.zeros((0, 6)), parameters_of(tx60())), "no poses"),
        (lambda: goal_matrix(tx60(), np.full((1, 6), np.nan), parameters_of(tx60())), "is nan"),
    ],
)
def test_goals_that_say_nothing_are_refused(make, says: str):
    with pytest.raises(InputError, match=says):
        make()
