"""Rows that do not fit the others: found by a robust fit, named, and left out of the final one."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification, identify
from calib.identification.outliers import inspect
from calib.identification.robust import sizes
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import stacked
from testbed.identify.records import Misses
from testbed.units import DEG, MM, significant

CHANCE = 0.01
"""Chance that a table of sound rows, whose noise is as stated, has any suspect."""
HONEST = 1.5
"""Typical residual, in stated noises, up to which the stated noise is taken at its word."""
FAR = 4.0
"""Beyond that, scores that count: so many times the limit, twice as far in millimetres. What a
model leaves out has longer tails than noise has."""
CALMER = 0.8
"""Part of its typical residual to which a plain fit must calm down for a second look."""
MOST = 0.1
"""Part of the rows above which misfits are the model's fault, not theirs."""
ELSEWHERE = 3.0
"""A row fits another pose if it misses that one by less than so many typical misses."""
HELD_OUT_FAR = 8.0
"""Held-out misses beyond so many medians are named."""


@dataclass(frozen=True, slots=True, eq=False)
class Suspects:
    """What was found among training rows."""

    factor: float
    """Typical residual in units of the stated noise."""
    rows: Index
    """Places in the training table, worst first."""
    sentences: tuple[str, ...]
    too_many: str
    """Why none is left out although many do not fit; else empty."""


def suspects(
    start: RobotModel,
    train: Measurements,
    parameters: Parameters,
    plain: Identification,
    name: "list[str]",
) -> Suspects:
    """Training rows that do not fit, judged by a fit that they cannot pull.

    Where the residuals are much larger than the stated noise, rows are judged against the scatter
    of the residuals instead, and more mildly.

    Parameters
    ----------
    start : RobotModel
        Where fits begin.
    train : Measurements
        The training rows.
    parameters : Parameters
        Of `start`.
    plain : Identification
        Least squares over all of them.
    name : list of str
        (m,) how each row is called.
    """
    factor = noise_factor(plain.model, train)
    if factor <= HONEST and not inspect(start, plain, train, chance=CHANCE).outliers.suspect.any():
        return Suspects(factor, np.zeros(0, dtype=np.int64), (), "")
    robust, table = _robust(start, train, parameters, factor)
    calmer = noise_factor(robust.model, train)
    if calmer < CALMER * factor:  # the gross errors had moved the plain fit
        factor = calmer
        robust, table = _robust(start, train, parameters, factor)
    honest = factor <= HONEST
    judged = inspect(start, robust, table, chance=CHANCE).outliers
    share = judged.score / (judged.limit * (1.0 if honest else FAR))
    found = np.flatnonzero(share > 1)
    found = found[np.argsort(-share[found], kind="stable")]
    if len(found) > MOST * len(train):
        said = (
            f"{len(found)} of {len(train)} training rows do not fit: that many are no gross "
            "errors, so none is left out; the model or the stated noise is wrong"
        )
        return Suspects(factor, np.zeros(0, dtype=np.int64), (), said)
    seen = predict(robust.model, train)
    typical = float(np.median(seen.misses))
    sentences = tuple(
        f"{name[row]} does not fit the others: it misses by "
        f"{_missed(seen.misses[row], seen.turns[row], bool(train.is_pose[row]))}, where "
        f"{significant(typical * MM, 2)} mm is typical{_elsewhere(robust.model, train, row, name)}"
        for row in map(int, found)
    )
    return Suspects(factor, found, sentences, "")


def _robust(
    start: RobotModel, train: Measurements, parameters: Parameters, factor: float
) -> tuple[Identification, Measurements]:
    """A fit that few rows cannot pull, and the table as it saw it: with the noise there is."""
    table = train
    if factor > HONEST:
        table = replace(train, covariance=train.covariance * factor**2)
    return identify(start, table, parameters, loss="cauchy"), table


def noise_factor(model: RobotModel, measurements: Measurements) -> float:
    """Typical size of the residuals in units of the stated noise: about 1 if both are right."""
    stack = stacked(model, measurements)
    rows = np.bincount(stack.row_of)
    expected = np.sqrt(chdtri(rows, 0.5) / rows)
    return float(np.median(sizes(stack.r, stack.row_of) / expected))


def held_out_suspects(misses: Misses, is_test: Bool, name: "list[str]") -> tuple[str, ...]:
    """Held-out rows that are far off; they stay in every figure."""
    rows = np.flatnonzero(is_test)
    if not len(rows):
        return ()
    typical = float(np.median(misses.position[rows]))
    far = rows[misses.position[rows] > HELD_OUT_FAR * typical]
    return tuple(
        f"held-out {name[row]} is missed by {significant(misses.position[row] * MM)} mm, "
        f"{misses.position[row] / typical:.0f} times the median: look at its shot; it stays in "
        "every figure"
        for row in far[np.argsort(-misses.position[far], kind="stable")]
    )


def _missed(position: float, turn: float, is_pose: bool) -> str:
    """What is missed, in words."""
    text = f"{significant(position * MM)} mm"
    return f"{text} and {significant(turn * DEG, 2)} deg" if is_pose else text


def _elsewhere(model: RobotModel, train: Measurements, row: int, name: "list[str]") -> str:
    """Whose joints the reading of a row fits, if it does: then rows were swapped."""
    others = np.flatnonzero((train.q != train.q[row]).any(axis=1))
    if train.is_distance[row] or not len(others):
        return ""
    here = train.rows(np.full(len(others), row))
    seen = predict(model, replace(here, q=_q(train.q, others)))
    typical = float(np.median(predict(model, train).misses))
    fits = seen.misses < ELSEWHERE * typical
    if train.is_pose[row]:
        turns = predict(model, train).turns[train.is_pose]
        fits &= seen.turns < ELSEWHERE * float(np.median(turns))
    if not fits.any():
        return "; measure it again or leave it out"
    best = int(others[np.argmin(np.where(fits, seen.misses, np.inf))])
    return f"; it fits the joints of {name[best]}: were they swapped?"


def _q(q: Array, rows: Index) -> Array:
    """Joints of some rows."""
    return q[rows]
