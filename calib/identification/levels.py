"""Levels and ladders: joint errors that a model may have, with the prior of their numbers."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache, reduce

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
    """Joint errors that a model may have, with the prior of their numbers."""

    name: str
    """Name within its ladder."""
    errors: JointErrors = NO_ERRORS
    """The joint errors, with coefficients of zero."""
    sd: Array = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """(k,) prior standard deviation of each of its numbers [rad, m; kg, kg m; 1/K]."""
    usual: bool = False
    """Whether the extended model is shown with this level if the climb takes none."""
    mean: Array = ()  # type: ignore[assignment]  # likewise
    """(k,) prior mean of its numbers; zero if left out."""
    after: str = ""
    """The only level from which a climb reaches this one, which refines it; empty for any."""

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
    """Levels of joint errors of one cause, of which a model has one."""

    name: str
    """The cause."""
    levels: tuple[Level, ...]
    """Levels from few terms to many; the first one is empty."""
    why_not: tuple[str, ...] = ()
    """Terms that are not offered, and why: ``joint 1 z: gravity never turns it``."""

    def __repr__(self) -> str:
        return f"Ladder({self.name}: {', '.join(level.name for level in self.levels)})"


def joined(levels: Iterable[Level]) -> JointErrors:
    """The joint errors of some levels as one."""
    return reduce(JointErrors.joined, (level.errors for level in levels), NO_ERRORS)


def distinct_terms(errors: Iterable[JointErrors]) -> tuple[JointTerm, ...]:
    """Terms of several joint errors, each name once.

    Raises
    ------
    InputError
        A4: two different terms have one name.
    """
    found: dict[str, JointTerm] = {}
    for term in (term for each in errors for term in each.terms):
        first = found.setdefault(term.name, term)
        if replace(first, share=term.share) != term:
            message = f"two levels have different terms of the name {term.name}"
            raise refuse("ladders", term.name, code="A4", message=message, fix="rename one of them")
    return tuple(found.values())


def foreseen(levels: Iterable[Level]) -> bool:
    """Whether levels need no reported torques, which are unknown before a pose is reached."""
    return all(term.wave != "torque" for level in levels for term in level.errors.terms)


def with_errors(nominal: RobotModel, added: JointErrors) -> RobotModel:
    """The model with further joint errors added, as a rule zero ones that leave its poses as is."""
    return replace(nominal, joint_errors=nominal.joint_errors.joined(added))


def prior_of(levels: Iterable[Level]) -> Prior:
    """Prior of the numbers of some levels, which are independent."""
    levels = tuple(levels)
    mean, sd = (np.concatenate([getattr(level, key) for level in levels]) for key in ("mean", "sd"))
    names = tuple(name for level in levels for name in level.names)
    return Prior(frozen(mean), frozen(sd), names)


@lru_cache(maxsize=128)
def asked_of(levels: tuple[Level, ...]) -> tuple[JointErrors, Array, Array]:
    """Joint errors of some levels, with prior sd and prior mean of their coefficients."""
    errors = joined(levels)
    believed = {
        name: both
        for level in levels
        for name, *both in zip(level.names, level.sd, level.mean, strict=True)
    }
    sd, mean = np.array([believed[name] for name in errors.names]).reshape(-1, 2).T
    return errors, sd, mean
