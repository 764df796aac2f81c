"""Springs of many robots of one kind as arrays: what loads them, and how far they give way.

Loads of the stiff arm are linear in the moments of its links and in gravity. What they are at some
joints hangs on no number, and is made once.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.springs import SprungJoints, tilted
from calib.shown import Shown


class ManyLoads(NamedTuple):
    """What loads the p springs of R robots at m poses, as shares of `SprungJoints.load`."""

    give: Array
    """(R, p) bends at a share of one [rad, m]."""
    load: Array
    """(R, p, m)"""
    by_weight: Array
    """(R or 1, w, p, m) slopes by each free moment, then by each tilt [1/kg, 1/(kg m), 1/rad]."""
    by_both: Array
    """(R, f, t, p, m) how those by moments change with tilts; t is 0 where there are none."""

    @property
    def bends(self) -> Array:
        """(R, p, m) of the springs [rad, m]."""
        return np.asarray(self.give[:, :, None] * self.load)

    def slopes(self, number: int) -> Array:
        """Slopes of bends by one number: (1, R, m) of its own spring, (p, R, m) by a weight."""
        p = self.give.shape[1]
        if number < p:
            return self.load[None, :, number]
        return np.swapaxes(self.give[:, :, None] * self.by_weight[:, number - p], 0, 1)

    def curvature(self, pull: Array) -> Array:
        """Second derivatives (R, s, s) by the numbers of the springs of what pulls (R, p, m) bend.

        Of products of two numbers, all that there is but for how tilts turn gravity beyond a slope.
        """
        p, f = self.give.shape[1], self.by_both.shape[1]
        out = np.zeros((len(self.give), p + self.by_weight.shape[1], p + self.by_weight.shape[1]))
        out[:, :p, p:] = np.einsum("rpm,rwpm->rpw", pull, self.by_weight)
        out[:, p : p + f, p + f :] = np.einsum(
            "rpm,rftpm->rft", self.give[:, :, None] * pull, self.by_both
        )
        return out + np.swapaxes(out, 1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class ManySprings(Shown):
    """What may load springs of one kind at some joints."""

    springs: SprungJoints
    """Loaded by the stiff arm: one pass."""
    shares: Array
    """(R or 1, g, 1 + f, p, m) of the loads by the stated moments, then by each free one; under
    gravity as stated, or where tilts turn it under one of 1 m/s^2 along each axis of the base."""

    @classmethod
    def of(cls, springs: SprungJoints, q: Array) -> "ManySprings":
        """At joints q (R or 1, m, n) [rad, m]."""
        flat, weight = q.reshape(-1, q.shape[2]), springs.weight
        along = np.eye(3) if springs.tilts else [weight.gravity]
        each = (replace(springs, weight=replace(weight, gravity=axis)) for axis in along)
        torques = [np.concatenate([t[..., None], f], 2) for t, f in (s.torques(flat) for s in each)]
        shares = np.array(torques) / springs.load[:, None]
        by_robot = np.moveaxis(shares.reshape(len(torques), *q.shape[:2], *shares.shape[2:]), 1, 0)
        return cls(springs, np.ascontiguousarray(by_robot.transpose(0, 1, 4, 3, 2)))

    def some(self, which: slice | Index) -> "ManySprings":
        """Of some robots."""
        return self if len(self.shares) == 1 else replace(self, shares=self.shares[which])

    def loads(self, numbers: Array) -> ManyLoads:
        """Under numbers (R, s) of each robot."""
        p, f = len(self.springs.load), int(self.springs.free.sum())
        moments = np.hstack([np.ones((len(numbers), 1)), numbers[:, p : p + f]])
        if not self.springs.tilts:
            shares = self.shares[:, 0]
            none = np.zeros((len(numbers), f, 0, *shares.shape[2:]))
            return ManyLoads(numbers[:, :p], _sum(moments, shares), shares[:, 1:], none)
        gravity, by_tilt = tilted(self.springs.weight.gravity, numbers[:, p + f :])
        shares, *turned = (_sum(down, self.shares) for down in (gravity, *by_tilt.swapaxes(0, 1)))
        by_weight = [shares[:, 1:], *(_sum(moments, each)[:, None] for each in turned)]
        by_both = np.stack([each[:, 1:] for each in turned], 2)
        load = _sum(moments, shares)
        return ManyLoads(numbers[:, :p], load, np.concatenate(by_weight, 1), by_both)

    def spread(self, bends: Array) -> Array:
        """Bends (n, 3, R, m) of all joints from those (R, p, m) of the springs [rad, m]."""
        out = np.zeros((self.springs.weight.chain.n_joints, 3, len(bends), bends.shape[2]))
        out[self.springs.joint, self.springs.axis] = bends.swapaxes(0, 1)
        return out


def _sum(weights: Array, parts: Array) -> Array:
    """Sums (R, ...) of parts (R or 1, k, ...), weighed by (R, k).

    Each robot by itself: a product of matrices would let its bits depend on how many there are.
    """
    flat = parts.reshape(*parts.shape[:2], -1)
    return np.asarray((weights[:, None] @ flat).reshape(len(weights), *parts.shape[2:]))
