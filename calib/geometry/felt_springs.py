"""Where gravity loads a joint over its limits: the springs that it can tell of."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check
from calib.errors import refuse
from calib.geometry.chain import Chain, joint_vectors
from calib.geometry.gravity import (
    AXES,
    Axis,
    Weight,
    axis_places,
)
from calib.geometry.springs import SprungJoints, across

POSTURES = 500
"""Drawn within the joint limits to see how large a torque gets."""
ANYWHERE = (np.pi, 1.0)
"""Limits of joints that nobody states: of turning ones, and of sliding ones [rad, m]."""
FELT = 1e-6
"""A spring is worth naming where its largest load is more than this part of the largest of all."""


def postures(chain: Chain, limits: ArrayLike | None = None) -> Array:
    """Joint values (m, n) all over the limits (n, 2), or anywhere where nobody states them."""
    if limits is None:
        most = np.where(chain.prismatic > 0, ANYWHERE[1], ANYWHERE[0])
        limits = np.column_stack([-most, most])
    (limits,) = check(f"{chain.n_joints} 2", limits=limits)
    lower, upper = limits.T
    return np.random.default_rng(0).uniform(lower, upper, (POSTURES, chain.n_joints))


def felt_springs(
    weight: Weight,
    q: ArrayLike,
    *,
    axes: Sequence[Axis] = AXES,
    free_moments: bool = False,
    passes: int = 1,
    tilt: float = 0.0,
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
    tilt : float
        How far the base may be mounted off what is stated, in any direction [rad]. Above zero the
        tilts are numbers too, and springs that only a tilted arm loads are there.
    """
    if not tilt >= 0:
        raise refuse("tilt", tilt, "0 rad or more", code="A3", message=f"tilt is {tilt:g}")
    loads = weight.torques(q)[None]
    if tilt:  # torques are linear in gravity, and the axes lie across it
        turned = [np.cross(axis, weight.gravity) for axis in across(weight.gravity)]
        more = np.array([replace(weight, gravity=each).torques(q) for each in turned])
        sides = (np.cos(tilt) * loads + side * np.sin(tilt) * more for side in (1, -1))
        loads = np.concatenate([loads, *sides])
    largest = np.abs(loads).max(axis=(0, 1), initial=0.0)
    changes = np.ptp(loads, axis=(0, 1)) > FELT * largest.max()
    felt, wanted = largest > FELT * largest.max(), np.isin(range(3), axis_places(axes))
    verb = np.tile(["bends", "bends", "turns"], (len(largest), 1)).astype("U11")
    verb[weight.chain.prismatic > 0, 2] = "pulls along"
    silent = tuple(
        f"joint {i + 1} {AXES[a]}: gravity {'always' if felt[i, a] else 'never'} {verb[i, a]} it"
        + " alike, as an offset would" * bool(felt[i, a])
        for i, a in np.argwhere(wanted & ~(felt & changes))
    )
    joint, axis = np.nonzero(wanted & felt & changes)
    stated = np.zeros(weight.moments.shape, dtype=bool)
    springs = SprungJoints(weight, joint, axis, largest[joint, axis], stated, passes, tilt > 0)
    if free_moments:
        shares = np.abs(springs.shares(joint_vectors(weight.chain, q), weight.gravity, None))
        pull = shares.max(axis=(0, 1), initial=0.0).reshape(-1, 4)[:-1]
        springs = replace(springs, free=pull > FELT * pull.max())
    return springs, silent
