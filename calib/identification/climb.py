"""The climb: stepwise choice of joint errors by evidence, level by level of all ladders.

All models are linearized about one geometric fit, so that the normal matrix of the richest model
contains those of all others. The whole climb then costs less than one fit of the model it chooses.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climbing import Climb, Question, climb_of, climbing, run
from calib.identification.evidence.model_equations import MOST_TURNS, SETTLED, Solved
from calib.identification.evidence.normal_equations import NormalEquations, normal_equations
from calib.identification.evidence.shared_misfit import SharedMisfit
from calib.identification.levels import Ladder, Level, asked_of, joined, with_errors
from calib.identification.prior import Prior
from calib.identification.robust import Loss, loss_weights
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
    """Choose joint errors stepwise by evidence, confirmed by cross-validation over the training.

    Each round tries every other level that can be reached on any ladder and takes the one with the
    most evidence, until none gains odds of 20 to 1; within such odds it prefers a level without
    reported torques. A level is refused if it raises the mean error at poses left out by a standard
    error or more. If the levels taken end with larger errors there than geometry alone, by more
    than half a standard error, the climb goes back to where the errors were smallest.

    Parameters
    ----------
    nominal : RobotModel
        Model that the prior refers to.
    near : RobotModel
        The same model after a fit of its geometry.
    measurements : Measurements
        Training rows.
    parameters : Parameters
        Parameter table of `nominal`.
    ladders : sequence of Ladder
        Levels on offer; see `ladders.ladders_of`.
    part : (m,) array of int or None
        Part of each row; each part is left out once, and rows of one pose are in one part. None if
        there are too few poses to leave any out: then no level is taken.
    prior : Prior
        Prior of all free numbers, the same in every model.
    loss : {"squared", "huber", "cauchy"}
        As in `identify`; the weights are those of the richest model.

    Raises
    ------
    InputError
        A3: a free number has no prior.

    References
    ----------
    MacKay 1992: evidence by Laplace's method. The noise scale is the same for all models, since a
    scale for each would hide small terms.
    """
    _require_prior(parameters, prior)
    shared, richest = _misfit_of(nominal, near, measurements, parameters, ladders, prior, loss)
    pose = np.unique(measurements.together, return_inverse=True)[1].ravel()
    held_out = [] if part is None else [part == k for k in np.unique(part)]
    memory: dict[tuple[Level, ...], tuple[Solved, float]] = {}

    def fitted(levels: Sequence[Level]) -> tuple[Solved, float]:
        key = tuple(level for level in levels if level.names)
        if key not in memory:
            memory[key] = shared.solved(asked_of(key))
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
        asked, missed = asked_of(levels), np.full(len(pose), np.nan)
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


def best_alone(
    nominal: RobotModel, near: RobotModel, measurements: Measurements, parameters: Parameters,
    ladders: Sequence[Ladder], *, prior: Prior,
) -> list[tuple[str, float] | None]:  # fmt: skip
    """What a climb on each of several ladders alone has as its `best`, without climbing.

    The ladders are much alike: the noise of each is searched from the misfit of the one before.
    Arguments are as of `climb`.
    """
    _require_prior(parameters, prior)
    found: list[tuple[str, float] | None] = []
    misfit = 0.0
    for ladder in ladders:
        system = _equations(nominal, near, measurements, parameters, [ladder], prior)
        bare = SharedMisfit.of(system, measurements)
        shared, misfit = bare.at_noise_of(asked_of(ladder.levels[-1:]), misfit)
        found.append(_best_of(shared, ladder))
    return found


def _best_of(shared: SharedMisfit, ladder: Ladder) -> tuple[str, float] | None:
    """Name and gain of the best level that a climb on one ladder can begin with, if any."""
    bottom, *others = ladder.levels

    def evidence(level: Level) -> float:
        return shared.solved(asked_of((level,) if level.names else ()))[0].evidence

    first = [level for level in others if level.after in ("", bottom.name)]
    if not first:
        return None
    least = evidence(bottom)
    gains = [evidence(level) - least for level in first]
    return first[int(np.argmax(gains))].name, max(gains)


def _require_prior(parameters: Parameters, prior: Prior) -> None:
    """Raise an `InputError` (A3) for a free number without a prior."""
    believed = set(prior.names)
    bare = [name for name in parameters.free_names if name not in believed]
    if bare:
        raise refuse(
            "prior", tuple(bare), code="A3", message=f"{bare[0]} is free and has no prior",
            allowed="a prior of every free number: evidence compares nothing else",
            fix="add them to the prior, or leave it out for the weak one",
        )  # fmt: skip


def _misfit_of(
    nominal: RobotModel, near: RobotModel, measurements: Measurements, parameters: Parameters,
    ladders: Sequence[Ladder], prior: Prior, loss: Loss,
) -> tuple[SharedMisfit, tuple[Level, ...]]:  # fmt: skip
    """Equations of all levels at the noise that the richest model leaves; and its levels."""
    system = _equations(nominal, near, measurements, parameters, ladders, prior)
    richest = tuple(ladder.levels[-1] for ladder in ladders)
    if loss == "squared":
        shared, _ = SharedMisfit.of(system, measurements).at_noise_of(asked_of(richest))
    else:
        shared = SharedMisfit.of(_calmed(system, richest, loss), measurements)
    return shared, richest


def _equations(
    nominal: RobotModel, near: RobotModel, measurements: Measurements, parameters: Parameters,
    ladders: Sequence[Ladder], prior: Prior,
) -> NormalEquations:  # fmt: skip
    """Equations of all levels of some ladders."""
    every = [level.errors for ladder in ladders for level in ladder.levels]
    return normal_equations(nominal, near, measurements, parameters, every, prior)


def _calmed(plain: NormalEquations, levels: tuple[Level, ...], loss: Loss) -> NormalEquations:
    """Equations with robust weights by the residuals of the richest model, scaled by the median."""
    typical = np.sqrt(chdtri(plain.equations, 0.5) / plain.equations)
    system, scale = replace(plain, scale=1.0), np.inf
    for _ in range(MOST_TURNS):
        size = plain.sizes_after(system.solved(*asked_of(levels)))
        last, scale = scale, max(1.0, float(np.median(size / typical)))
        system = replace(plain.weighed(loss_weights(size / scale, loss)), scale=scale)
        if abs(scale / last - 1) < SETTLED:
            break
    return system
