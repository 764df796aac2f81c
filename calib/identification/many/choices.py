"""Choices of a model for many robots: each as `model_choice.choose` makes it."""

from collections.abc import Sequence

import numpy as np

from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climb import climb
from calib.identification.climbing import Climb
from calib.identification.folds import parts_of, some_poses
from calib.identification.identify import Identification
from calib.identification.levels import Ladder
from calib.identification.many.extended import extended_many
from calib.identification.many.single import identify_many
from calib.identification.model_choice import ModelChoice, choice_of, levels_shown
from calib.identification.prior import Prior, weak_prior
from calib.measurement.observations import Measurements


def choose_many(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    *,
    ladders: Sequence[Ladder],
    prior: Prior | None = None,
) -> list[ModelChoice]:
    """Choose a model of each robot as `choose` does, all of the same poses and offers.

    Parameters
    ----------
    nominal, parameters, ladders, prior
        As in `choose`, of all robots.
    tables : sequence of Measurements
        One of each robot.
    """
    prior = weak_prior(parameters, nominal) if prior is None else prior
    geometric = identify_many(nominal, tables, parameters, prior=prior)

    def climbed(table: Measurements, fit: Identification) -> Climb:
        rng = np.random.default_rng(0)
        asked = some_poses(table, rng)
        part = parts_of(asked, rng)
        return climb(nominal, fit.model, asked, parameters, ladders, part, prior=prior)

    found = [climbed(*one) for one in zip(tables, geometric, strict=True)]
    extended = extended_many(
        nominal, tables, parameters, [levels_shown(one, ladders) for one in found],
        prior=prior, factors=[one.noise_factor for one in found],
        starts=[one.near if one.taken else None for one in found],
    )  # fmt: skip
    return [choice_of(nominal, *one) for one in zip(geometric, extended, found, strict=True)]
