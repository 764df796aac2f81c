"""Gross errors: observations that even the richest model does not explain.

A model that lacks a joint error does not fit good observations where that error is large. So an
observation is called bad only by two models: the one that the evidence chooses, fitted with a loss
that gross errors cannot pull, and the richest one on offer, fitted without the observation.
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
"""Probability that a table of sound observations with noise as stated has any suspect."""
SOONER = 10.0
"""Factor on that probability for the limit beyond which the richest model tests an observation."""
LONGER_TAILS = (1.2, 1.5)
"""Variance, in units of the stated one, above which limits are raised since tails are longer than
those of noise, and at which they are `FAR` times as large."""
MOST = 0.1
"""Fraction of the poses above which misfits are blamed on the model or the stated noise.

A row counts as its share of the rows of its pose, since a model misfits all rows of a pose.
"""
ROUNDING = 1e-9
"""Tolerance for rounding in sums of such shares."""


@dataclass(frozen=True, slots=True, eq=False)
class BadShots(Shown):
    """Observations that no model explains, and those that only a richer one explains."""

    bad: Index
    """(b,) observations beyond the limit of the richest model, fitted without them; worst first."""
    sound: Index
    """(s,) other observations beyond the limit of a robust fit."""
    too_many: bool
    """Whether so many are suspect that the model or the stated noise is to blame; then none is bad.
    """
    judge: Identification
    """The richest model, fitted without the observations it tests; the last robust fit if it tests
    none or too many are suspect."""
    noise_factor: float
    """Noise that the models leave, in units of the stated one; one or more."""
    asked: str
    """Names of the joint errors that the evidence chooses; empty for geometry alone."""
    misses: Array
    """(m,) position error of each observation by `judge` fitted without it [m]."""
    turns: Array
    """(m,) the same of orientations; zero without any [rad]."""

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
    rng: np.random.Generator | None = None,
) -> BadShots:
    """Find gross errors with the model that the evidence chooses, and with the richest one.

    Parameters
    ----------
    nominal : RobotModel
        Start of all fits.
    near : RobotModel
        The same model after a robust fit of its geometry.
    measurements : Measurements
        Training rows.
    parameters : Parameters
        Free numbers of the fits.
    prior, ladders, rng
        As in `model_choice.choose`.
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
    richest, levels = tuple(ladder.levels[-1] for ladder in ladders), found.taken
    seen = inspect(wide, judge, table, chance=CHANCE)
    usual, scatter = scatter_of(seen.score, table, found.noise_factor)
    far, used = seen.score > scatter * seen.limit, np.ones(len(table), dtype=np.bool_)
    if scatter > usual and found.taken != richest:
        # long tails of a poorer model hide gross errors that the richest one shows
        levels = richest
        wide, judge = extended_by(
            nominal, table, parameters, richest, prior=prior, loss="cauchy", start=found.richest()
        )
        seen = inspect(wide, judge, table, chance=CHANCE)
        usual, scatter = scatter_of(seen.score, table, found.noise_factor)
        far |= seen.score > scatter * seen.limit
    suspects, part = np.flatnonzero(far), _part_of_pose(measurements.together)
    count = MOST * part.sum() + ROUNDING
    too_many = bool(part[suspects].sum() > count)
    sooner = chdtri(table.equations, SOONER * CHANCE / len(table))
    asked_of = _worst(seen.score / (usual * sooner), part, count)
    if len(asked_of) and too_many:
        # gross errors that draw even a robust fit put sound observations beyond their limits
        rest = table.rows(np.delete(np.arange(len(table)), asked_of))
        wide, calm = extended_by(
            nominal, rest, parameters, levels, prior=prior, loss="cauchy", start=judge.model
        )
        again = inspect(wide, calm, rest, chance=CHANCE)
        usual, scatter = scatter_of(again.score, rest, found.noise_factor)
        too_many = bool((again.score > scatter * again.limit).any())
        suspects = suspects if too_many else asked_of
    bad = suspects[:0]
    if len(asked_of) and not too_many:
        used[asked_of] = False
        wide, judge = extended_by(
            nominal, table.rows(used), parameters, richest, prior=prior, start=found.richest()
        )
        limit = chdtri(table.equations[asked_of], CHANCE / len(table))
        square = foretold(judge, table.rows(~used))
        bad = asked_of[square > scatter * limit]
        bad = bad[np.argsort(-seen.score[bad], kind="stable")]
    misses, turns = left_out_misses(wide, judge, table, used)
    return BadShots(
        frozen(bad, np.int64), frozen(np.setdiff1d(suspects, bad), np.int64), too_many, judge,
        found.noise_factor, " and ".join(level.name for level in found.taken), misses, turns,
    )  # fmt: skip


def doubtful(nominal: RobotModel, result: Identification, measurements: Measurements) -> Bool:
    """Observations (m,) that lie beyond their limits by the common scatter of the scores.

    Limits are not raised for the long tails of model errors, as those of `bad_shots` are: what
    draws a rich model to itself makes the scores of all others large as well. So these observations
    are only to be asked about. `nominal`, `result` and `measurements` are as in `inspect`.
    """
    seen = inspect(nominal, result, measurements, chance=CHANCE)
    usual, _ = scatter_of(seen.score, measurements, 1.0)
    return np.asarray(seen.score > usual * seen.limit)


def scatter_of(score: Array, measurements: Measurements, factor: float) -> tuple[float, float]:
    """Variance of scores (m,) in usual ones, at least 1, and the same raised for longer tails."""
    usual = max(1.0, float(np.median(score / chdtri(measurements.equations, 0.5))))
    return usual, usual * mildness(max(1.0, factor) ** 2 * usual)


def _part_of_pose(poses: Index) -> Array:
    """(m,) share of each row among the rows of its pose."""
    _, own, sizes = np.unique(poses, return_inverse=True, return_counts=True)
    return np.asarray(1 / sizes[own.ravel()])


def _worst(excess: Array, part: Array, count: float) -> Index:
    """Rows with excess (m,) above one: the worst, up to `count` poses by the shares `part` (m,)."""
    rows = np.flatnonzero(excess > 1)
    rows = rows[np.argsort(-excess[rows], kind="stable")]
    return np.sort(rows[np.cumsum(part[rows]) <= count])


def mildness(variance: float) -> float:
    """Factor on limits for scores of a variance in units of the usual one.

    Model errors have longer tails than noise. Up to 1.2 the factor is one, since the median score
    of a hundred sound observations differs by a tenth from its expectation.
    """
    return float(np.interp(variance, LONGER_TAILS, (1.0, FAR)))


def foretold(fit: Identification, others: Measurements) -> Array:
    """Squared whitened prediction errors (m,) of observations that a fit did not use.

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
    """Errors (m,) in position [m] and orientation [rad] of each row, by a fit without that row.

    Parameters
    ----------
    nominal : RobotModel
        Start of the fit, from which its prior is counted.
    fit : Identification
        Fit of the rows `used`.
    table : Measurements
        All rows.
    used : (m,) array of bool
        Rows that the fit used.

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
