"""Many arms at rest on their springs as arrays, held to the body tree of each."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.many import ManyModels, poses_of
from calib.geometry.model import RobotModel
from testbed.laboratory.truth.many import ManyTrueRobots
from testbed.laboratory.truth.many_springs import ManyTrueSprings
from testbed.laboratory.truth.robot import TrueRobot
from testbed.laboratory.truth.springs import ElasticArm
from testbed.laboratory.truth.terms import Approach, UnmodelledTerms
from tests.testbed.laboratory.test_springs import BEARING, CHAIN, DRIVE, anywhere, springs

POSES = 40
OWN = (
    springs(),
    springs(bearing=np.zeros(0)),
    springs(drive=0.5 * DRIVE, payload=4.0, payload_center=[0.1, -0.05, 0.2]),
    springs(bearing=0.3 * BEARING, gravity=np.array([3.0, -2.0, -9.0])),
)


def arms(seed=2):
    """Chains of their own, each base turned anyhow."""
    rng = np.random.default_rng(seed)
    return [CHAIN.moved(rng.normal(0, 1e-2, 42) + 0.3 * (np.arange(42) < 6)) for _ in OWN]


def rest(own, some=slice(None)):
    """Models of some arms, their links at rest, each at poses of its own, and these (R, m, n)."""
    chains, q = arms()[some], anywhere(POSES * len(own)).reshape(len(own), POSES, 6)[some]
    models = ManyModels.each(RobotModel(chains[0]), [RobotModel(one) for one in chains])
    return models, ManyTrueSprings.of(own).some(some).links(models, np.moveaxis(q, 2, 0)), q


def test_arms_rest_where_the_body_tree_of_each_does():
    """To the rounding of a few metres; they give way by tenths of millimetres and more."""
    models, links, q = rest(OWN)
    T = poses_of(*models.frames(links))
    for found, chain, own, at in zip(T, arms(), OWN, q, strict=True):
        rigid = RobotModel(chain).poses(at)
        assert np.abs(found - rigid)[:, :3, 3].max(axis=0).min() > 1e-4
        np.testing.assert_allclose(found, ElasticArm(chain, own).poses(at), rtol=0, atol=1e-13)


def test_no_bit_of_a_bend_hangs_on_how_long_others_take():
    own = [springs(drive=share * DRIVE) for share in (0.2, 1.0, 30.0, 1e3)]
    together = rest(own)[1]
    for k in range(len(own)):
        alone = rest(own, slice(k, k + 1))[1]
        # cosine and sine of the turn and of the bends about x and y
        for one, many in zip(alone[::2], together[::2], strict=True):
            for part in (0, 1, 4, 5, 6, 7):
                np.testing.assert_array_equal(one[part][0], many[part][k])


def test_an_arm_that_its_springs_do_not_carry_is_told_as_alone():
    soft, q = springs(drive=1e-3 * DRIVE), anywhere(5)
    with pytest.raises(InputError, match="the sprung arm gives way at q") as alone:
        ElasticArm(CHAIN, soft).poses(q)
    models, both = ManyModels.of(RobotModel(CHAIN), 2), ManyTrueSprings.of([springs(), soft])
    with pytest.raises(InputError) as together:
        both.links(models, q.T[:, None])
    assert str(together.value) == str(alone.value)


def test_arms_in_motion_or_under_changing_payloads_are_left_to_each():
    def robots(*own, motion=None):
        return [
            TrueRobot(RobotModel(CHAIN), np.zeros(6), UnmodelledTerms(springs=one, motion=motion))
            for one in own
        ]

    assert ManyTrueRobots.of(robots(springs(), springs(drive=2 * DRIVE))) is not None
    assert ManyTrueRobots.of(robots(springs(), None)) is None
    changing = replace(springs(), payloads=np.array([0.0, 5.0]))
    assert ManyTrueRobots.of(robots(changing)) is None
    move = Approach(np.ones(6), 0.0, 0.1, 1.0, np.ones(6), 0.1)
    assert ManyTrueRobots.of(robots(springs(), motion=move)) is None
