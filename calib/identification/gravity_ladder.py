"""The ladder of gravity: from sag in closed form to springs at every axis of every joint."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.bodies import Z
from calib.geometry.chain import Chain
from calib.geometry.felt_springs import felt_springs, postures
from calib.geometry.gravity import Weight, weight_of
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import CHARACTERISTIC_LENGTH
from calib.geometry.springs import SprungJoints
from calib.identification.joint_models import gravity_quarters
from calib.identification.levels import NOTHING, Ladder, Level
from calib.information.rank import BEARING, SAG

SMALL_BEARING = 0.25
"""Part of the usual bends across a joint's axis at a level of small bearings."""
UNSURE = 0.5
"""Part of its own size by which a moment of a link may be wrong."""
UNSAID = 2.0
"""Payload that may hang on the last link though nobody says so [kg]."""
BESIDE = 0.1
"""How far from the flange, and the shortest reach that a link's moments are judged by [m]."""


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
    believed = doubted(weight, said=payload is not None)
    q = postures(chain, limits)
    across, silent = felt_springs(weight, q, free_moments=True)
    along, _ = felt_springs(weight, q, axes=("z",), free_moments=True)
    levels = [NOTHING]
    quarters = gravity_quarters(stands)
    if quarters is not None:
        terms = gravity_terms(chain.n_joints, quarters)
        levels.append(Level("sag", JointErrors(terms), np.full(len(terms), sag), usual=True))
    if len(along.load):
        levels.append(_level("sag by torques", along, sag, usual=quarters is None))
    if len(along.load) < len(across.load):
        beside = "sag and " * bool(len(along.load))
        levels.append(_level(f"{beside}small bearings", across, sag, SMALL_BEARING))
        levels.append(_level(f"{beside}bearings", across, sag))
    if along.free.any():
        levels.append(_level("springs", along, sag, moments=believed))
    if len(along.load) < len(across.load) and across.free.any():
        levels.append(_level("springs and bearings", across, sag, moments=believed))
    return Ladder("gravity", tuple(levels), silent)


def _level(
    name: str,
    springs: SprungJoints,
    sag: float,
    bearings: float = 1.0,
    *,
    moments: Array | None = None,
    usual: bool = False,
) -> Level:
    """Springs with their prior: small bends at the largest torque, moments near those stated."""
    if moments is None:
        springs = replace(springs, free=np.zeros_like(springs.free))
    size = sag * np.where(springs.axis == Z, 1.0, BEARING / SAG * bearings)
    # along a slide a turn counts as far as it reaches
    size = size * np.where(springs.is_length[: len(size)], CHARACTERISTIC_LENGTH, 1.0)
    sd = size if moments is None else np.concatenate([size, moments[springs.free]])
    return Level(name, JointErrors(springs=springs), sd, usual)


def doubted(weight: Weight, *, said: bool = False) -> Array:
    """Prior sd (n, 4) of what is added to the moments of links that are stated, or guessed.

    Unless it is `said` what hangs on the flange, something may hang there.
    """
    links = weight.chain.links
    reach = np.maximum(np.hypot(links[:, 1], links[:, 2]), BESIDE)[:, None]
    sd = UNSURE * weight.moments[:, :1] * np.hstack([np.ones_like(reach), np.tile(reach, 3) / 2])
    if not said:
        sd[-1] = np.hypot(sd[-1], UNSAID * np.array([1, BESIDE, BESIDE, reach[-1, 0] + BESIDE]))
    return np.asarray(sd)
