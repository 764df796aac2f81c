"""What the levels of ladders are: joint errors that a model may have, and how large they may be."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from calib.arrays import Array, check, frozen, require_numbers
from calib.errors import refuse
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import NO_ERRORS, RobotModel
from calib.identification.prior import Prior
from calib.kinds import check_fields
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class Level(Shown):
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
    after: str = ""
    """Level from which alone a climb comes here: this one refines it, and must be asked for beside
    it."""

    def __post_init__(self) -> None:
        check_fields(self)
        k = len(self.errors.names)
        mean = self.mean if require_numbers("mean", self.mean).size else np.zeros(k)
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
class Ladder(Shown):
    """The levels of one cause."""

    name: str
    levels: tuple[Level, ...]
    """The first one is empty."""
    why_not: tuple[str, ...] = ()
    """What is not offered, and why: ``joint 1 z: gravity never turns it``."""

    def __repr__(self) -> str:
        return f"Ladder({self.name}: {', '.join(level.name for level in self.levels)})"


def joined(levels: Iterable[Level]) -> JointErrors:
    """The joint errors of some levels as one."""
    return reduce(JointErrors.joined, (level.errors for level in levels), NO_ERRORS)


def distinct_terms(errors: Iterable[JointErrors]) -> tuple[JointTerm, ...]:
    """The terms of some joint errors, each name once.

    Raises
    ------
    InputError
        A4: a name stands for two of them, which would be taken for one.
    """
    found: dict[str, JointTerm] = {}
    for term in (term for each in errors for term in each.terms):
        first = found.setdefault(term.name, term)
        if replace(first, share=term.share) != term:
            message = f"two levels have different terms of the name {term.name}"
            raise refuse("ladders", term.name, code="A4", message=message, fix="rename one of them")
    return tuple(found.values())


def foreseen(levels: Iterable[Level]) -> bool:
    """Whether levels need no reported torques: nobody knows these of a pose not yet reached."""
    return all(term.wave != "torque" for level in levels for term in level.errors.terms)


def with_errors(nominal: RobotModel, added: JointErrors) -> RobotModel:
    """The model with joint errors added that are zero: same poses as before."""
    return replace(nominal, joint_errors=nominal.joint_errors.joined(added))


def prior_of(levels: Iterable[Level]) -> Prior:
    """What is believed of the numbers of some levels, which are independent."""
    levels = tuple(levels)
    mean, sd = (np.concatenate([getattr(level, key) for level in levels]) for key in ("mean", "sd"))
    names = tuple(name for level in levels for name in level.names)
    return Prior(frozen(mean), frozen(sd), names)
