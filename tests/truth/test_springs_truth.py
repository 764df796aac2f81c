"""Springs of a robot model against the sprung arm that MuJoCo brings to rest."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.gravity import Weight, moments_of
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.springs import SprungJoints, felt_springs
from testbed.laboratory.truth.springs import ElasticArm
from testbed.laboratory.truth.terms import Springs
from testbed.robots.catalog import load_robot
from testbed.store.codec import pack, unpack

pytestmark = pytest.mark.truth
DRIVE = np.array([9e4, 9e4, 4e4, 1.2e4, 1e4, 6e3])
BEARING = np.array([6e5, 5e5, 3e5, 1e5, 8e4, 5e4])
"""Of the preset `elastic`, from base to tip [N m/rad]."""
ROUNDING = 1e-15
"""Of tool positions of arms of a meter [m]."""


def droops(arm: str, poses: int, share: float) -> tuple[Array, Array]:
    """Truth (m, 3), and by linear columns, one, two, three passes (4, m, 3) [m]."""
    robot, place = load_robot(arm), [0.0, 0.0, 0.05]
    n = len(robot.masses)
    along = (np.arange(n) * 5) // (n - 1)
    drive, bearing = DRIVE[along] / share, BEARING[along] / share
    q = np.random.default_rng(0).uniform(*robot.limits.T, (poses, n))
    sprung = Springs(
        robot.masses, robot.centers, robot.inertias, drive, bearing, 2.0, np.array(place)
    )
    true = ElasticArm(robot.model.chain, sprung).poses(q)[:, :3, 3]
    weight = Weight(
        robot.model.chain,
        moments_of(robot.masses, robot.centers),
        moments_of([2.0], [place])[0],
    )
    # all of them, also those that feel gravity only once others have bent
    joint, axis, every = np.repeat(range(n), 3), np.tile(range(3), n), np.ones(3 * n)
    springs = SprungJoints(weight, joint, axis, every, np.zeros((n, 4), dtype=bool))
    stiff, found = RobotModel(robot.model.chain, JointErrors(springs=springs)), []
    step = np.zeros(stiff.n_numbers)
    step[stiff.chain.n_numbers :] = 1 / np.stack([bearing, bearing, drive], axis=1).ravel()
    T, J = stiff.poses_and_jacobian(q)
    found.append(T[:, :3, 3] + J[:, :3] @ step)
    for passes in (1, 2, 3):
        errors = JointErrors(springs=replace(springs, passes=passes))
        found.append(replace(stiff, joint_errors=errors).moved(step).poses(q)[:, :3, 3])
    return true, np.array(found)


@pytest.mark.parametrize("poses", [25, pytest.param(150, marks=pytest.mark.study)])
@pytest.mark.parametrize("arm", ["staubli_tx60", "universal_ur10", "kuka_iiwa7"])
def test_each_pass_misses_by_one_more_power_of_the_compliance(arm, poses):
    """Halved compliance: a quarter by columns and one pass, then an eighth, then a sixteenth."""
    misses = []
    for share in (1.0, 0.5, 0.25, 0.125):
        true, found = droops(arm, poses, share)
        misses.append(np.linalg.norm(found - true, axis=2).max(axis=1))
    misses = np.array(misses)
    ratios = misses[:-1] / misses[1:]
    seen = misses[1:] > 100 * ROUNDING / 3  # rounding is then less than three parts in a hundred
    expected = np.broadcast_to([4.0, 4.0, 8.0, 16.0], ratios.shape)
    assert seen[:, :3].all()
    assert seen[0, 3]
    assert ratios[seen] == pytest.approx(expected[seen], rel=0.03)


def test_a_record_of_a_stiff_model_has_no_place_for_springs_and_loses_none_in_silence():
    robot = load_robot("staubli_tx60")
    flat = pack(robot.model)
    assert not [path for path in flat if "springs" in path]
    assert unpack(RobotModel, flat).joint_errors.sprung is None
    weight = Weight(robot.model.chain, moments_of(robot.masses, robot.centers))
    springs = felt_springs(weight, np.random.default_rng(1).uniform(*robot.limits.T, (50, 6)))[0]
    sprung = RobotModel(robot.model.chain, JointErrors(springs=springs))
    with pytest.raises(InputError, match="coefficients has 15 entries"):
        unpack(RobotModel, pack(sprung))
