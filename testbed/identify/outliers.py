"""What a calibration warns of: rows that do not fit the others, joints and poses hardly moved."""

from dataclasses import replace

import numpy as np

from calib.arrays import Bool
from calib.geometry.model import RobotModel
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.identification.outlier_search import OutlierSearch, search_outliers
from calib.identification.result import ILL_CONDITIONED
from calib.measurement.observations import Measurements
from calib.measurement.prediction import Prediction, predict
from testbed.identify.frames import StartFrames
from testbed.identify.records import FittedModel, RowErrors
from testbed.units import DEG, MM, in_units, significant, unit_of

CHANCE = 0.01
"""Chance that a table of sound rows, whose noise is as stated, has any suspect."""
MOST = 0.1
"""Part of the rows above which misfits are the model's fault, not theirs."""
ELSEWHERE = 3.0
"""A row fits another pose if it misses that one by less than so many typical misses."""
HELD_OUT_FAR = 8.0
"""Held-out misses beyond so many medians are named."""


def training_outliers(
    frames: StartFrames, train: Measurements, plain: Identification, name: list[str]
) -> tuple[OutlierSearch, tuple[str, ...], tuple[str, ...]]:
    """Training rows that do not fit, judged by a fit that they cannot pull.

    Parameters
    ----------
    frames : StartFrames
        Where fits begin, and what is free.
    train : Measurements
        The training rows.
    plain : Identification
        Least squares over all of them.
    name : list of str
        (m,) how each row is called.

    Returns
    -------
    tuple
        What was found, a sentence on each row, and why none is left out although many do not fit.
    """
    search = search_outliers(
        frames.start, plain, train, frames.parameters, chance=CHANCE, most=MOST,
        noise_is_known=False,
    )  # fmt: skip
    if search.too_many:
        many = (
            f"{len(search.suspects)} of {len(train)} training rows do not fit: that many are no "
            "gross errors, so none is left out; the model or the stated noise is wrong"
        )
        return search, (), (many,)
    if not len(search.rows):
        return search, (), ()
    model = search.identification.model
    seen = predict(model, train)
    typical = float(np.median(seen.misses))
    sentences = tuple(
        f"{name[row]} does not fit the others: it misses by {_error(seen, train, row)}, where "
        f"{significant(typical * MM, 2)} mm is typical{_elsewhere(model, train, seen, row, name)}"
        for row in map(int, search.rows)
    )
    return search, sentences, ()


def held_out_outliers(errors: RowErrors, is_test: Bool, name: list[str]) -> tuple[str, ...]:
    """Held-out rows that are far off; they stay in every figure."""
    rows = np.flatnonzero(is_test)
    if not len(rows):
        return ()
    typical = float(np.median(errors.position[rows]))
    far = rows[errors.position[rows] > HELD_OUT_FAR * typical]
    return tuple(
        f"held-out {name[row]} is missed by {significant(errors.position[row] * MM)} mm, "
        f"{errors.position[row] / typical:.0f} times the median: look at its shot; it stays in "
        "every figure"
        for row in far[np.argsort(-errors.position[far], kind="stable")]
    )


def _error(seen: Prediction, train: Measurements, row: int) -> str:
    """By how much a row is missed, in words."""
    text = f"{significant(seen.misses[row] * MM)} mm"
    if not train.is_pose[row]:
        return text
    return f"{text} and {significant(seen.turns[row] * DEG, 2)} deg"


def _elsewhere(
    model: RobotModel, train: Measurements, seen: Prediction, row: int, name: list[str]
) -> str:
    """Whose joints the reading of a row fits, if it does: then rows were swapped."""
    others = np.flatnonzero((train.q != train.q[row]).any(axis=1))
    if train.is_distance[row] or not len(others):
        return ""
    here = train.rows(np.full(len(others), row))
    there = predict(model, replace(here, q=train.q[others]))
    fits = there.misses < ELSEWHERE * float(np.median(seen.misses))
    if train.is_pose[row]:
        fits &= there.turns < ELSEWHERE * float(np.median(seen.turns[train.is_pose]))
    if not fits.any():
        return "; measure it again or leave it out"
    best = int(others[np.argmin(np.where(fits, there.misses, np.inf))])
    return f"; it fits the joints of {name[best]}: were they swapped?"


LEAST_TURN, LEAST_SLIDE = np.radians(10.0), 0.010
"""Range of a joint at the training poses below which it counts as not moved [rad, m]."""


def warnings_of(
    geometric: FittedModel, chosen: FittedModel, train: Measurements
) -> tuple[str, ...]:
    """Sentences on the poses, by the geometric fit, and on the fit that was chosen."""
    result = chosen.identification
    texts = [*_still(geometric, train), *_condition(geometric)]
    if result.status is not Status.CONVERGED:
        texts.append(f"the fit {result.status.value}")
    if result.p_value > 1 - RED:
        texts.append(
            "the residuals are smaller than the stated noise: the stated uncertainty is too large"
        )
    return tuple(texts)


def _still(fit: FittedModel, train: Measurements) -> tuple[str, ...]:
    """Which joints were hardly moved: nothing was learnt of them, and nothing tests it."""
    kinds = np.array(fit.identification.model.chain.kinds)
    least = np.where(kinds == "revolute", LEAST_TURN, LEAST_SLIDE)
    still = np.flatnonzero(np.ptp(train.q, axis=0) < least) + 1
    if not len(still):
        return ()
    many = len(still) > 1
    return (
        f"joint{'s' * many} {', '.join(map(str, still))} moved by less than "
        f"{np.degrees(LEAST_TURN):.0f} deg or {1e3 * LEAST_SLIDE:.0f} mm: nothing here says how "
        f"well the result holds where {'they stand' if many else 'it stands'} otherwise",
    )


def _condition(fit: FittedModel) -> tuple[str, ...]:
    """Whether the poses are too much alike, and which number suffers most."""
    result = fit.identification
    if result.reduction.condition <= ILL_CONDITIONED:
        return ()
    alike = f"the poses are much alike: condition {significant(result.reduction.condition, 2)}; "
    more = "; vary the wrist and the tool's orientation more"
    if result.prior is not None:
        return (f"{alike}the prior of the links holds what they do not tell{more}",)
    lengths = result.parameters.is_length[result.parameters.free_index]
    u = result.standard_uncertainty
    worst = result.least_known
    value = float(in_units(u, lengths)[worst])
    return (
        f"{alike}least known is {result.names[worst]}, U = {significant(2 * value, 2)} "
        f"{unit_of(bool(lengths[worst]))} from the stated noise{more}",
    )
