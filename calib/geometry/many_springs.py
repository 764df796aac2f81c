"""Joint springs of many robots of one kind as arrays: their loads and their bends.

The loads of the rigid arm are linear in the moments of its links and in gravity. Their coefficients
at given joint values depend on no number of the model, and are computed once.
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
    """(R, p, m) load of each spring."""
    by_weight: Array
    """(R or 1, w, p, m) its derivative by each free moment, then each tilt [1/kg, 1/(kg m), 1/rad].
    """
    by_both: Array
    """(R, f, t, p, m) mixed derivative by moments and tilts; t is 0 where there are none."""

    @property
    def bends(self) -> Array:
        """(R, p, m) bend of each spring [rad, m]."""
        return np.asarray(self.give[:, :, None] * self.load)

    def slopes(self, number: int) -> Array:
        """Derivative of bends by one number: (1, R, m) by that of a spring, else (p, R, m)."""
        p = self.give.shape[1]
        if number < p:
            return self.load[None, :, number]
        return np.swapaxes(self.give[:, :, None] * self.by_weight[:, number - p], 0, 1)

    def curvature(self, pull: Array) -> Array:
        """Hessian (R, s, s), by the numbers, of the sum of bends weighted by `pull` (R, p, m).

        Exact but for the second derivative of gravity by the tilts, which is left out.
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
    """Coefficients of the loads of springs of one kind, at given joint values."""

    springs: SprungJoints
    """With one pass: the loads are those of the rigid arm."""
    shares: Array
    """(R or 1, g, 1 + f, p, m) loads by the stated moments, then per unit of each free one: under
    gravity as stated (g = 1), or, with tilts, per 1 m/s^2 along each axis of the base (g = 3)."""

    @classmethod
    def of(cls, springs: SprungJoints, q: Array) -> "ManySprings":
        """Coefficients at joint values q (R or 1, m, n) [rad, m]."""
        flat, weight = q.reshape(-1, q.shape[2]), springs.weight
        along = np.eye(3) if springs.tilts else [weight.gravity]
        each = (replace(springs, weight=replace(weight, gravity=axis)) for axis in along)
        torques = [np.concatenate([t[..., None], f], 2) for t, f in (s.torques(flat) for s in each)]
        shares = np.array(torques) / springs.load[:, None]
        by_robot = np.moveaxis(shares.reshape(len(torques), *q.shape[:2], *shares.shape[2:]), 1, 0)
        return cls(springs, np.ascontiguousarray(by_robot.transpose(0, 1, 4, 3, 2)))

    def some(self, which: slice | Index) -> "ManySprings":
        """The coefficients of some of the robots."""
        return self if len(self.shares) == 1 else replace(self, shares=self.shares[which])

    def loads(self, numbers: Array) -> ManyLoads:
        """Loads for the numbers (R, s) of each robot."""
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
        """Bends (n, 3, R, m) of all joints from the bends (R, p, m) of the springs [rad, m]."""
        out = np.zeros((self.springs.weight.chain.n_joints, 3, len(bends), bends.shape[2]))
        out[self.springs.joint, self.springs.axis] = bends.swapaxes(0, 1)
        return out


def _sum(weights: Array, parts: Array) -> Array:
    """Weighted sums (R, ...) of parts (R or 1, k, ...), with weights (R, k).

    One product per robot: with one for all, rounding would depend on how many robots there are.
    """
    flat = parts.reshape(*parts.shape[:2], -1)
    return np.asarray((weights[:, None] @ flat).reshape(len(weights), *parts.shape[2:]))
