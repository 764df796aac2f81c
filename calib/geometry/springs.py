"""Springs behind every joint: how far an arm gives way to its own weight, and what that tells."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, Bool, Index, check, frozen, wrong_shape
from calib.errors import refuse
from calib.geometry.chain import joint_vectors
from calib.geometry.gravity import (
    MOMENTS,
    Weight,
    gravity_regressor,
    torque_slopes,
)

AXES: tuple[Literal["x", "y", "z"], ...] = ("x", "y", "z")
FELT = 1e-6
"""A spring is worth naming where its largest load is more than this part of the largest of all."""


@dataclass(frozen=True, slots=True, eq=False)
class Compliance:
    """What gives way in an arm, here nothing; as such it takes no place in a record."""


STIFF = Compliance()
"""An arm without springs."""


@dataclass(frozen=True, slots=True, eq=False)
class SprungJoints(Compliance):
    """Springs at some axes of some joints, loaded by gravity; what they are and do.

    A spring bends its joint by its number times its load's share of `load`. So a number is the bend
    at that load, an angle or a length, and number / load is the compliance. Moments of the links
    may be free as well: they load all springs alike, and only their products with the compliances
    are told by measurements.
    """

    weight: Weight
    """What loads the springs, on nominal links."""
    joint: Index
    """(p,) joint of each spring, 0-based."""
    axis: Index
    """(p,) its axis: 0, 1, 2 for x, y, z of `bodies`."""
    load: Array
    """(p,) at which the bend of a spring is its number [N m, or N along a slide]."""
    free: Bool
    """(n, 4) moments that are numbers too: what is added to those of `weight` [kg, kg m]."""
    passes: int = 1
    """1: loads of the stiff arm; each further pass weighs the arm as the last one has bent it."""

    def __post_init__(self) -> None:
        n = self.weight.chain.n_joints
        (load,) = check("p", load=self.load)
        for name, most in (("joint", n), ("axis", 3)):
            places = frozen(getattr(self, name), np.int64)
            if places.shape != load.shape:
                raise wrong_shape(name, places.shape, f"one per load, {len(load)}")
            if ((places < 0) | (places >= most)).any():
                wanted = f"0 to {most - 1}"
                raise refuse(name, places.tolist(), wanted, code="A3", message=f"{name} is not one")
            object.__setattr__(self, name, places)
        free = frozen(self.free, np.bool_)
        if free.shape != (n, 4):
            raise wrong_shape("free", free.shape, f"expected ({n}, 4)")
        if not (load > 0).all():
            message, fix = "load must be positive", "leave out springs that nothing loads"
            raise refuse("load", load.tolist(), code="A3", message=message, fix=fix)
        if self.passes < 1:
            message = f"passes is {self.passes}"
            raise refuse("passes", self.passes, "1 or more", code="A3", message=message)
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "free", free)

    def __repr__(self) -> str:
        return f"SprungJoints({len(self.load)} springs, {self.free.sum()} free moments)"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p + f numbers: ``spring2.z`` ... ``moment6.m``, ``moment6.hx`` ..."""
        springs = zip(self.joint, self.axis, strict=True)
        return (
            *(f"spring{joint + 1}.{AXES[axis]}" for joint, axis in springs),
            *(f"moment{i + 1}.{MOMENTS[k]}" for i, k in np.argwhere(self.free)),
        )

    @property
    def is_length(self) -> tuple[bool, ...]:
        """Whether a number is a length [m]; all others are angles [rad], or moments [kg, kg m]."""
        along = (self.weight.chain.prismatic[self.joint] > 0) & (self.axis == 2)
        return (*along.tolist(), *(False,) * int(self.free.sum()))

    @property
    def places(self) -> Index:
        """(p,) place of each spring among the 3 n bends."""
        return 3 * self.joint + self.axis

    def bends(self, q: Array, numbers: Array) -> Array:
        """Bends (m, n, 3) of the arm at rest at checked joints q (m, n) [rad, m]."""
        give, pi = self._parts(numbers)
        bends = np.zeros((*q.shape, 3))
        for _ in range(self.passes):
            bends = self._spread(give * (self._shares(q, bends) @ pi.ravel()))
        return bends

    def bends_and_slopes(self, q: Array, numbers: Array) -> tuple[Array, Array]:
        """Bends (m, n, 3), and the slopes (m, p, p + f) of the springs' by all numbers.

        Exact for any number of passes: what a number bends in one pass changes the loads of the
        next.
        """
        give, pi = self._parts(numbers)
        p, free = len(give), np.append(self.free.ravel(), [False] * 4)
        bends, slopes = np.zeros((*q.shape, 3)), np.zeros((len(q), p, len(numbers)))
        for turn in range(self.passes):
            if turn:
                slopes = give[:, None] * (self._stiffness(q, bends, pi)[:, :, self.places] @ slopes)
            shares = self._shares(q, bends)
            load = shares @ pi.ravel()
            slopes[:, range(p), range(p)] += load
            slopes[:, :, p:] += give[:, None] * shares[:, :, free]
            bends = self._spread(give * load)
        return bends, slopes

    def slopes_by_joint(self, q: Array, numbers: Array) -> Array:
        """Slopes (m, p, n) of the springs' bends by the joint values."""
        give, pi = self._parts(numbers)
        bends, slopes = np.zeros((*q.shape, 3)), np.zeros((len(q), len(give), q.shape[1]))
        for _ in range(self.passes):
            K = self._stiffness(q, bends, pi)
            slopes = give[:, None] * (K[:, :, 2::3] + K[:, :, self.places] @ slopes)
            bends = self._spread(give * (self._shares(q, bends) @ pi.ravel()))
        return slopes

    def _parts(self, numbers: Array) -> tuple[Array, Array]:
        """Bends (p,) at the loads of the springs, and moments (n + 1, 4) of links and payload."""
        give, change = np.split(numbers, [len(self.load)])
        pi = np.vstack([self.weight.moments, self.weight.payload])
        pi[:-1][self.free] += change
        return give, pi

    def _shares(self, q: Array, bends: Array | None) -> Array:
        """What each moment adds to the shares (m, p, 4 n + 4) of the springs' loads."""
        G = gravity_regressor(self.weight.chain, q, gravity=self.weight.gravity, bends=bends)
        return np.asarray(
            G[:, self.joint, self.axis].reshape(len(q), len(self.load), -1) / self.load[:, None]
        )

    def _stiffness(self, q: Array, bends: Array, pi: Array) -> Array:
        """Slopes (m, p, 3 n) of the springs' shares by all bends."""
        at = self.weight
        K = torque_slopes(at.chain, q, pi, gravity=at.gravity, bends=bends)
        return np.asarray(K[:, self.places] / self.load[:, None])

    def _spread(self, bent: Array) -> Array:
        """Bends (m, n, 3) of all joints from those of the springs (m, p)."""
        out = np.zeros((len(bent), self.weight.chain.n_joints, 3))
        out[:, self.joint, self.axis] = bent
        return out


def felt_springs(
    weight: Weight,
    q: ArrayLike,
    *,
    axes: Sequence[Literal["x", "y", "z"]] = AXES,
    free_moments: bool = False,
    passes: int = 1,
) -> tuple[SprungJoints, tuple[str, ...]]:
    """Springs wherever gravity loads a joint, and a sentence for every axis where it never does.

    Parameters
    ----------
    weight : Weight
        What loads them.
    q : (m, n) array_like
        Postures all over the joint limits: the largest load among them is the one at which a number
        is the bend [rad, m]. Measured postures alone may hardly load a joint, and its compliance
        would then be anything elsewhere.
    axes : sequence of {"x", "y", "z"}
        Which axes of every joint.
    free_moments : bool
        Whether the moments of all links that can be felt are numbers too.
    passes : int
        As in `SprungJoints`.
    """
    largest = np.abs(weight.torques(q)).max(axis=0, initial=0.0)
    felt, wanted = largest > FELT * largest.max(), np.isin(AXES, axes)
    verb = np.tile(["bends", "bends", "turns"], (len(largest), 1)).astype("U11")
    verb[weight.chain.prismatic > 0, 2] = "pulls along"
    silent = tuple(
        f"joint {i + 1} {AXES[a]}: gravity never {verb[i, a]} it"
        for i, a in np.argwhere(wanted & ~felt)
    )
    joint, axis = np.nonzero(wanted & felt)
    stated = np.zeros(weight.moments.shape, dtype=bool)
    springs = SprungJoints(weight, joint, axis, largest[joint, axis], stated, passes)
    if free_moments:
        shares = np.abs(springs._shares(joint_vectors(weight.chain, q), None))
        pull = shares.max(axis=(0, 1), initial=0.0).reshape(-1, 4)[:-1]
        springs = replace(springs, free=pull > FELT * pull.max())
    return springs, silent
