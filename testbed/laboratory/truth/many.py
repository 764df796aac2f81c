"""Many true robots of one kind as arrays: where they stop, without a body tree of each.

Chains with sums of waves in their joints and play, stiff or at rest on their springs: rigid robots,
and those of wen2022, soft, unmodelled and elastic. Arms in motion, warming up or under payloads
that change are played one by one, by MuJoCo: a robot of a study, some 170 poses, takes 14 ms on
springs and 2.7 s in motion; by arrays 2 to 4, drawing it included.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.geometry.many import ManyModels, poses_of
from testbed.laboratory.truth.many_springs import ManyTrueSprings
from testbed.laboratory.truth.robot import TrueRobot
from testbed.laboratory.truth.terms import Backlash, last_moves

SAME = 1e-12
"""Largest difference between arrays and body tree [m, 1]: the rounding of a few meters."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyTrueRobots:
    """R true robots alike in everything but their numbers."""

    models: ManyModels
    """Geometry and joint errors [m, rad]."""
    joint_repeatability: Array
    """(R, n) standard deviation of each joint at each approach [rad or m]."""
    backlash: Backlash | None
    springs: ManyTrueSprings | None
    """On which they rest; None of stiff ones."""

    @classmethod
    def of(cls, robots: Sequence[TrueRobot]) -> "ManyTrueRobots | None":
        """Robots of one kind; None where arrays do not know them, or they are not alike."""
        first = robots[0]
        for one in robots:
            errors, beyond = one.model.joint_errors, one.unmodelled
            bare = beyond.motion is None and beyond.thermal is None and errors.springs is None
            bare &= all(term.is_wave for term in errors.terms)
            alike = errors.terms == first.model.joint_errors.terms
            alike &= (beyond.springs is None) == (first.unmodelled.springs is None)
            bare &= beyond.springs is None or not len(beyond.springs.payloads)
            if not (bare and alike and _same_play(beyond.backlash, first.unmodelled.backlash)):
                return None
        chains = [one.model.chain for one in robots]
        models = ManyModels(
            first.model,
            np.array([chain.links for chain in chains]),
            np.array([chain.T_world_base[:3] for chain in chains]),
            np.array([chain.T_flange_tool[:3] for chain in chains]),
            np.array([one.model.joint_errors.coefficients for one in robots]),
        )
        scatter = np.array([one.joint_repeatability for one in robots])
        own = [one.unmodelled.springs for one in robots if one.unmodelled.springs is not None]
        springs = ManyTrueSprings.of(own) if own else None
        return cls(models, scatter, first.unmodelled.backlash, springs)

    def __len__(self) -> int:
        return len(self.models)

    def poses(self, q: Array, *, normal: Array | None = None) -> Array:
        """True tool poses (R, m, 4, 4) at commanded q (R or 1, m, n), visited in turn from zero on.

        As `TrueRobot.poses`, in meters; `normal` (R, m, n) are the standard normal numbers of the
        joint repeatability, without which there is none.
        """
        reached = self.models.reached(q)
        if self.backlash is not None:
            n = q.shape[2]
            moves = np.concatenate([last_moves(one) for one in q])
            play = self.backlash.offsets(q.reshape(-1, n), moves)
            reached = reached + np.moveaxis(play.reshape(q.shape), 2, 0)
        if normal is not None:
            scatter = normal * self.joint_repeatability[:, None]
            reached = reached + np.moveaxis(scatter, 2, 0)
        if self.springs is None:
            return self.models.poses_at(reached)
        return poses_of(*self.models.frames(self.springs.links(self.models, reached)))

    def require_same(self, robot: TrueRobot, q: Array, k: int = 0) -> None:
        """Let the body tree of robot k stand at q (m, n) too, and hold the arrays to it."""
        previous = np.vstack([np.zeros((1, q.shape[1])), q[:-1]])
        own = slice(k, k + 1)
        springs = self.springs and self.springs.some(own)
        one = replace(self, models=self.models.some(own), springs=springs)
        there = robot.poses(q, previous=previous, moves=last_moves(q))
        off = np.abs(one.poses(q[None])[0] - there).max()
        if off > SAME:
            raise RuntimeError(f"arrays and the body tree of a robot differ by {off:.1e}")


def _same_play(one: Backlash | None, other: Backlash | None) -> bool:
    """Whether two robots have the same play."""
    if one is None or other is None:
        return one is other
    return one.side == other.side and np.array_equal(one.half_width, other.half_width)
