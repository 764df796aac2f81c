"""Extended models of many robots: those with the same levels of joint errors are fitted at once."""

from collections.abc import Sequence

import numpy as np

from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.identification.joint_models import extended_parameters
from calib.identification.larger_noise import as_believed
from calib.identification.levels import Level, joined, prior_of, with_errors
from calib.identification.many.single import together
from calib.identification.model_choice import extended_by
from calib.identification.prior import Prior
from calib.measurement.observations import Measurements


def extended_many(
    nominal: RobotModel,
    tables: Sequence[Measurements],
    parameters: Parameters,
    levels: Sequence[Sequence[Level]],
    *,
    prior: Prior,
    factors: Sequence[float],
    starts: Sequence[RobotModel | None],
) -> list[tuple[RobotModel, Identification]]:
    """Model of each robot with some levels of joint errors added, and its identification.

    The results are those of `extended_by` for each robot. That function is used for models that
    arrays cannot express, such as terms of operating conditions, and for fits that do not converge
    here.

    Parameters
    ----------
    nominal, parameters, prior
        As in `extended_by`, the same for all robots.
    tables, levels, factors, starts
        For each robot: its measurements, the levels to add, the actual noise in units of the stated
        one, and the model from which its fit starts; None for the model before the fit.
    """
    found: list[tuple[RobotModel, Identification] | None] = [None] * len(tables)
    groups: dict[tuple[Level, ...], list[int]] = {}
    for k, of_one in enumerate(levels):
        groups.setdefault(tuple(of_one), []).append(k)
    for own, places in groups.items():
        added = joined(own)
        wide = with_errors(nominal, added)
        table = extended_parameters(nominal, wide, parameters) if added.names else parameters
        belief = prior.joined(prior_of(own)) if added.names else prior
        factor = np.array([factors[k] for k in places])
        begin = [starts[k] or wide for k in places]
        some = [tables[k] for k in places]
        fits = together(wide, some, table, belief, weights=factor**2, starts=begin)
        for k, fit in zip(places, fits, strict=True):
            if fit is not None:
                found[k] = wide, as_believed(fit, factors[k])
    return [
        extended_by(
            nominal, tables[k], parameters, levels[k],
            prior=prior, factor=factors[k], start=starts[k],
        )
        if one is None
        else one
        for k, one in enumerate(found)
    ]  # fmt: skip
