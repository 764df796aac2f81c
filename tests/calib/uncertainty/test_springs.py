"""Uncertainty of arms that give way: every kernel against the poses of the model itself."""

import numpy as np
import pytest

from calib.measurement.noise import with_joint_noise
from calib.uncertainty.monte_carlo import propagate
from tests.calib.geometry.test_springs import sprung
from tests.calib.slopes import slopes


@pytest.mark.parametrize("passes", [1, 2])
def test_tool_points_of_many_sprung_robots_are_those_of_each_of_them(passes):
    rng = np.random.default_rng(passes)
    model, q = sprung(rng, passes), rng.uniform(-2, 2, (5, 6))
    steps = rng.normal(size=(4, model.n_numbers)) * 1e-3
    steps[3, 54:] = 0.0
    expected = [model.moved(step).poses(q)[:, :3, 3] for step in steps]
    np.testing.assert_allclose(propagate(model, q, steps), expected, rtol=0, atol=1e-14)


def test_noise_of_the_joints_moves_a_sprung_arm_as_its_joints_do():
    """Against poses of an arm whose links are turned by as much, on the same springs."""
    rng = np.random.default_rng(3)
    model, q = sprung(rng, 1), rng.uniform(-2, 2, (3, 6))
    turning = [i for i in range(6) if model.chain.kinds[i] == "revolute"]
    J = np.zeros((3, 3, 6))
    angles = [6 + 5 * i for i in turning]
    J[:, :, turning] = slopes(
        lambda step: model.moved(step).poses(q)[:, :3, 3], np.zeros(model.n_numbers), by=angles
    )
    sd = np.zeros(6)
    sd[turning] = 1e-5
    sigma = with_joint_noise(model, q, np.zeros((3, 6, 6)), sd)[:, :3, :3]
    expected = 1e-10 * J @ np.swapaxes(J, 1, 2)
    # differences: 1e-9 of a meter
    np.testing.assert_allclose(sigma, expected, rtol=0, atol=1e-8 * expected.max())
