"""The climb: which joint errors the measurements ask for, level by level of all ladders.

All models are compared about one geometric fit, where small steps are linear: one normal matrix of
the richest model holds those of all others. Waves act on a joint each, so the whole climb costs
less than one fit of the model that it finds.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climbing import Climb, Question, climb_of, climbing, run
from calib.identification.levels import Ladder, Level, joined, with_errors
from calib.identification.normal_equations import (
    MOST_TURNS,
    SETTLED,
    NormalEquations,
    Solved,
    normal_equations,
)
from calib.identification.prior import Prior
from calib.identification.robust import Loss, loss_weights
from calib.identification.shared_misfit import SharedMisfit
from calib.measurement.observations import Measurements


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
    torques. A level at which the poses left out are missed by more than chance allows is not taken;
    where the levels taken end with larger misses than geometry alone, by more than half of that,
    only those are kept with which they are smallest.

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
    if loss == "squared":
        shared = SharedMisfit.of(system, measurements).at_noise_of(_asked(richest))
    else:
        shared = SharedMisfit.of(_calmed(system, richest, loss), measurements)
    pose = np.unique(measurements.together, return_inverse=True)[1].ravel()
    held_out = [] if part is None else [part == k for k in np.unique(part)]
    memory: dict[tuple[Level, ...], tuple[Solved, float]] = {}

    def fitted(levels: Sequence[Level]) -> tuple[Solved, float]:
        key = tuple(level for level in levels if level.names)
        if key not in memory:
            memory[key] = shared.solved(_asked(key))
        return memory[key]

    def solved(levels: Sequence[Level]) -> Solved:
        return fitted(levels)[0]

    @lru_cache(maxsize=1)
    def left(misfit: float) -> tuple[NormalEquations, list[NormalEquations]]:
        whole = shared.rows_at(misfit)
        return whole, [whole.without(rows) for rows in held_out]

    def moved(levels: Sequence[Level]) -> RobotModel:
        errors = joined(levels)
        wide = with_errors(near, errors)
        step = np.zeros(wide.n_numbers)
        place = {name: k for k, name in enumerate(wide.names)}
        free = (*parameters.free_names, *errors.names)
        step[[place[name] for name in free]] = solved(levels).step
        return wide.moved(step)

    def left_out(levels: tuple[Level, ...]) -> Array:
        asked, missed = _asked(levels), np.full(len(pose), np.nan)
        whole, rests = left(fitted(levels)[1])
        for rest, rows in zip(rests, held_out, strict=True):
            missed[rows] = whole.misses(rest.solved(*asked), rows)
        return np.asarray(np.bincount(pose, missed) / np.bincount(pose))

    def answer(question: Question) -> list[float] | Array:
        if question.left_out:
            return left_out(question.models[0])
        return [solved(levels).evidence for levels in question.models]

    def gain(level: Level) -> float:
        return solved([level]).evidence - solved([]).evidence

    course = run(climbing(ladders), answer)
    reached = moved(course.levels)
    noise = shared.noise_factor(fitted(course.levels)[1])
    return climb_of(course, ladders, gain, noise, reached, partial(moved, richest))


def _calmed(plain: NormalEquations, levels: tuple[Level, ...], loss: Loss) -> NormalEquations:
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


@lru_cache(maxsize=128)
def _asked(levels: tuple[Level, ...]) -> tuple[JointErrors, Array, Array]:
    """The joint errors of some levels, their prior sd and what they are believed to be."""
    errors = joined(levels)
    believed = {
        name: both
        for level in levels
        for name, *both in zip(level.names, level.sd, level.mean, strict=True)
    }
    sd, mean = np.array([believed[name] for name in errors.names]).reshape(-1, 2).T
    return errors, sd, mean
