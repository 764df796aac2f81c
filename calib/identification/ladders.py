"""Ladders of joint errors: nested levels for each cause, from few terms to many.

A level is a set of joint errors with their prior. The levels of one ladder replace each other,
those of several ladders add up; the first level of each is empty.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array
from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, JointTerm, harmonic_terms
from calib.geometry.model import RobotModel
from calib.identification.gravity_ladder import gravity_ladder
from calib.identification.levels import NOTHING, Ladder, Level
from calib.information.sizes import FIRST, SAG, SECOND, usual_sizes
from calib.kinds import checked_kinds

SMALL = 0.25
"""Factor on the usual prior sd of waves of orders 1 and 2, at a level of small waves."""
FEW = 2.0
"""Factor on the prior sd of waves of orders 3 and 4, where they are the highest."""
MAP_ORDERS = 32
"""Highest order of the waves of a joint map."""


@checked_kinds
def ladders_of(
    nominal: RobotModel,
    mounted: Chain | None = None,
    *,
    moments: Array | None = None,
    limits: ArrayLike | None = None,
    payload: Array | None = None,
    waves: tuple[float, float] = (FIRST, SECOND),
    sag: float = SAG,
) -> tuple[Ladder, ...]:
    """Ladders of gravity and of waves for an arm; its own terms are in every model.

    Parameters
    ----------
    nominal : RobotModel
        Model that terms are added to.
    mounted : Chain, optional
        The arm in a world whose z axis points up; see `joint_models.extended_model`.
    moments : (n, 4) array, optional
        Masses and first moments of the links in their body frames [kg, kg m]; assumed if left out.
    limits : (n, 2) array_like, optional
        Joint limits [rad, m]. The largest torques within them set the scale of the compliances; the
        measured poses alone may hardly load a joint.
    payload : (4,) array, optional
        Mean moments of the payloads, where rows state them [kg, kg m]; if left out, the prior
        allows for an unstated payload.
    waves : pair of float, optional
        Prior sd of waves of orders 1 and 2 [rad].
    sag : float, optional
        Prior sd of the deflection at the largest torque [rad].
    """
    bends = gravity_ladder(
        nominal, mounted, moments=moments, limits=limits, payload=payload, sag=sag
    )
    return bends, _waves(nominal, waves)


def _waves(nominal: RobotModel, sizes: tuple[float, float]) -> Ladder:
    """Ladder of waves of each revolute joint: small ones, usual ones, and whole maps."""
    chain = nominal.chain
    if not (chain.prismatic == 0).any():
        return Ladder("waves", (NOTHING,), ("waves: no joint of this robot turns",))

    every = [
        (int(term.order), term)
        for term in _new(nominal, harmonic_terms(chain.n_joints, tuple(range(1, MAP_ORDERS + 1))))
        if chain.kinds[term.joint] == "revolute"
    ]

    def level(
        name: str, share: float, orders: Iterable[int] = (), few: float = 1.0, usual: bool = False
    ) -> Level:
        parts = {1: share, 2: share} | dict.fromkeys(orders, few)
        own = ((term, parts[order]) for order, term in every if order in parts)
        errors = JointErrors(
            tuple(term if term.share == part else replace(term, share=part) for term, part in own)
        )
        return Level(name, errors, usual_sizes(errors, chain.kinds, waves=sizes), usual)

    beyond = range(3, MAP_ORDERS + 1)
    wider = (
        level("small waves", SMALL),
        level("waves", 1.0, usual=True),
        level("waves 1 to 4", 1.0, (3, 4), FEW),
        level("joint map with small waves", SMALL, beyond),
        level("joint map", 1.0, beyond),
    )
    known: list[Level] = []
    for each in wider:
        alike = any(each.names == one.names and np.array_equal(each.sd, one.sd) for one in known)
        if each.names and not alike:
            known.append(each)
    slides = [i + 1 for i, kind in enumerate(chain.kinds) if kind == "prismatic"]
    return Ladder("waves", (NOTHING, *known), tuple(f"joint {i}: it does not turn" for i in slides))


def _new(nominal: RobotModel, terms: tuple[JointTerm, ...]) -> tuple[JointTerm, ...]:
    """Terms that the model does not have yet."""
    known = set(nominal.joint_errors.names)
    return tuple(term for term in terms if term.name not in known)
