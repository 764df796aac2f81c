"""Targets whose angles are wrong by more than stated: what they pull the tool point by is believed.

The tracker's angles lean with the direction of the beam on the target, as those of a camera do.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.many.judgements import judge_many
from calib.uncertainty.outlying.angles import loud_turns
from tests.truth.foreign import candidates, turn
from tests.truth.foreign_cells import TARGETS, Cell, drawn, readings
from tests.truth.foreign_tracker import JOINT_SD, STATION, ForeignTracker

pytestmark = pytest.mark.truth
ROBOTS, LEAN = 12, np.radians(30e-3)


@dataclass(frozen=True)
class LeaningTracker(ForeignTracker):
    """Angles are wrong by a linear function of the beam in the axes of the target [rad]."""

    lean: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def shown(self, p, R, error=0.0):
        seen, turned = super().shown(p, R, error)
        beam = (p - STATION) / np.linalg.norm(p - STATION, axis=1)[:, None]
        at_target = np.einsum("mji,mj->mi", R, beam)
        return seen, turned @ turn(at_target @ self.lean.T)


def measured(robot, lean, cell=None):
    """One robot's fit and tables by a tracker that leans so, and targets with their true points."""
    cell, rng = cell or Cell(), np.random.default_rng([robot, 11])
    arm, _, _, q = drawn(cell, robot, rng)
    tracker = LeaningTracker(lean=lean * rng.standard_normal((3, 3)))
    fit, train, test, order = readings(cell, arm, tracker, rng, *q)
    at = candidates(rng, TARGETS, arm.body)
    return fit, train, test, order, at, arm.poses(at)[0]


def belief_of(fit, train, test, order):
    """What is believed of it."""
    known = Circumstances(order=order, repeatability=np.full(6, JOINT_SD))
    return judge(fit, test, train=train, circumstances=known)


def test_what_loud_angles_pull_the_tool_point_by_is_in_the_region():
    shares = []
    for robot in range(ROBOTS):
        *found, at, points = measured(robot, LEAN)
        judgement = belief_of(*found)
        assert judgement.belief.turned > LEAN / 3
        assert any(
            "The measured angles are off by up to" in one for one in judgement.trust.sentences
        )
        shares.append(judgement.belief.regions(at).holds(points).mean())
    # without it the mean of these is 0.74, the least 0.23; of 30 it is 0.978 +- 0.006
    assert np.mean(shares) > 0.95
    assert min(shares) > 0.8


@pytest.mark.parametrize("cell", [Cell(), Cell("mixture", 4.0), Cell("play", 4.0)], ids=str)
def test_angles_as_stated_change_nothing_nor_does_a_misfit_of_the_joints(cell):
    for robot in range(4):
        *found, _, _ = measured(robot, 0.0, cell)
        assert belief_of(*found).belief.turned == 0


def with_wrong_shots(table, count):
    """The same with the target of the first rows turned by a degree more."""
    rotation = table.rotation.copy()
    rotation[:count] = rotation[:count] @ turn(np.full((count, 3), np.radians(1.0)))
    return replace(table, rotation=rotation)


def test_a_few_wrong_shots_are_no_loud_angles():
    for robot in range(3):
        fit, train, test, *_ = measured(robot, 0.0)
        assert loud_turns(fit, train, with_wrong_shots(test, 3)) is None
        plain = loud_turns(*measured(robot, LEAN)[:3])
        fit, train, test, *_ = measured(robot, LEAN)
        among = loud_turns(fit, train, with_wrong_shots(test, 3))
        # one step of the sizes that are tried is 6 %
        assert among.size == pytest.approx(plain.size, rel=0.2)


def test_a_robot_with_loud_angles_is_judged_by_itself():
    found = [measured(robot, LEAN * (robot == 1)) for robot in range(3)]
    fits, trains, tests, _, targets, _ = zip(*found, strict=True)
    # the positions are those of the same pose numbers for all, as robots that go together have them
    assert judge_many(fits, trains, tests, targets).alone.tolist() == [False, True, False]
