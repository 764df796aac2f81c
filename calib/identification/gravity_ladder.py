"""The ladder of gravity: from sag in closed form to springs at every axis of every joint."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.bodies import X, Y, Z
from calib.geometry.chain import Chain
from calib.geometry.felt_springs import Felt, postures
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.springs import UNSAID, SprungJoints
from calib.identification.joint_models import gravity_quarters
from calib.identification.levels import NOTHING, Ladder, Level
from calib.information.sizes import usual_sizes

SMALL_BEARING = 0.25
"""Factor on the usual prior sd of bends across a joint's axis, at a level of small bearings."""
LYING = np.pi / 2
"""Tilt at which reference loads of springs are taken that only a tilted arm loads [rad]. A small
tilt hardly loads them, which makes their compliance no larger."""


def gravity_ladder(
    nominal: RobotModel,
    mounted: Chain | None = None,
    *,
    moments: Array | None = None,
    limits: ArrayLike | None = None,
    payload: Array | None = None,
    sag: float,
) -> Ladder:
    """Ladder of gravity deflections, for any serial arm.

    Its levels are sag in closed form where that holds; compliances of the joints; these with
    compliances of the bearings; and each of the last two with the moments of the links free as
    well. Then all of these but sag in closed form and small bearings once more, for an arm whose
    mounting may differ a little from that stated. Parameters as in `ladders.ladders_of`.
    """
    chain, known = nominal.chain, nominal.joint_errors
    if known.springs is not None or any(name.startswith("gravity") for name in known.names):
        return Ladder("gravity", (NOTHING,), ("sag: the model has it already",))
    stands = chain if mounted is None else mounted
    weight = weight_of(chain, stands, moments, payload)
    felt = Felt.of(weight, postures(chain, limits))
    across, silent = felt.springs(free_moments=True)
    along, _ = felt.springs(("z",), free_moments=True)
    levels = [NOTHING]
    quarters = gravity_quarters(stands)
    if quarters is not None:
        closed = JointErrors(gravity_terms(chain.n_joints, quarters))
        levels.append(Level("sag", closed, usual_sizes(closed, chain.kinds, sag=sag), usual=True))

    def level(
        name: str,
        springs: SprungJoints,
        bearings: float = 1.0,
        moments: bool = False,
        usual: bool = False,
    ) -> Level:
        free = springs.free if moments else np.zeros_like(springs.free)
        unsaid = UNSAID if payload is None else 0.0
        own = replace(springs, free=free, bearings=bearings, unsaid=unsaid)
        errors = JointErrors(springs=own)
        return Level(name, errors, usual_sizes(errors, chain.kinds, sag=sag), usual)

    more = len(along.load) < len(across.load)
    bearings = f"{'sag and ' * bool(len(along.load))}bearings"
    offered = [
        (name, springs, free)
        for name, springs, free in (
            ("sag by torques", along, False),
            (bearings, across, False),
            ("springs", along, True),
            ("springs and bearings", across, True),
        )
        if len(springs.load) and (springs is along or more) and (springs.free.any() or not free)
    ]
    for name, springs, free in offered:
        if name == bearings:
            small = name.replace("bearings", "small bearings")
            levels.append(level(small, springs, SMALL_BEARING))
        alone = name == "sag by torques" and quarters is None
        levels.append(level(name, springs, moments=free, usual=alone))
    wide, _ = felt.leaning(LYING).springs()
    for name, springs, free in offered:
        lying = _leaning(springs, wide, [Z] if springs is along else [X, Y, Z])
        tilted = level(f"{name} on a tilted base", lying, moments=free)
        levels.append(replace(tilted, after=name))
    if quarters is None:
        silent += ("sag: waves of joints 2 and 3 are not what gravity does to this arm",)
    if not offered:
        silent += ("tilted base: nothing gives way that could show it",)
    return Ladder("gravity", tuple(levels), silent)


def _leaning(upright: SprungJoints, wide: SprungJoints, axes: Sequence[int]) -> SprungJoints:
    """Springs of `wide` about some axes, with the reference loads of `upright` where known."""
    kept = np.isin(wide.axis, axes)
    known = dict(zip(upright.places.tolist(), upright.load.tolist(), strict=True))
    places = zip(wide.places[kept].tolist(), wide.load[kept].tolist(), strict=True)
    load = np.array([known.get(place, lying) for place, lying in places])
    return replace(wide, joint=wide.joint[kept], axis=wide.axis[kept], load=load, free=upright.free)
