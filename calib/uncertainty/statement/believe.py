"""How a belief comes about: parameters and misfit, and held-out errors that guard their region.

Held-out errors count as factors of the regions that they ask for: split conformal scores.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, chdtri

from calib.arrays import Array, Index, check, frozen
from calib.held_out_counts import fewest_poses
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.tool_target import ToolTarget
from calib.uncertainty.frames.inner_datum import inner_datum, shows_no_frame
from calib.uncertainty.frames.mirror_image import mirror_step
from calib.uncertainty.regions import coverage_factor, mahalanobis_squared
from calib.uncertainty.statement.applicability import proven_at
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.distance import SPARE, distance_radius
from calib.uncertainty.statement.evidence import NoiseRepeats
from calib.uncertainty.statement.misfit import DROP, UNGUARDED_DROP, misfit, misfit_covariance
from calib.uncertainty.statement.repeats import scatter_chance
from calib.uncertainty.statement.stops import stop_covariance

APART = 0.05
"""Chance of visits that scatter so, by their noise, below which they are not interchangeable."""
DRAW = 20
"""Seed of the draw of one row of each pose that guards: it looks at no reading."""
TINY = 1e-290
"""Chance of a row so far off that no number of rows makes it likely."""


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
    guarding: Measurements | None = None,
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
    guarding : Measurements, optional
        The held-out rows, with the noise that is no part of the errors that guard the factor; by
        default as they are in `quiet`.

    References
    ----------
    S = P + sigma_U^2 max(1, g) Q, P and N with the scale of the noise where repeats tell that it is
    larger than stated; k^2 = chi2_3 max(1, r-th smallest of e'inv(S + N)e / chi2_3, r-th smallest
    of (|e| / R)^2) over n held-out poses, r = ceil(p (n + 1)), R of the ball that holds p of N(0, S
    + N): ellipsoid and radius are both promised. Of several rows of a pose see `_of_poses`,
    where only distances are held out `scores_of_distances`.
    Where an arm and its image fit alike, the way between them counts as one standard uncertainty.
    Discrepancy: Kennedy & O'Hagan 2001; guard: split conformal, Vovk et al. 2005.
    """
    where = train if held_out is None or not len(held_out) else held_out
    points = 0 if held_out is None else held_out.rows(~held_out.is_distance).n_poses
    ranged = 0 if held_out is None or points else held_out.n_poses
    guards, ranged = (
        n if drawn and n >= fewest_poses(probability) else 0 for n in (points, ranged)
    )
    datum, image = None, np.zeros(identification.model.n_numbers)
    if shows_no_frame(identification, train):
        datum = inner_datum(identification, train, ToolTarget.of(target))
        image = mirror_step(identification, train, ToolTarget.of(target))
    drop = DROP if guards else UNGUARDED_DROP
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
    if image.any():
        whole = whole + np.outer(image, image)
    plain = Belief(
        identification.model, frozen(whole), size,
        misfit_covariance(identification, train, size.shape),
        float(np.sqrt(chdtri(3, 1 - probability))), guards, probability,
        proven_at(identification, train, where.q, target=target, datum=datum),
        n_ranged=ranged, mirrored=bool(image.any()),
    )  # fmt: skip
    by = held_out if guarding is None else guarding
    return adding(plain, np.zeros((P, P)) if shared is None else shared, by)


def adding(belief: Belief, shared: ArrayLike, held_out: Measurements | None = None) -> Belief:
    """The belief with a further covariance (P, P) of all numbers, guarded by the same poses."""
    P = belief.model.n_numbers
    whole = belief.covariance + check(f"{P} {P}", shared=shared)[0]
    plain = replace(
        belief, covariance=frozen(whole), factor=float(np.sqrt(chdtri(3, 1 - belief.probability)))
    )
    if held_out is None or not np.isfinite(belief.misfit.upper):
        return plain
    if belief.n_guards:
        n, scores = belief.n_guards, scores_of_points(plain, held_out.rows(~held_out.is_distance))
    elif belief.n_ranged:
        n, scores = belief.n_ranged, scores_of_distances(plain, held_out)
    else:
        return plain
    rank = int(np.ceil(belief.probability * (n + 1) - 1e-9))
    return replace(plain, factor=max(plain.factor, float(np.sort(scores)[:, rank - 1].max())))


def scores_of_points(belief: Belief, points: Measurements) -> Array:
    """Factors (k, n) at which held-out poses are within their ellipsoids, and within their radii.

    S as it is stated there, with its growth: any score makes a split conformal factor.
    """
    seen = predict(belief.model, points)
    growth = belief.proven.applies(points.q, points.conditions).growth
    sigma = belief.spread(seen.rows[:, :3], growth)
    sigma = sigma + belief.misfit.larger_noise**2 * points.covariance[:, :3, :3]
    within = np.sqrt(mahalanobis_squared(seen.residual[:, :3], sigma))
    plain, ball = coverage_factor(3, belief.probability), np.zeros(len(points))
    # the radius of a round region is the least of its variance: errors within it ask for nothing
    far = seen.misses > plain * np.sqrt(np.trace(sigma, axis1=1, axis2=2) / 3) * (1 - SPARE)
    if far.any():
        ball[far] = plain * seen.misses[far] / distance_radius(sigma[far], belief.probability)
    return _of_poses(belief, points, np.stack([within, ball]))


def scores_of_distances(belief: Belief, distances: Measurements) -> Array:
    """Factors (k, n) at which held-out distances of n poses are within what is stated of them.

    They show a region in their own directions alone: where they ask for nothing, it is not proven.

    References
    ----------
    F_3(s^2) = F_1(r^2 / V) for a distance off by r, its variance V with its noise: as far off as a
    point is that chance makes as rarely.
    """
    seen = predict(belief.model, distances)
    growth = belief.proven.applies(distances.q, distances.conditions).growth
    V = belief.spread(seen.rows[:, :1], growth)[:, 0, 0]
    square = seen.residual[:, 0] ** 2 / (
        V + belief.misfit.larger_noise**2 * distances.covariance[:, 0, 0]
    )
    tail = chdtrc(1, square)
    alike = np.where(tail > TINY, chdtri(3, np.maximum(tail, TINY)), square)
    return _alone(belief, distances, np.sqrt(alike)[None])


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
    if scatter_chance(belief.model, points, belief.misfit.larger_noise) < APART:
        return np.stack([points.largest_of_poses(each) for each in scores])
    return _alone(belief, points, scores)


def _alone(belief: Belief, points: Measurements, scores: Array) -> Array:
    """Scores (k, n) of a row drawn of each pose, and of its worst as one row is that far off."""
    worst = np.stack([points.largest_of_poses(each) for each in scores])
    _, rows = np.unique(points.pose_id, return_counts=True)
    if rows.max() == 1:
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
