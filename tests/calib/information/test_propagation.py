"""From parameter covariance to tool covariance, by the Jacobian."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import exp_so3, transform
from calib.geometry.model import RobotModel
from calib.information.propagation import (
    axis_uncertainty,
    distance_uncertainty,
    point_uncertainty,
    propagated,
    tool_covariance,
)
from tests.calib.slopes import slopes, twist
from tests.reference import DEG, pool_r, tx60

Q = pool_r(20)


def random_covariance(seed=0, names=("theta2", "a2", "alpha3", "d3", "tool.x", "base.rz")):
    """A full covariance that moves the named numbers by about 0.05 mm and 0.01 deg, correlated."""
    model = tx60()
    index = [model.names.index(name) for name in names]
    rng = np.random.default_rng(seed)
    L = rng.normal(size=(len(index), len(index)))
    u = np.where([model.is_length[i] for i in index], 5e-5, 0.01 * DEG)
    C = np.zeros((model.n_numbers, model.n_numbers))
    C[np.ix_(index, index)] = (L @ L.T) * np.outer(u, u)
    return C


def test_each_number_moves_the_tool_as_a_finite_difference_says():
    model, some = tx60(), (1, 6, 9, 14, 22, 41)
    numeric = slopes(
        lambda step: model.moved(step).poses(Q), np.zeros(model.n_numbers), by=some, minus=twist
    )
    for k, slope in zip(some, np.moveaxis(numeric, 2, 0), strict=True):
        C = np.zeros((model.n_numbers, model.n_numbers))
        C[k, k] = 1.0
        # central difference: h^2 = 1e-12 and rounding 1e-16 / h = 1e-10
        np.testing.assert_allclose(
            tool_covariance(model, Q, C), slope[:, :, None] * slope[:, None, :], atol=2e-9
        )


def test_turning_the_world_turns_the_covariance_and_keeps_its_size():
    R = exp_so3(np.array([0.3, -1.1, 0.7]))
    model, C = tx60(), random_covariance(names=("theta2", "a2", "alpha3", "tool.x"))
    turned = RobotModel(replace(model.chain, T_world_base=transform(R, np.array([1.0, 2.0, 3.0]))))
    here, there = tool_covariance(model, Q, C), tool_covariance(turned, Q, C)
    both = np.kron(np.eye(2), R)
    # variances are about 1e-9 m^2; 1e-12 relative of them
    np.testing.assert_allclose(there, both @ here @ both.T, atol=1e-21)
    np.testing.assert_allclose(point_uncertainty(there), point_uncertainty(here), rtol=1e-12)


def test_knowing_less_about_the_robot_never_sharpens_the_tool_point():
    model, C = tx60(), random_covariance(0)
    more = C + random_covariance(1)
    assert (
        point_uncertainty(tool_covariance(model, Q, more))
        >= point_uncertainty(tool_covariance(model, Q, C))
    ).all()


def test_the_point_figure_is_the_root_sum_of_the_axes_and_no_less_than_any_direction():
    sigma, position = tool_covariance(tx60(), Q, random_covariance()), tx60().poses(Q)[:, :3, 3]
    axes = axis_uncertainty(sigma)
    np.testing.assert_allclose(point_uncertainty(sigma), np.linalg.norm(axes, axis=1), rtol=1e-14)
    assert (distance_uncertainty(sigma, position) <= point_uncertainty(sigma)).all()
    np.testing.assert_array_equal(point_uncertainty(sigma[:, :3, :3]), point_uncertainty(sigma))


def test_a_turn_of_the_base_moves_the_tool_but_not_its_distance():
    C = random_covariance(names=("base.rx", "base.ry", "base.rz"))
    sigma, position = tool_covariance(tx60(), Q, C), tx60().poses(Q)[:, :3, 3]
    assert (point_uncertainty(sigma) > 1e-5).all()
    # what |P| cannot see is rounding only: sqrt(1e-16) = 1e-8 of the whole
    assert (distance_uncertainty(sigma, position) < 1e-7 * point_uncertainty(sigma)).all()


def test_a_covariance_of_the_wrong_size_is_refused():
    with pytest.raises(InputError, match="covariance"):
        tool_covariance(tx60(), Q, np.eye(24))


def test_a_tool_that_nothing_uncertain_moves_has_no_uncertainty_and_no_nan():
    """Of a covariance v v' rows across v have none; rounding leaves half of them below zero."""
    rng = np.random.default_rng(0)
    v = rng.standard_normal(6)
    across = np.linalg.svd(v[None])[2][1:]
    rows = rng.standard_normal((50, 3, 5)) @ across
    sigma = propagated(rows, np.outer(v, v))
    assert (np.diagonal(sigma, axis1=1, axis2=2) < 0).any()
    # sums of a few products of numbers near one, then a root
    assert point_uncertainty(sigma).max() < 1e-7
    np.testing.assert_array_equal(point_uncertainty(np.eye(3)[None] * [[4.0, -1e-30, 0.0]]), [2.0])
