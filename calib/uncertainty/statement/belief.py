"""The believed region of the tool point: parameters, and the largest misfit that may hide.

One rule, whatever the tests say: no switch between statements at a level of significance.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, chdtri

from calib.arrays import Array, Index, check, frozen
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.held_out_counts import fewest_poses
from calib.identification.identify import Identification
from calib.information.propagation import propagated
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict, predicted_positions
from calib.measurement.tool_target import ToolTarget
from calib.shown import Shown
from calib.uncertainty.regions import coverage_factor, mahalanobis_squared
from calib.uncertainty.statement.applicability import Proven, proven_at
from calib.uncertainty.statement.distance import SPARE, distance_radius
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.misfit import (
    DROP,
    UNGUARDED_DROP,
    HiddenMisfit,
    misfit,
    misfit_covariance,
)
from calib.uncertainty.statement.repeats import scatter_chance
from calib.uncertainty.statement.stops import stop_covariance
from calib.uncertainty.tool_point import ToolStatement

APART = 0.05
"""Chance of visits that scatter so, by their noise, below which they are not interchangeable."""
DRAW = 20
"""Seed of the draw of one row of each pose that guards: it looks at no reading."""

TINY = 1e-290
"""Chance of a row so far off that no number of rows makes it likely."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief(Shown):
    """What is believed of an identified robot's tool point, wherever it is asked for."""

    model: RobotModel
    covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers, from the noise and what else is stated [m, rad]."""
    misfit: HiddenMisfit
    misfit_covariance: Annotated[Array, "P", "P"]
    """(P, P) of all numbers from a misfit of 1 m per axis in the training rows."""
    factor: float
    """k of the regions: the chi-square factor, or more if held-out errors ask for it."""
    n_guards: int
    """Held-out poses that guard the factor; 0 where there were too few."""
    probability: float
    proven: Proven
    """Where the proof stands; elsewhere the region grows."""
    turned: float = 0.0
    """How far angles are off beyond what is stated of them, per axis; what that leaves in the
    numbers is in `covariance` [rad]."""

    def __repr__(self) -> str:
        return (
            f"Belief(misfit up to {1e6 * self.misfit.upper:.3g} um per axis, factor "
            f"{self.factor:.3g}, {self.n_guards} guards)"
        )

    def regions(
        self,
        q: ArrayLike,
        *,
        target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
        growth: ArrayLike | None = None,
        repeatability: ArrayLike | None = None,
        at: OperatingConditions = AS_USUAL,
    ) -> ToolStatement:
        """Regions of the mean of many moves to joints q (N, n) [rad, m], or of where one move ends.

        Parameters
        ----------
        q : (N, n) array_like
            Commanded joint values.
        target : (3,) array_like or ToolTarget
            Point in the tool frame that is stated [m], or a reflector of the model.
        growth : (N,) or scalar array_like, optional
            Factor of the misfit's variance at each posture, one or more; by default what `proven`
            says of it.
        repeatability : (n,) array_like, optional
            Standard deviation with which each joint comes back [rad, m]; given, the regions are of
            where one move ends, at the same factor.
        at : OperatingConditions, optional
            Under which the robot goes there.
        """
        mean, move = self.mean_and_move(
            q, target=target, growth=growth, repeatability=repeatability, at=at
        )
        return mean if move is None else move

    def mean_and_move(
        self,
        q: ArrayLike,
        *,
        target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
        growth: ArrayLike | None = None,
        repeatability: ArrayLike | None = None,
        at: OperatingConditions = AS_USUAL,
    ) -> tuple[ToolStatement, ToolStatement | None]:
        """`regions` of the mean of many moves, and of one move where a repeatability is given."""
        grown = self.proven.applies(q, at).growth if growth is None else np.asarray(growth, float)
        T, J = self.model.poses_and_jacobian(q, at)
        position, rows = ToolTarget.of(target).positions_and_rows(self.model, T, J)
        sigma = _region(self, rows, np.broadcast_to(grown, (len(T),)))
        mean = ToolStatement(frozen(position), frozen(sigma), self.factor, self.probability)
        if repeatability is None:
            return mean, None
        (sd,) = check(f"{self.model.chain.n_joints}", repeatability=repeatability)
        moved = rows[:, :, joint_columns(self.model.chain)] * sd
        return mean, replace(mean, covariance=frozen(sigma + moved @ np.swapaxes(moved, 1, 2)))

    def seen_regions(self, table: Measurements) -> ToolStatement:
        """Regions of the points that rows of a table look at, with their own stations and tools.

        In the axes of each row's station: what is uncertain of its frames is in them.
        """
        rows = predict(self.model, table).rows[:, :3]
        sigma = _region(self, rows, self.proven.applies(table.q, table.conditions).growth)
        position = predicted_positions(self.model, table)
        return ToolStatement(frozen(position), frozen(sigma), self.factor, self.probability)


def believe(
    identification: Identification,
    train: Measurements,
    held_out: Measurements | None = None,
    *,
    covariance: ArrayLike | None = None,
    shared: ArrayLike | None = None,
    repeats: NoiseRepeats | None = None,
    probability: float = 0.95,
    target: ArrayLike | ToolTarget = (0.0, 0.0, 0.0),
    drawn: bool = True,
    quiet: tuple[Measurements, Measurements | None] | None = None,
    stops: tuple[Array, Array] | None = None,
) -> Belief:
    """State what may be believed after an identification.

    Parameters
    ----------
    identification : Identification
        By weighted least squares, from `train`.
    train : Measurements
        What was identified from.
    held_out : Measurements, optional
        From where the robot is used; they guard the factor.
    covariance : (P, P) array_like, optional
        Of all numbers from the noise, where linear propagation does not hold [m, rad].
    shared : (P, P) array_like, optional
        Covariance of all numbers from what all readings share (instrument, drift) [m, rad].
    repeats : NoiseRepeats, optional
        What repeats say of the noise.
    probability : float
        Content of the regions.
    target : (3,) array_like or ToolTarget
        Point in the tool frame at which growth is counted [m], or a reflector of the model.
    drawn : bool
        Whether the held-out poses were drawn at random: designed ones guard nothing.
    quiet : tuple of Measurements, optional
        Both tables with the noise that is known to be there, where more is stated than anything
        measured tells: the rest bounds the misfit and guards the factor as if it were misfit.
    stops : tuple of arrays, optional
        Roots (m, 6, j) and (n, 6, j) of the noise in both tables that rows of one stop share.

    References
    ----------
    S = P + sigma_U^2 max(1, g) Q, P and N with the scale of the noise where repeats tell that it is
    larger than stated; k^2 = chi2_3 max(1, r-th smallest of e'inv(S + N)e / chi2_3, r-th smallest
    of (|e| / R)^2) over n held-out poses, r = ceil(p (n + 1)), R of the ball that holds p of N(0, S
    + N): ellipsoid and radius are both promised. Of several rows of a pose see `_of_poses`.
    Discrepancy: Kennedy & O'Hagan 2001; guard: split conformal, Vovk et al. 2005.
    """
    where = train if held_out is None or not len(held_out) else held_out
    n = 0 if held_out is None else held_out.rows(~held_out.is_distance).n_poses
    guarded = drawn and n >= fewest_poses(probability)
    drop = DROP if guarded else UNGUARDED_DROP
    size = misfit(identification, train, held_out, repeats=repeats, stops=stops, drop=drop)
    if quiet is not None:
        held_out = quiet[1]
        size = size.at_least(misfit(identification, *quiet, repeats=repeats, drop=drop))
    P = identification.model.n_numbers
    of_noise = identification.full_covariance if covariance is None else covariance
    (whole,) = check(f"{P} {P}", covariance=of_noise)
    if stops is not None and covariance is None:
        whole = whole + stop_covariance(identification, train, stops[0])
    whole = size.larger_noise**2 * whole
    plain = Belief(
        identification.model, frozen(whole), size,
        misfit_covariance(identification, train, size.shape),
        float(np.sqrt(chdtri(3, 1 - probability))), n if guarded else 0, probability,
        proven_at(identification, train, where.q, target=target),
    )  # fmt: skip
    return adding(plain, np.zeros((P, P)) if shared is None else shared, held_out)


def adding(belief: Belief, shared: ArrayLike, held_out: Measurements | None = None) -> Belief:
    """The belief with a further covariance (P, P) of all numbers, guarded by the same poses."""
    P = belief.model.n_numbers
    whole = belief.covariance + check(f"{P} {P}", shared=shared)[0]
    plain = replace(
        belief, covariance=frozen(whole), factor=float(np.sqrt(chdtri(3, 1 - belief.probability)))
    )
    if not belief.n_guards or held_out is None or not np.isfinite(belief.misfit.upper):
        return plain
    scores = np.sort(_scores(plain, held_out.rows(~held_out.is_distance)), axis=1)
    rank = int(np.ceil(belief.probability * (belief.n_guards + 1) - 1e-9))
    return replace(plain, factor=max(plain.factor, float(scores[:, rank - 1].max())))


def _region(belief: Belief, rows: Array, growth: Array) -> Array:
    """Covariances (N, 3, 3) of points whose derivative is given as rows (N, 3, P) [m^2]."""
    own = belief.misfit.shape.rows(rows)
    spread = propagated(rows, belief.misfit_covariance) + own @ np.swapaxes(own, 1, 2)
    size = belief.misfit.upper**2 * np.maximum(1.0, growth)
    return propagated(rows, belief.covariance) + size[:, None, None] * spread


def _scores(belief: Belief, points: Measurements) -> Array:
    """Factors (k, n) at which held-out poses are within their ellipsoids, and within their radii.

    S as it is stated there, with its growth: any score makes a split conformal factor.
    """
    seen = predict(belief.model, points)
    growth = belief.proven.applies(points.q, points.conditions).growth
    sigma = _region(belief, seen.rows[:, :3], growth)
    sigma = sigma + belief.misfit.larger_noise**2 * points.covariance[:, :3, :3]
    within = np.sqrt(mahalanobis_squared(seen.residual[:, :3], sigma))
    plain, ball = coverage_factor(3, belief.probability), np.zeros(len(points))
    # the radius of a round region is the least of its variance: errors within it ask for nothing
    far = seen.misses > plain * np.sqrt(np.trace(sigma, axis1=1, axis2=2) / 3) * (1 - SPARE)
    if far.any():
        ball[far] = plain * seen.misses[far] / distance_radius(sigma[far], belief.probability)
    return _of_poses(belief, points, np.stack([within, ball]))


def _of_poses(belief: Belief, points: Measurements, scores: Array) -> Array:
    """Scores (k, n) of poses from those (2, m) of their rows, which are not independent.

    The worst row of each, where visits stand further apart than their noise explains: then play
    from another side may be in it. Else the worst of many is large by chance alone. So one row
    counts, drawn before any is looked at, which is all that the guarantee for a further row of a
    further pose asks for; and the worst as large as one row is that chance makes as rarely.

    References
    ----------
    F(s)^r = F(t), F of chi with 3 degrees: of r independent rows the worst; of others less than t.
    """
    worst = np.stack([points.largest_of_poses(each) for each in scores])
    _, rows = np.unique(points.pose_id, return_counts=True)
    noise = belief.misfit.larger_noise
    if rows.max() == 1 or scatter_chance(belief.model, points, noise) < APART:
        return worst
    tail = chdtrc(3, worst**2)
    # others ask for nothing, or are as far off as one row would be
    seldom = (tail < 1 - belief.probability) & (tail > TINY)
    share = -np.expm1(np.broadcast_to(rows, worst.shape)[seldom] * np.log1p(-tail[seldom]))
    alone = worst.copy()
    alone[seldom] = np.sqrt(chdtri(3, share))
    return np.concatenate([scores[:, drawn_rows(points, rows)], alone])


def drawn_rows(points: Measurements, rows: Index) -> Index:
    """One row of each of n poses, which have so many `rows` (n,): the same in whatever order."""
    order = np.lexsort((*points.target_key.T, points.repeat, points.pose_id))
    shares = np.random.default_rng(DRAW).random(len(rows))
    return np.asarray(order[np.cumsum(rows) - rows + (shares * rows).astype(np.int64)])
