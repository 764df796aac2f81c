"""Ladders of joint errors: for each cause the levels that a model may climb, from few to many.

A level is a set of joint errors with what is believed of their sizes beforehand. The levels of one
ladder replace each other, those of several ladders add up; the first level of each is empty.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from calib.arrays import Array, check, frozen
from calib.geometry.chain import Chain
from calib.geometry.joint_errors import JointErrors, JointTerm, gravity_terms, harmonic_terms
from calib.geometry.model import NO_ERRORS, RobotModel
from calib.identification.joint_models import gravity_quarters
from calib.identification.prior import Prior
from calib.information.rank import FIRST, SAG, SECOND

MDEG = np.radians(1e-3)
SMALL = 0.25
"""Part of the usual sizes of one and two waves a turn at a level of small waves."""
HIGHER = 6 * MDEG
"""Of three and four waves a turn [rad]."""
MAP, MAP_ORDERS = 3 * MDEG, 32
"""Of each wave of a joint map from the third on, and how many waves a turn it knows [rad]: together
they are a stationary Gaussian process on the circle."""


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Joint errors that a model may have, and what is believed of their sizes."""

    name: str
    errors: JointErrors = NO_ERRORS
    """All of them zero."""
    sd: Array = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """(k,) prior standard deviation of each of its numbers [rad, m; kg, kg m; 1/K]."""
    usual: bool = False
    """Whether this is the level at which a model is shown that nobody asked for."""
    mean: Array = ()  # type: ignore[assignment]  # likewise
    """(k,) what its numbers are believed to be; zero if left out."""

    def __post_init__(self) -> None:
        k = len(self.errors.names)
        mean = self.mean if np.size(self.mean) else np.zeros(k)
        sd, mean = check(f"{k}, {k}", sd=self.sd, mean=mean)
        object.__setattr__(self, "sd", sd)
        object.__setattr__(self, "mean", mean)

    @property
    def names(self) -> tuple[str, ...]:
        """(k,) names of its numbers."""
        return self.errors.names

    def __repr__(self) -> str:
        return f"Level({self.name}: {len(self.errors.names)} numbers)"


NOTHING = Level("none")


@dataclass(frozen=True, slots=True, eq=False)
class Ladder:
    """The levels of one cause."""

    name: str
    levels: tuple[Level, ...]
    """The first one is empty."""
    why_not: str = ""
    """Why there is no further level; empty where there is one."""

    def __repr__(self) -> str:
        return f"Ladder({self.name}: {', '.join(level.name for level in self.levels)})"


def ladders_of(
    nominal: RobotModel,
    mounted: Chain | None = None,
    *,
    waves: tuple[float, float] = (FIRST, SECOND),
    sag: float = SAG,
) -> tuple[Ladder, ...]:
    """Ladders of gravity and of waves for an arm; its own terms are in every model.

    Parameters
    ----------
    nominal : RobotModel
        What terms are added to.
    mounted : Chain, optional
        The arm as it stands, with world z up; see `joint_models.extended_model`.
    waves, sag : float, optional
        Prior sd of one and two waves a turn, and of sag [rad].
    """
    return _gravity(nominal, mounted, sag), _waves(nominal, waves)


def _gravity(nominal: RobotModel, mounted: Chain | None, sag: float) -> Ladder:
    """Sag of joints 2 and 3, where its closed form holds."""
    quarters = gravity_quarters(nominal.chain if mounted is None else mounted)
    if quarters is None:
        why = (
            "sag: gravity does not turn joints 2 and 3 of this arm by waves of q2 and q2 + q3 alone"
        )
        return Ladder("gravity", (NOTHING,), why)
    terms = _new(nominal, gravity_terms(nominal.chain.n_joints, quarters))
    if not terms:
        return Ladder("gravity", (NOTHING,), "sag: the model has it already")
    return Ladder(
        "gravity", (NOTHING, Level("sag", JointErrors(terms), np.full(len(terms), sag), True))
    )


def _waves(nominal: RobotModel, sizes: tuple[float, float]) -> Ladder:
    """Waves of each turning joint: small ones, usual ones, and whole maps."""
    chain = nominal.chain
    if not (chain.prismatic == 0).any():
        return Ladder("waves", (NOTHING,), "waves: no joint of this robot turns")

    def level(
        name: str,
        share: float,
        orders: Iterable[int] = (),
        size: float = 0.0,
        usual: bool = False,
    ) -> Level:
        known = {1: share * sizes[0], 2: share * sizes[1]} | dict.fromkeys(orders, size)
        terms = _new(nominal, harmonic_terms(chain.n_joints, tuple(known)))
        terms = tuple(term for term in terms if chain.kinds[term.joint] == "revolute")
        sd = np.array([known[int(order_of(term))] for term in terms])
        return Level(name, JointErrors(terms), sd, usual)

    beyond = range(3, MAP_ORDERS + 1)
    wider = (
        level("small waves", SMALL),
        level("waves", 1.0, usual=True),
        level("waves 1 to 4", 1.0, (3, 4), HIGHER),
        level("joint map with small waves", SMALL, beyond, MAP),
        level("joint map", 1.0, beyond, MAP),
    )
    known: list[Level] = []
    for each in wider:
        alike = any(each.names == one.names and np.array_equal(each.sd, one.sd) for one in known)
        if each.names and not alike:
            known.append(each)
    return Ladder("waves", (NOTHING, *known))


def order_of(term: JointTerm) -> float:
    """Waves a turn of a term of one joint."""
    return max(abs(weight) for weight in term.weights)


def _new(nominal: RobotModel, terms: tuple[JointTerm, ...]) -> tuple[JointTerm, ...]:
    """Those that the model does not have yet."""
    known = set(nominal.joint_errors.names)
    return tuple(term for term in terms if term.name not in known)


def joined(levels: Iterable[Level]) -> JointErrors:
    """The joint errors of some levels as one."""
    return reduce(JointErrors.joined, (level.errors for level in levels), NO_ERRORS)


def with_errors(nominal: RobotModel, added: JointErrors) -> RobotModel:
    """The model with joint errors added that are zero: same poses as before."""
    return replace(nominal, joint_errors=nominal.joint_errors.joined(added))


def prior_of(levels: Iterable[Level]) -> Prior:
    """What is believed of the numbers of some levels, which are independent."""
    levels = tuple(levels)
    mean, sd = (np.concatenate([getattr(level, key) for level in levels]) for key in ("mean", "sd"))
    names = tuple(name for level in levels for name in level.names)
    return Prior(frozen(mean), frozen(sd), names)
