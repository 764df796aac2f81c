"""Bad shots, told from poses that a model misses: what the richest model misses too is bad.

A model that lacks a joint error misses good observations wherever that error is large. So none is
called bad before two models were asked: the one that the others ask for, under a loss that no gross
error can pull, and the richest one that is offered, fitted without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.climb import climb
from calib.identification.folds import parts_of, some_poses
from calib.identification.ladders import ladders_of
from calib.identification.larger_noise import with_noise
from calib.identification.levels import Ladder
from calib.identification.model_choice import extended_by
from calib.identification.outliers.scores import inspect
from calib.identification.outliers.search import FAR
from calib.identification.prior import Prior, prior_rows, weak_prior
from calib.identification.result import Identification
from calib.identification.tangent import covariance_factor
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize, table_whiteners
from calib.shown import Shown

CHANCE = 0.01
"""Chance that a table of sound observations, whose noise is as stated, has any suspect."""
SOONER = 10.0
"""Times that chance at which the richest model is asked about an observation."""
LONGER_TAILS = (1.2, 1.5)
"""Variance, in units of the stated one, from which on tails are longer than those of noise, and at
which limits are `FAR` times as far."""
MOST = 0.1
"""Part of the poses above which misfits are the model's fault, or the stated noise's.

A model misses all that is seen of a pose, so each pose counts by the part of its rows that is.
"""
ROUNDING = 1e-9
"""By which sums of parts miss whole poses."""


@dataclass(frozen=True, slots=True, eq=False)
class BadShots(Shown):
    """Observations that no model explains, and those that a richer one does."""

    bad: Index
    """Missed by the richest model, which was fitted without them; worst first."""
    sound: Index
    """Missed by the model that the others ask for, and not by the richest one."""
    too_many: bool
    """So many are missed that the model or the stated noise is to blame: then none is bad."""
    judge: Identification
    """The richest model, fitted without all of them; where too many are, the one asked for."""
    noise_factor: float
    """Noise that the models leave, in units of the stated one, one or more."""
    asked: str
    """The joint errors that the observations ask for; empty for geometry alone."""
    misses: Array
    """(m,) by how much `judge`, fitted without each observation, misses it [m]."""
    turns: Array
    """(m,) the same of orientations; zero where there are none [rad]."""

    def __repr__(self) -> str:
        return f"BadShots({len(self.bad)} bad, {len(self.sound)} missed by a poorer model)"


def bad_shots(
    nominal: RobotModel,
    near: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    prior: Prior | None = None,
    ladders: Sequence[Ladder] | None = None,
    chance: float = CHANCE,
    most: float = MOST,
    rng: np.random.Generator | None = None,
) -> BadShots:
    """Ask the model that the observations want, and the richest one, which of them are bad.

    Parameters
    ----------
    nominal : RobotModel
        Where fits begin.
    near : RobotModel
        The same after a fit of its geometry that gross errors do not pull.
    measurements : Measurements
        What is looked at: training rows alone.
    parameters : Parameters
        What fits free.
    prior, ladders, rng
        As in `model_choice.choose`.
    chance : float
        Chance that a table of sound observations has any that is called bad.
    most : float
        Part of the poses from which on those missed are too many to be gross errors; of a pose that
        several rows see, those missed count by their part.
    """
    prior = weak_prior(parameters, nominal) if prior is None else prior
    ladders = ladders_of(nominal) if ladders is None else ladders
    rng = np.random.default_rng(0) if rng is None else rng
    asked = some_poses(measurements, rng)
    found = climb(
        nominal, near, asked, parameters, ladders, parts_of(asked, rng), prior=prior, loss="cauchy"
    )
    table = with_noise(measurements, found.noise_factor)
    wide, judge = extended_by(
        nominal, table, parameters, found.taken, prior=prior, loss="cauchy", start=found.near
    )
    richest = tuple(ladder.levels[-1] for ladder in ladders)
    seen = inspect(wide, judge, table, chance=chance)
    usual, scatter = scatter_of(seen.score, table, found.noise_factor)
    far, used = seen.score > scatter * seen.limit, np.ones(len(table), dtype=np.bool_)
    if scatter > usual and found.taken != richest:
        # tails of a poorer model hide what the richest one sees
        wide, judge = extended_by(
            nominal, table, parameters, richest, prior=prior, loss="cauchy", start=found.richest()
        )
        seen = inspect(wide, judge, table, chance=chance)
        usual, scatter = scatter_of(seen.score, table, found.noise_factor)
        far |= seen.score > scatter * seen.limit
    suspects, part = np.flatnonzero(far), _part_of_pose(measurements.together)
    count = most * part.sum() + ROUNDING
    too_many = bool(part[suspects].sum() > count)
    sooner = chdtri(table.equations, SOONER * chance / len(table))
    asked_of = _worst(seen.score / (usual * sooner), part, count)
    bad = suspects[:0]
    if len(asked_of) and not too_many:
        used[asked_of] = False
        wide, judge = extended_by(
            nominal, table.rows(used), parameters, richest, prior=prior, start=found.richest()
        )
        limit = chdtri(table.equations[asked_of], chance / len(table))
        square = foretold(judge, table.rows(~used))
        bad = asked_of[square > scatter * limit]
        bad = bad[np.argsort(-seen.score[bad], kind="stable")]
    misses, turns = left_out_misses(wide, judge, table, used)
    return BadShots(
        frozen(bad, np.int64), frozen(np.setdiff1d(suspects, bad), np.int64), too_many, judge,
        found.noise_factor, " and ".join(level.name for level in found.taken), misses, turns,
    )  # fmt: skip


def excess_of(
    nominal: RobotModel,
    result: Identification,
    measurements: Measurements,
    factor: float = 1.0,
    *,
    chance: float = CHANCE,
) -> tuple[Array, float]:
    """Score (m,) of each observation over its limit, and by what the scatter raised all limits.

    Parameters
    ----------
    nominal, result, measurements
        As in `inspect`.
    factor : float
        How many times the stated noise there is, as far as that is in `measurements` already.
    chance : float
        Chance that any of sound observations is beyond its limit.
    """
    seen = inspect(nominal, result, measurements, chance=chance)
    _, scatter = scatter_of(seen.score, measurements, factor)
    return np.asarray(seen.score / (scatter * seen.limit)), scatter


def scatter_of(score: Array, measurements: Measurements, factor: float) -> tuple[float, float]:
    """How many times the usual variance scores (m,) have, and the same with their longer tails."""
    usual = max(1.0, float(np.median(score / chdtri(measurements.equations, 0.5))))
    return usual, usual * mildness(max(1.0, factor) ** 2 * usual)


def _part_of_pose(poses: Index) -> Array:
    """(m,) which part of all that is seen of its pose each row is."""
    _, own, sizes = np.unique(poses, return_inverse=True, return_counts=True)
    return np.asarray(1 / sizes[own.ravel()])


def _worst(excess: Array, part: Array, count: float) -> Index:
    """Rows (m,) beyond a limit: the worst ones, of so many poses at most."""
    rows = np.flatnonzero(excess > 1)
    rows = rows[np.argsort(-excess[rows], kind="stable")]
    return np.sort(rows[np.cumsum(part[rows]) <= count])


def mildness(variance: float) -> float:
    """Factor on limits where scores have so many times the usual variance.

    What models leave out has longer tails than noise has. The median of sound scores of a hundred
    observations is a tenth from its expectation.
    """
    return float(np.interp(variance, LONGER_TAILS, (1.0, FAR)))


def foretold(fit: Identification, others: Measurements) -> Array:
    """Whitened square (m,) of what a fit misses in observations that it never saw.

    References
    ----------
    r'inv(I + A C A')r: chi-square if the observation is sound.
    """
    stack = linearize(fit.model, others)
    A = stack.A[:, fit.parameters.free_index]
    out = np.zeros(len(others))
    for row in range(len(others)):
        mine = stack.row_of == row
        V = np.eye(int(mine.sum())) + A[mine] @ fit.covariance @ A[mine].T
        out[row] = stack.r[mine] @ np.linalg.solve(V, stack.r[mine])
    return out


def left_out_misses(
    nominal: RobotModel, fit: Identification, table: Measurements, used: Bool
) -> tuple[Array, Array]:
    """By how much (m,) a fit without it misses each row in position [m] and orientation [rad].

    Parameters
    ----------
    nominal : RobotModel
        Where the fit began: its prior counts from there.
    fit : Identification
        From the rows used.
    table : Measurements
        All rows.
    used : (m,) array of bool
        Rows that the fit had.

    References
    ----------
    inv(I - w_j A_j C A_j') r_j, C = inv(A'WA + Lambda0): exact for a linear model.
    """
    own, columns = table.rows(used), fit.parameters.free_index
    stack, prior = linearize(fit.model, own), np.zeros((0, len(columns)))
    A = stack.A[:, columns]
    if fit.prior is not None:
        prior = prior_rows(fit.prior, nominal, fit.parameters).at(fit.model)[1][:, columns]
    weight = fit.weights if fit.loss != "squared" else np.ones(len(own))
    root = np.sqrt(weight)[stack.row_of, None] * A
    B = root @ covariance_factor(np.concatenate([root, prior]))
    residual, W = predict(fit.model, table).residual.copy(), table_whiteners(own)
    rows = np.bincount(stack.row_of)
    for size in np.unique(rows):
        which = np.flatnonzero(rows == size)
        mine = np.isin(stack.row_of, which)
        near = B[mine].reshape(len(which), size, -1)
        without = np.eye(size) - near @ np.swapaxes(near, 1, 2)
        r = np.linalg.solve(without, stack.r[mine].reshape(len(which), size, 1))
        miss = np.linalg.solve(W[which, :size, :size], r)[:, :, 0]
        residual[np.flatnonzero(used)[which], :size] = miss
    place, turn = (np.linalg.norm(part, axis=1) for part in np.split(residual, 2, axis=1))
    return frozen(place), frozen(turn)
