"""Joints that never moved: how their links stand is in no reading, and no target that moves them
has a statement."""

import numpy as np
import pytest

from calib.uncertainty.judgement import Circumstances, judge
from tests.truth.foreign import candidates
from tests.truth.foreign_cells import TARGETS, Cell, drawn, readings
from tests.truth.foreign_tracker import JOINT_SD

pytestmark = pytest.mark.truth


def believed_of(robot, still):
    """Belief on a rigid arm whose joint `still` stood, targets as drawn, and the true arm."""
    cell, rng = Cell(), np.random.default_rng([robot, 13])
    arm, _, tracker, (train, held_out) = drawn(cell, robot, rng)
    train[:, still] = 0.3
    held_out[:, still] = 0.3
    fit, seen, test, order = readings(cell, arm, tracker, rng, train, held_out)
    known = Circumstances(order=order, repeatability=np.full(6, JOINT_SD))
    at = candidates(rng, TARGETS, arm.body)
    belief = judge(fit, test, train=seen, circumstances=known).belief
    return belief, at, lambda q: arm.poses(q)[0]


@pytest.mark.parametrize("still", [0, 3, 5])
def test_targets_that_move_a_joint_that_stood_still_have_no_statement(still):
    """Where they had one, at the edge, 0 to 5 % of the true points were within it."""
    for robot in range(3):
        belief, at, truth = believed_of(robot, still)
        far = np.abs(at[:, still] - 0.3) > 0.5
        assert belief.regions(at).holds(truth(at))[far].mean() < 0.5
        assert (belief.proven.applies(at[far]).place == "outside").all()
        stood = at.copy()
        stood[:, still] = 0.3
        reach = belief.proven.applies(stood)
        assert (reach.place != "outside").mean() > 0.9
        assert belief.regions(stood).holds(truth(stood)).mean() > 0.95
