"""The uncertainty that a design promises is the error that its calibrations make."""

import numpy as np
import pytest

from calib.design import Problem, exchange
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.information.criteria.named import criterion_named
from calib.measurement.accuracy import position_errors
from tests.calib.design.design_cases import goal_set, whitened_pool
from tests.reference import WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

CALIBRATIONS = 300


@pytest.mark.truth
def test_predicted_tool_point_uncertainty_is_the_error_of_simulated_calibrations():
    q, rng = pool_r(), np.random.default_rng(3)
    goals, target = goal_set(n=200), pool_r(2000, 99)[:200]
    v = criterion_named("V", goals=goals)
    chosen = exchange(Problem.of_blocks(whitened_pool(), 29, v), rng, restarts=2)
    nominal, squares = tx60(), []
    parameters = parameters_of(nominal, WEN24)
    for _ in range(CALIBRATIONS):
        truth = rigid_truth(rng)
        found = identify(nominal, measured(truth, q[chosen.indices], rng), parameters)
        squares.append(
            np.square(position_errors(truth.poses(target), found.model.poses(target))).mean()
        )
    # the design is made at the nominal robot, the calibrations are of others; the relative sd of
    # the mean of 300 is about 1.2 %
    assert np.sqrt(np.mean(squares)) == pytest.approx(chosen.value, rel=0.05)
