"""Joint springs that are observable under gravity: their load varies over the joint limits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.gravity import AXES, Axis, Weight, axis_places, gravity_regressor
from calib.geometry.springs import SprungJoints, across

POSTURES = 500
"""Postures drawn within the joint limits to find how large each torque gets."""
ANYWHERE = (np.pi, 1.0)
"""Limits assumed where none are stated: plus or minus this, revolute [rad] and prismatic [m]."""
FELT = 1e-6
"""A spring is observable if its load, and its change over poses, exceed this part of the largest
load of all."""


def postures(chain: Chain, limits: ArrayLike | None = None) -> Array:
    """Joint values (m, n) [rad, m] drawn evenly within the limits (n, 2), the same every time.

    Without limits, those of `ANYWHERE`.
    """
    if limits is None:
        most = np.where(chain.prismatic > 0, ANYWHERE[1], ANYWHERE[0])
        limits = np.column_stack([-most, most])
    (limits,) = check(f"{chain.n_joints} 2", limits=limits)
    lower, upper = limits.T
    return np.random.default_rng(0).uniform(lower, upper, (POSTURES, chain.n_joints))


@dataclass(frozen=True, slots=True, eq=False)
class Felt:
    """What gravity does about all axes of an arm at some postures: its springs are a part of it."""

    weight: Weight
    """What loads the springs."""
    q: Array
    """(m, n) postures [rad, m]."""
    G: Array
    """(m, n, 3, n + 1, 4) regressor of the torques there, as the arm stands."""
    tilt: float
    """Largest error of the stated mounting, in any direction [rad]."""
    loads: Array
    """(k, m, n, 3) torques as the arm stands and, with a tilt, as it may stand [N m or N]."""

    @classmethod
    def of(cls, weight: Weight, q: ArrayLike, *, tilt: float = 0.0) -> "Felt":
        """What is felt at postures q (m, n) all over the joint limits [rad, m].

        Measured postures alone may hardly load a joint, and leave its compliance undetermined
        elsewhere. With a tilt, axes that gravity loads only when the arm leans have springs, too.

        Raises
        ------
        InputError
            A3: `tilt` is negative.
        """
        q = joint_vectors(weight.chain, q)
        G = gravity_regressor(weight.chain, q, gravity=weight.gravity)
        upright = cls(weight, q, G, 0.0, weight.torques_by(G)[None])
        return upright.leaning(tilt) if tilt != 0 else upright

    def leaning(self, tilt: float) -> "Felt":
        """The same where the arm may lean by a tilt [rad] in any direction."""
        if not tilt >= 0:
            raise refuse("tilt", tilt, "0 rad or more", code="A3", message=f"tilt is {tilt:g}")
        weight, upright = self.weight, self.loads[:1]
        # torques are linear in gravity, and the axes lie across it
        turned = [np.cross(axis, weight.gravity) for axis in across(weight.gravity)]
        more = np.array([replace(weight, gravity=each).torques(self.q) for each in turned])
        sides = (np.cos(tilt) * upright + side * np.sin(tilt) * more for side in (1, -1))
        return replace(self, tilt=tilt, loads=np.concatenate([upright, *sides]))

    def springs(
        self, axes: Sequence[Axis] = AXES, *, free_moments: bool = False, passes: int = 1
    ) -> tuple[SprungJoints, tuple[str, ...]]:
        """Springs that gravity loads by different amounts, and a sentence for each other axis.

        Parameters
        ----------
        axes : sequence of {"x", "y", "z"}
            Which axes of every joint.
        free_moments : bool
            Whether the moments of links that load some spring are numbers too.
        passes : int
            As in `SprungJoints`.

        Returns
        -------
        SprungJoints
            The springs that can be observed; each has the largest load as its reference load.
        tuple of str
            One sentence for each axis without a spring: never loaded, or always alike.

        Raises
        ------
        InputError
            A3: `axes` names another axis.
        """
        weight, loads = self.weight, self.loads
        largest = np.abs(loads).max(axis=(0, 1), initial=0.0)
        changes = np.ptp(loads, axis=(0, 1)) > FELT * largest.max()
        felt, wanted = largest > FELT * largest.max(), np.isin(range(3), axis_places(axes))
        verb = np.tile(["bends", "bends", "turns"], (len(largest), 1)).astype("U11")
        verb[weight.chain.prismatic > 0, 2] = "pulls along"
        silent = tuple(
            f"joint {i + 1} {AXES[a]}: gravity {'always' if felt[i, a] else 'never'} "
            f"{verb[i, a]} it" + " alike, as an offset would" * bool(felt[i, a])
            for i, a in np.argwhere(wanted & ~(felt & changes))
        )
        joint, axis = np.nonzero(wanted & felt & changes)
        stated = np.zeros(weight.moments.shape, dtype=bool)
        springs = SprungJoints(
            weight, joint, axis, largest[joint, axis], stated, passes, self.tilt > 0
        )
        if free_moments:
            shares = np.abs(springs.shares_by(self.G))
            pull = shares.max(axis=(0, 1), initial=0.0).reshape(-1, 4)[:-1]
            springs = replace(springs, free=pull > FELT * pull.max())
        return springs, silent
