"""Frames of an arm as its owner's file writes them, moved onto identified axes and written anew."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce

import numpy as np

from calib.arrays import Array
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import inverse
from testbed.robots.placements import difference, proof_joints, require_agreement
from testbed.robots.write.own.nearest_frames import DescribedArm, nearest_frames

PROOFS = 65
"""Poses at which a file is compared."""
SAME = 1e-12
"""Change of an entry of a frame up to which its numbers stay as they are written [m, 1]."""


class NotCorrectableError(Exception):
    """Why a file cannot be written with other frames, as the end of a sentence."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A frame that a file states between root and tip, in the one before."""

    name: str
    own: Array
    """(4, 4) as it is written [m]."""
    axis: Array | None = None
    """(3,) unit vector of the joint that moves it, in this frame; None if it is fixed."""
    lean: Array = field(default_factory=partial(np.eye, 4))
    """(4, 4) from what is written to a frame on the axis, the joint at zero [m]."""
    back: Array = field(default_factory=partial(np.eye, 4))
    """(4, 4) from there to what the frames that follow are written in [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedFile:
    """A description with the frames of an identified robot."""

    data: bytes
    """All of it."""
    root: str
    """Name of its root."""
    changed: tuple[str, ...]
    """Names of the frames that differ from the file's, base to tip."""
    what: str
    """What they are, in words."""
    moved: tuple[float, float]
    """Largest shift [m] and largest turn [rad] of one, seen from the frame before it."""
    agreement: tuple[float, float]
    """How far its poses are from those of the robot, as another reader has them [m, rad]."""
    last: str
    """The last joint on the way to the tip, if the tip moves with it; else empty."""
    left: tuple[float, float]
    """Shift [m] and turn [rad] of the tip that no frame can take: only where the tip moves with its
    own joint, about whose axis nothing but a turn and a slide is free."""


def is_same(T: Array, other: Array) -> bool:
    """Whether two frames (4, 4) are the same to rounding."""
    return bool(np.abs(T - other).max() <= SAME)


def _arm_of(way: Sequence[Place]) -> DescribedArm:
    """Its frames as the file has them."""
    steps, since = [], list[Array]()
    for place in way:
        since += [place.own, place.lean]
        if place.axis is not None:
            steps.append(_product(since))
            since = [place.back]
    axes = [place.axis for place in way if place.axis is not None]
    return DescribedArm(steps, axes, _product(since))


def identified_places(
    way: Sequence[Place], nominal: Chain, chain: Chain
) -> tuple[list[Array], Array]:  # fmt: skip
    """`_new_places` of a robot as it was identified, whose file has it as `nominal`."""
    frames = nearest_frames(_arm_of(way), chain, nominal.T_flange_tool)
    return _new_places(way, frames, forward(chain, np.zeros((1, chain.n_joints)))[0])


def proven(
    name: str, poses: Callable[[Array], Array], chain: Chain, left: Array, limits: Array
) -> tuple[float, float]:
    """How far another reader has a new file from the robot [m, rad].

    Parameters
    ----------
    name : str
        What the file is called in an error.
    poses : function
        Poses (m, 4, 4) of its tip at joint values (m, n), as the reader has them.
    chain : Chain
        The robot.
    left : (4, 4) array
        What of its tip no frame could take.
    limits : (n, 2) array
        Of its joints [rad, m].

    Raises
    ------
    RuntimeError
        They differ by more than `placements.LIMIT`: a defect of this program.
    """
    q = proof_joints(limits, PROOFS)
    found = difference(poses(q), forward(chain, q) @ inverse(left))
    require_agreement(name, *found)
    return found


def _new_places(way: Sequence[Place], frames: Array, tip: Array) -> tuple[list[Array], Array]:
    """New frame (4, 4) of each place as it is to be written, and what is left of the tip [m].

    Each moving place takes what its link needs, the last fixed one before the tip what the tip
    needs; fixed ones before and between them stay.

    Parameters
    ----------
    way : sequence of Place
        As the file has it.
    frames : (n, 4, 4) array
        Those on the axes in the root, all joints at zero, from `nearest_frames` [m].
    tip : (4, 4) array
        Where the tip is to be then [m].
    """
    before, since, k = np.eye(4), list[Array](), 0
    out = []
    for place in way:
        if place.axis is None:
            since.append(place.own)
            out.append(place.own)
            continue
        out.append(inverse(before @ _product(since)) @ frames[k] @ inverse(place.lean))
        before, since, k = frames[k] @ place.back, [], k + 1
    if not since:
        return out, inverse(before) @ tip
    out[-1] = inverse(before @ _product(since[:-1])) @ tip
    return out, np.eye(4)


def largest_move(pairs: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Largest shift [m] and turn [rad] from old to new frames, seen from the old ones."""
    steps = np.array([np.eye(4), *(inverse(old) @ new for old, new in pairs)])
    return difference(steps, np.tile(np.eye(4), (len(steps), 1, 1)))


def _product(frames: Sequence[Array]) -> Array:
    """Frames (k) of (4, 4), each in the one before, as one."""
    return reduce(np.matmul, frames, np.eye(4))
