"""Judgements of many robots at once, with the results of `judgement.judge` for each.

Robots of the same structure (`sights.alike`) are judged together. A robot is left to `judge` if no
misfit can be estimated, its angles are further off than stated, a joint never moved or keeps steps,
or its held-out rows seem to be in another frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, chdtri

from calib.arrays import Array, Bool, frozen
from calib.geometry.operating import STILL
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.conformal import conformal
from calib.uncertainty.drift.drifting import ORDERED, beside_misfit, where_poses_stand
from calib.uncertainty.drift.memory import REMEMBERS, drift, interchangeable, seen_by_rows
from calib.uncertainty.drift.steady import steady_drift
from calib.uncertainty.held_out import require_disjoint
from calib.uncertainty.many.frames import motion_chances
from calib.uncertainty.many.gains import ManyGains, gains_of, halved, many_whiteners, propagated
from calib.uncertainty.many.memories import memory_chances
from calib.uncertainty.many.misfits import ManyMisfits, misfits
from calib.uncertainty.many.sights import ManyRowsSeen, ManySights, sights
from calib.uncertainty.regions import coverage_factor, mahalanobis_squared
from calib.uncertainty.statement.applicability import (
    BEYOND,
    BEYOND_SLIDE,
    Applicability,
    over_usual,
)
from calib.uncertainty.statement.counted import counted_rank, enclosing_sizes
from calib.uncertainty.statement.distance import SPARE, distance_radius
from calib.uncertainty.statement.shape import MisfitShape, angles_apart, are_loud
from calib.uncertainty.statement.steps import steps_of

Drifts = dict[int, Array]
"""Covariances (f, f) from drift in the free numbers, for the robots that have it."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyJudgements:
    """Tests of R identifications at held-out poses, and regions at t targets of each."""

    position: Array
    """(R, t, 3) predicted tool points [m]."""
    held_out_p: Array
    """(R,) p-value of the errors at the held-out poses; see `HeldOut`."""
    bare: Array
    """(R, t, 3, 3) covariance from the numbers alone [m^2]."""
    discrepancy: Array
    """(R, 3, 3) Sigma_d [m^2]."""
    conformal: Array
    """(R,) radius without a model of the error [m]."""
    believed: Array
    """(R, t, 3, 3) covariance of the believed regions, of the mean of many moves [m^2]."""
    factor: Array
    """(R,) coverage factor k of these regions."""
    rows: Array
    """(R, t, 3, P) derivative of the tool points."""
    applies: tuple[Applicability, ...]
    """Whether the statement of each robot applies at its targets."""
    drift_p: Array
    """(R,) p-value of residuals that resemble their neighbors in time, if the noise has no memory;
    nan if the order of the poses does not allow the test."""
    alone: Bool
    """(R,) robots without a valid result here, for which `judge` is needed."""


def judge_many(
    fits: Sequence[Identification],
    trains: Sequence[Measurements],
    tests: Sequence[Measurements],
    targets: Sequence[Array],
    *,
    probability: float = 0.95,
) -> ManyJudgements:
    """Judge R identifications that are alike (`sights.alike`) by poses that they never used.

    Parameters
    ----------
    fits, trains, tests
        As in `judge`, one of each per robot. Rows are in the order in which they were measured,
        with held-out rows last.
    targets : sequence of (t, n) arrays
        Joint values of the targets [rad, m].
    probability : float
        Probability of every statement.
    """
    for train, test in zip(trains, tests, strict=True):
        require_disjoint(test.q, train.q)
    seen = sights(fits, trains, tests, targets)
    gains = gains_of(seen)
    size = misfits(seen, gains)
    alone = ~np.isfinite(size.upper)
    upper = np.where(alone, 1.0, size.upper)
    alone |= _turned_apart(seen, gains) | _stood_or_stepped(seen)
    alone |= motion_chances(seen, gains, seen.covariance, upper) < RED
    drift_p, drifts = _drifts(seen, trains, tests, gains, size)
    growth, *_ = _over(gains.left[0], gains)
    upper = np.minimum(upper, _counted(seen, gains, growth, probability))
    factor = _guarded(seen, gains, drifts, upper, growth, probability)
    sizes = upper[:, None] ** 2 * _over(gains.left[1], gains)[0]
    held_out_p, discrepancy = _held_out(seen, gains.spread[0])
    distance = np.linalg.norm(seen.test.residual[:, :, :3], axis=2)
    return ManyJudgements(
        seen.there.p, held_out_p, gains.spread[1], discrepancy,
        np.array([conformal(one, probability=probability).radius for one in distance]),
        _region(gains, drifts, seen.there, gains.spread[1], sizes), factor,
        seen.there.rows[:, :, :3], _applicability(seen, gains), drift_p, alone,
    )  # fmt: skip


def _turned_apart(seen: ManySights, gains: ManyGains) -> Bool:
    """Robots (R,) with larger errors of angles than stated; see `angles.loud_turns`."""
    both = seen.train, seen.test
    residual, rows, covariance = (
        np.concatenate([getattr(table, name) for table in both], axis=1)
        for name in ("residual", "rows", "covariance")
    )
    return are_loud(*angles_apart(residual, gains.shapes(rows[:, :, 3:]), covariance))


def _stood_or_stepped(seen: ManySights) -> Bool:
    """Robots (R,) with a joint that never moved or keeps steps, for which `Proven` is needed."""
    train, prismatic = seen.train.q, seen.fits[0].model.chain.prismatic
    both = np.concatenate([train, seen.test.q], axis=1)
    stepped = [bool(steps_of(q, prismatic).any()) for q in both]
    return np.asarray((np.ptp(train, axis=1) < STILL).any(axis=1) | np.array(stepped))


def _held_out(seen: ManySights, spread: Array) -> tuple[Array, Array]:
    """P-value (R,) of the held-out errors, and their covariance beyond noise (R, 3, 3) [m^2].

    `spread` (R, n, 3, 3) is the covariance of the points from the estimates [m^2].
    """
    e, N = seen.test.residual[:, :, :3], seen.test.covariance[:, :, :3, :3]
    rows = np.concatenate([seen.test.free[:, :, :3], e[..., None]], axis=3)
    R, n = rows.shape[:2]
    white = (many_whiteners(N) @ rows).reshape(R, 3 * n, -1)
    J, w = white[..., :-1], white[..., -1:]
    V = J @ seen.covariance @ np.swapaxes(J, 1, 2)
    V[:, range(3 * n), range(3 * n)] += 1.0
    square = (halved(V, w) ** 2).sum(axis=(1, 2))
    raw = np.swapaxes(e, 1, 2) @ e / n - spread.mean(axis=1) - N.mean(axis=1)
    values, axes = np.linalg.eigh((raw + np.swapaxes(raw, 1, 2)) / 2)
    positive = (axes * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(axes, 1, 2)
    return chdtrc(3 * n, square), (positive + np.swapaxes(positive, 1, 2)) / 2


def _over(found: Array, gains: ManyGains) -> tuple[Array, Array, Array]:
    """Growth, transfer and leverage (R, N) of variances (R, 3, N); see `Applicability`."""
    of_terms, of_foot, leverage = np.moveaxis(over_usual(found, gains.usual), 1, 0)
    transfer = np.maximum(of_terms, of_foot)
    return np.maximum(1.0, transfer), transfer, leverage


def _applicability(seen: ManySights, gains: ManyGains) -> tuple[Applicability, ...]:
    """Whether the statement of each robot applies at its targets."""
    _, transfer, leverage = _over(gains.left[1], gains)
    q, low, high = seen.there.q, seen.test.q.min(axis=1), seen.test.q.max(axis=1)
    room = np.where(seen.fits[0].model.chain.prismatic > 0, BEYOND_SLIDE, BEYOND)
    beyond = (q < (low - room)[:, None]) | (q > (high + room)[:, None])
    return tuple(
        Applicability(frozen(g), frozen(h), frozen(far, np.bool_))
        for g, h, far in zip(transfer, leverage, beyond, strict=True)
    )


def _region(
    gains: ManyGains, drifts: Drifts, table: ManyRowsSeen, spread: Array, sizes: Array
) -> Array:
    """Covariances (R, N, 3, 3) of points from noise, misfit and drift [m^2].

    `spread` (R, N, 3, 3) are those from the noise, and `sizes` (R, N) the variance of the misfit
    per axis [m^2].
    """
    rows = table.free[:, :, :3]
    own = gains.shapes(table.rows[:, :, :3])
    of_misfit = propagated(rows, gains.misfit) + own @ np.swapaxes(own, 2, 3)
    whole = spread + sizes[:, :, None, None] * of_misfit
    for k, slow in drifts.items():
        whole[k] += propagated(rows[k : k + 1], slow[None])[0]
    return np.asarray(whole)


def _guarded(
    seen: ManySights, gains: ManyGains, drifts: Drifts, upper: Array, growth: Array,
    probability: float,
) -> Array:  # fmt: skip
    """Coverage factors (R,) that contain the held-out errors as well; see `belief.adding`."""
    n = seen.test.q.shape[1]
    sizes = upper[:, None] ** 2 * growth
    sigma = _region(gains, drifts, seen.test, gains.spread[0], sizes)
    sigma += seen.test.covariance[:, :, :3, :3]
    e, plain = seen.test.residual[:, :, :3], coverage_factor(3, probability)
    within = np.sqrt(mahalanobis_squared(e, sigma))
    misses, ball = np.linalg.norm(e, axis=2), np.zeros(within.shape)
    far = misses > plain * np.sqrt(np.trace(sigma, axis1=2, axis2=3) / 3) * (1 - SPARE)
    rank = int(np.ceil(probability * (n + 1) - 1e-9))
    far &= far.sum(axis=1, keepdims=True) > n - rank  # fewer do not change the score at the rank
    if far.any():
        ball[far] = plain * misses[far] / distance_radius(sigma[far], probability)
    scores = np.sort(np.stack([within, ball]), axis=2)[:, :, rank - 1].max(axis=0)
    return np.asarray(np.maximum(np.sqrt(chdtri(3, 1 - probability)), scores))


def _counted(seen: ManySights, gains: ManyGains, growth: Array, probability: float) -> Array:
    """Misfits (R,) that are enough for held-out errors if counted [m]; see `counted`."""
    rank = counted_rank(seen.test.q.shape[1], probability)
    if not rank:
        return np.full(len(growth), np.inf)
    known, whole = (
        _region(gains, {}, seen.test, gains.spread[0], size * growth) for size in (0.0, 1.0)
    )
    sizes = enclosing_sizes(seen.test.residual[:, :, :3], known, whole - known, probability)
    return np.asarray(np.sort(sizes, axis=1)[:, rank - 1])


def _drifts(
    seen: ManySights, trains: Sequence[Measurements], tests: Sequence[Measurements],
    gains: ManyGains, size: ManyMisfits,
) -> tuple[Array, Drifts]:  # fmt: skip
    """P-value (R,) of memory in the noise, and its covariance in the free numbers."""
    m, n = seen.train.q.shape[1], seen.test.q.shape[1]
    order, is_test = np.arange(m + n), np.repeat([False, True], [m, n])
    pose = np.concatenate([trains[0].pose_id, -1 - tests[0].pose_id])
    alike = interchangeable(order, pose, is_test, seen_by_rows(joined([trains[0], tests[0]])))
    residual = np.concatenate([_whitened(table) for table in (seen.train, seen.test)], axis=1)
    q = np.concatenate([seen.train.q, seen.test.q], axis=1)
    stands = where_poses_stand(q, np.concatenate([seen.train.p, seen.test.p], axis=1))
    left = beside_misfit(residual, stands, alike)
    near, plain, beside = memory_chances((stands, residual, left), order, alike)
    ordered = near < ORDERED
    p, follows = np.where(ordered, np.nan, beside), np.where(ordered, plain, beside)
    found = Drifts()
    remembers = follows < REMEMBERS
    for k in np.flatnonzero((remembers | ordered) & np.isfinite(size.best)).tolist():
        shape = MisfitShape(frozen(gains.columns, np.int64), frozen(gains.sd[k]))
        left = np.zeros((len(seen.free),) * 2)
        for some, asked in ((drift, remembers[k]), (steady_drift, ordered[k])):
            one = None if not asked else some(
                seen.fits[k], trains[k], order[:m], tests[k], order[m:],
                shape=shape, misfit=float(size.best[k]),
            )  # fmt: skip
            if one is not None:
                left += one.covariance[np.ix_(seen.free, seen.free)]
        if left.any():
            found[k] = left
    return p, found


def _whitened(table: ManyRowsSeen) -> Array:
    """Position residuals (R, m, 3) in units of their noise."""
    values, axes = np.linalg.eigh(table.covariance[:, :, :3, :3])
    root = (axes / np.sqrt(values)[:, :, None]) @ np.swapaxes(axes, 2, 3)
    return np.asarray((root @ table.residual[:, :, :3, None])[..., 0])
