"""Model choice for many robots at once, with the results of `model_choice.choose` for each."""

from collections.abc import Sequence

from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.levels import Ladder
from calib.identification.many.climb import climb_many
from calib.identification.many.extended import extended_many
from calib.identification.many.single import identify_many
from calib.identification.model_choice import ModelChoice, choice_of, levels_shown
from calib.identification.prior import weak_prior
from calib.measurement.observations import Measurements


def choose_many(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    *,
    ladders: Sequence[Ladder],
    robots: int = 0,
) -> list[ModelChoice]:
    """Choose a model for each robot as `choose` does, from tables of the same poses.

    Parameters
    ----------
    nominal, parameters, ladders
        As in `choose`, the same for all robots.
    tables : sequence of Measurements
        One table per robot.
    robots : int
        As in `climb_many`.
    """
    prior = weak_prior(parameters, nominal)
    geometric = identify_many(nominal, tables, parameters, prior=prior)

    found = climb_many(
        nominal, [fit.model for fit in geometric], tables, parameters, ladders,
        prior=prior, robots=robots,
    )  # fmt: skip
    extended = extended_many(
        nominal, tables, parameters, [levels_shown(one, ladders) for one in found],
        prior=prior, factors=[one.noise_factor for one in found],
        starts=[one.near if one.taken else None for one in found],
    )  # fmt: skip
    return [choice_of(nominal, *one) for one in zip(geometric, extended, found, strict=True)]
