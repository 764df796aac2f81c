"""The climb: which joint errors the measurements ask for, level by level of all ladders.

All models are compared about one geometric fit, where small steps are linear: one normal matrix of
the richest model holds those of all others. Waves act on a joint each, so the whole climb costs
less than one fit of the model that it finds.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, FloatOrNan, Index
from calib.errors import refuse
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.levels import Ladder, Level, foreseen, joined, with_errors
from calib.identification.normal_equations import (
    MOST_TURNS,
    SETTLED,
    NormalEquations,
    Solved,
    normal_equations,
)
from calib.identification.prior import Prior
from calib.identification.robust import Loss, loss_weights
from calib.measurement.observations import Measurements

ASKED = float(np.log(20))
"""Log evidence from which the data ask for another level: odds of 20 to 1."""


@dataclass(frozen=True, slots=True)
class ClimbStep:
    """One level that the evidence asked for, and whether it was taken."""

    ladder: str
    level: str
    gain: float
    """Log evidence against the model before it."""
    before: FloatOrNan
    """Mean miss at training poses left out in turn, by the model before it; nan where poses are too
    few to leave any out [m]."""
    after: FloatOrNan
    """The same with the level [m]."""
    taken: bool
    """Whether the poses left out confirm it: not worse by more than one standard error."""


@dataclass(frozen=True, slots=True)
class Offer:
    """A level of a ladder, or why a ladder has none, and what became of it."""

    ladder: str
    level: str
    gain: FloatOrNan
    """Log evidence against geometry alone, without any other level; nan where it is not offered."""
    outcome: str
    """taken, replaced, refused, asked for, not needed, not asked for, or not offered and why."""


@dataclass(frozen=True, slots=True, eq=False)
class Climb:
    """Where a climb ended, and how it went."""

    levels: tuple[Level, ...]
    """Those reached, one of each ladder."""
    steps: tuple[ClimbStep, ...]
    offered: tuple[Offer, ...]
    """One for each level of each ladder, or for a ladder that has none."""
    gain: float
    """Log evidence of the levels reached against geometry alone."""
    noise_factor: float
    """Noise that the richest model leaves, in units of the stated one, one or more."""
    poses: int
    """So many were asked."""
    before: float
    """Mean miss at these poses, left out in turn, by geometry alone [m]."""
    after: float
    """The same by the model reached [m]."""
    near: RobotModel
    """The model reached as the linear system has it: close to its fit."""
    richest: Callable[[], RobotModel]
    """The same of the last level of every ladder, worked out when it is asked for."""

    def __repr__(self) -> str:
        return f"Climb({', '.join(level.name for level in self.taken) or 'geometry alone'})"

    @property
    def confirmed(self) -> bool:
        """Whether poses were left out to confirm anything."""
        return not np.isnan(self.before)

    @property
    def taken(self) -> tuple[Level, ...]:
        """Levels reached that are not empty."""
        return tuple(level for level in self.levels if level.names)


def climb(
    nominal: RobotModel,
    near: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    ladders: Sequence[Ladder],
    part: Index | None,
    *,
    prior: Prior,
    loss: Loss = "squared",
) -> Climb:
    """Climb by evidence, confirmed on poses left out of the training in turn.

    Each round tries every other level of every ladder that can be reached and takes the one with
    the most evidence, until none gains odds of 20 to 1; within such odds one without reported
    torques. A level at which the poses left out are missed by more is not taken.

    Parameters
    ----------
    nominal : RobotModel
        What the prior speaks of.
    near : RobotModel
        The same after a fit of its geometry.
    measurements : Measurements
        What may be looked at: training rows alone.
    parameters : Parameters
        Of `nominal`.
    ladders : sequence of Ladder
        What is offered; see `ladders.ladders_of`.
    part : (m,) array of int or None
        Part that each row belongs to; each part is left out once. Rows of one pose are in one. None
        where nothing can be confirmed: then no level is taken.
    prior : Prior
        Of all free numbers, the same in every model.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; the weights are those of the richest model.

    Raises
    ------
    InputError
        If a free number has no prior.

    References
    ----------
    MacKay 1992: evidence by Laplace's method, at one noise scale for all models: scales of their
    own would hide small terms.
    """
    believed = set(prior.names)
    bare = [name for name in parameters.free_names if name not in believed]
    if bare:
        raise refuse(
            "prior", tuple(bare), code="A3", message=f"{bare[0]} is free and has no prior",
            allowed="a prior of every free number: evidence compares nothing else",
            fix="add them to the prior, or leave it out for the weak one",
        )  # fmt: skip
    every = [level.errors for ladder in ladders for level in ladder.levels]
    system = normal_equations(nominal, near, measurements, parameters, every, prior)
    richest = tuple(ladder.levels[-1] for ladder in ladders)
    system = system.at_noise_of(*_asked(richest))
    if loss != "squared":
        system = _calmed(system, richest, loss)
    pose = np.unique(measurements.together, return_inverse=True)[1].ravel()
    memory: dict[tuple[Level, ...], Solved] = {}

    def solved(levels: Sequence[Level]) -> Solved:
        key = tuple(level for level in levels if level.names)
        if key not in memory:
            memory[key] = system.solved(*_asked(levels))
        return memory[key]

    def moved(levels: Sequence[Level]) -> RobotModel:
        errors = joined(levels)
        wide = with_errors(near, errors)
        step = np.zeros(wide.n_numbers)
        place = {name: k for k, name in enumerate(wide.names)}
        free = (*parameters.free_names, *errors.names)
        step[[place[name] for name in free]] = solved(levels).step
        return wide.moved(step)

    found = _climbed(system, solved, ladders, part, pose, near)
    return replace(found, near=moved(found.levels), richest=partial(moved, richest))


def _calmed(plain: NormalEquations, levels: Sequence[Level], loss: Loss) -> NormalEquations:
    """The rows weighed by how the richest model fits them, at the noise of the typical one."""
    typical = np.sqrt(chdtri(plain.equations, 0.5) / plain.equations)
    system, scale = replace(plain, scale=1.0), np.inf
    for _ in range(MOST_TURNS):
        size = plain.sizes_after(system.solved(*_asked(levels)))
        last, scale = scale, max(1.0, float(np.median(size / typical)))
        system = replace(plain.weighed(loss_weights(size / scale, loss)), scale=scale)
        if abs(scale / last - 1) < SETTLED:
            break
    return system


def _asked(levels: Sequence[Level]) -> tuple[JointErrors, Array, Array]:
    """The joint errors of some levels, their prior sd and what they are believed to be."""
    errors = joined(levels)
    believed = {
        name: both
        for level in levels
        for name, *both in zip(level.names, level.sd, level.mean, strict=True)
    }
    sd, mean = np.array([believed[name] for name in errors.names]).reshape(-1, 2).T
    return errors, sd, mean


def _climbed(
    system: NormalEquations, solved: Callable[[Sequence[Level]], Solved],
    ladders: Sequence[Ladder], part: Index | None, pose: Index, near: RobotModel,
) -> Climb:  # fmt: skip
    """The climb over levels of a linear system; misses are means of poses (m,) of rows."""
    count = np.bincount(pose)
    held_out = [] if part is None else [part == k for k in np.unique(part)]
    rests = [system.without(rows) for rows in held_out]

    def left_out(levels: Sequence[Level]) -> Array:
        asked, missed = _asked(levels), np.full(len(system.r), np.nan)
        for rest, rows in zip(rests, held_out, strict=True):
            missed[rows] = system.misses(rest.solved(*asked), rows)
        return np.asarray(np.bincount(pose, missed) / count)

    here = tuple(ladder.levels[0] for ladder in ladders)
    bottom = evidence = solved(here).evidence
    lowest = before = left_out(here)
    steps: list[ClimbStep] = []
    barred: set[tuple[str, ...]] = set()
    while True:
        tried = {}
        for k, ladder in enumerate(ladders):
            for level in ladder.levels:
                levels = (*here[:k], level, *here[k + 1 :])
                reachable = level is not here[k] and level.after in ("", here[k].name)
                if reachable and _names(levels) not in barred:
                    tried[k, level.name] = levels, solved(levels).evidence
        top = max([evidence, *(each for _, each in tried.values())])
        alike = [key for key in tried if tried[key][1] > max(top - ASKED, evidence + ASKED)]
        if not alike:
            break
        best = max(alike, key=lambda key: (foreseen(tried[key][0]), tried[key][1]))
        levels, found = tried[best]
        after = left_out(levels)
        worse = after - before
        # never true of nothing left out
        taken = bool(worse.mean() < worse.std() / np.sqrt(len(worse)))
        steps.append(
            ClimbStep(
                ladders[best[0]].name, best[1], found - evidence,
                float(before.mean()), float(after.mean()), taken,
            )
        )  # fmt: skip
        if taken:
            here, evidence, before = levels, found, after
        else:
            barred.add(_names(levels))
    offered = tuple(
        offer
        for k, ladder in enumerate(ladders)
        for offer in _offers(
            ladder,
            here[k],
            steps,
            lambda level: solved([level]).evidence - bottom,
            part is not None,
        )
    )
    return Climb(
        here, tuple(steps), offered, evidence - bottom, system.scale, len(count),
        float(lowest.mean()), float(before.mean()), near, lambda: near,
    )  # fmt: skip


def _offers(
    ladder: Ladder, reached: Level, steps: Sequence[ClimbStep], gain: Callable[[Level], float],
    confirmed: bool,
) -> Iterator[Offer]:  # fmt: skip
    """What became of each level of a ladder."""
    tried = {step.level: step.taken for step in steps if step.ladder == ladder.name}
    for level in ladder.levels[1:]:
        gained = gain(level)
        outcome = "asked for" if gained > ASKED else "not asked for"
        if level is reached:
            outcome = "taken"
        elif level.name in tried:
            refused = "refused by the poses left out" if confirmed else "too few poses to confirm"
            outcome = "replaced" if tried[level.name] else refused
        elif reached.names and gained > ASKED:
            outcome = f"not needed beside {reached.name}"
        yield Offer(ladder.name, level.name, gained, outcome)
    for reason in ladder.why_not:
        what, why = reason.split(": ", maxsplit=1)
        yield Offer(ladder.name, what, float("nan"), f"not offered: {why}")


def _names(levels: Sequence[Level]) -> tuple[str, ...]:
    return tuple(level.name for level in levels)
