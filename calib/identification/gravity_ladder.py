"""The ladder of gravity: from sag in closed form to springs at every axis of every joint."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.felt_springs import felt_springs, postures
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.springs import UNSAID, SprungJoints
from calib.identification.joint_models import gravity_quarters
from calib.identification.levels import NOTHING, Ladder, Level
from calib.information.sizes import usual_sizes

SMALL_BEARING = 0.25
"""Part of the usual bends across a joint's axis at a level of small bearings."""


def gravity_ladder(
    nominal: RobotModel,
    mounted: Chain | None = None,
    *,
    moments: Array | None = None,
    limits: ArrayLike | None = None,
    payload: Array | None = None,
    sag: float,
) -> Ladder:
    """Levels of what gravity bends, of any serial arm.

    Sag in closed form where that holds, compliances of the joints times torques, the same with
    bearings, and springs: compliances with moments of the links that are free as well, all together
    about one arm. Parameters as in `ladders.ladders_of`.
    """
    chain, known = nominal.chain, nominal.joint_errors
    if known.springs is not None or any(name.startswith("gravity") for name in known.names):
        return Ladder("gravity", (NOTHING,), ("sag: the model has it already",))
    stands = chain if mounted is None else mounted
    weight = weight_of(chain, stands, moments, payload)
    q = postures(chain, limits)
    across, silent = felt_springs(weight, q, free_moments=True)
    along, _ = felt_springs(weight, q, axes=("z",), free_moments=True)
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

    if len(along.load):
        levels.append(level("sag by torques", along, usual=quarters is None))
    if len(along.load) < len(across.load):
        beside = "sag and " * bool(len(along.load))
        levels.append(level(f"{beside}small bearings", across, SMALL_BEARING))
        levels.append(level(f"{beside}bearings", across))
    if along.free.any():
        levels.append(level("springs", along, moments=True))
    if len(along.load) < len(across.load) and across.free.any():
        levels.append(level("springs and bearings", across, moments=True))
    return Ladder("gravity", tuple(levels), silent)
