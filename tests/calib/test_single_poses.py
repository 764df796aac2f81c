"""One pose at a time, against the batched sweep."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.single_poses import SinglePoses
from tests.calib import kinds
from tests.calib.uncertainty.test_monte_carlo import MODELS


@pytest.mark.parametrize("name", MODELS)
def test_single_poses_are_those_of_the_sweep(name):
    rng = np.random.default_rng(11)
    model = MODELS[name](rng)
    model = model.moved(1e-3 * rng.normal(size=model.n_numbers))
    fast, q = SinglePoses.of(model), rng.normal(size=(20, model.chain.n_joints))
    # the same products in another order
    assert np.abs(np.stack([fast.pose(each) for each in q]) - model.poses(q)).max() < 1e-14


def test_joints_may_be_a_column_of_a_table():
    model = RobotModel(kinds.ARMS["tx60"])
    table = np.random.default_rng(2).normal(size=(6, 3))
    table.setflags(write=False)
    found = SinglePoses.of(model).pose(table[:, 1])
    np.testing.assert_allclose(found, model.poses(table.T)[1], rtol=0, atol=1e-14)


def test_what_a_single_pose_cannot_know_is_refused():
    model = RobotModel(kinds.ARMS["tx60"])
    fast = SinglePoses.of(model)
    with pytest.raises(InputError, match="q has 5 values"):
        fast.pose(np.zeros(5))
    with pytest.raises(InputError, match=r"q has shape \(6, 1\)"):
        fast.pose(np.zeros((6, 1)))
    play = JointErrors((JointTerm("approach1", 0, "approach", (1, 0, 0, 0, 0, 0)),))
    with pytest.raises(InputError, match="no waves of its joints"):
        SinglePoses.of(replace(model, joint_errors=play))
