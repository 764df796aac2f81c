"""A nest that was unseated for some rounds and set right again, by where the others have it."""

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index
from calib.measurement.corrections import rigid_fit_covariance
from testbed.files.nests.motions import best_fit, show_a_turn

CHANCE = 1e-3
"""Chance of good shots of which any is said to be of an unseated nest."""
CLEARLY = 2 * float(np.log(20))
"""How far the square of one shot is above those of its round at odds of 20 to one that it is this
nest, and no other, that stood elsewhere."""
PASSES = 10
"""Times that places are looked at again without what stood out."""
OF_MEDIAN = np.pi / 2
"""Variance of a median over that of a mean."""


def unseated(place: Array, sd: float) -> Bool:
    """Shots (r, k) of nests that stood elsewhere in their round, by the others; no more than these.

    None where that leaves no others: where a nest would be in its place in half of its rounds or
    fewer, or a round without three others out of one line. None of a round whose others do not
    agree even without them, as where two of five stood elsewhere: any of these may be the ones.

    Parameters
    ----------
    place : (r, k, 3) array
        Where each round saw each nest, nan where it did not [m].
    sd : float
        Stated noise of a shot, per axis [m].

    References
    ----------
    Each shot against its median place, brought into its round by a rigid motion of the round's
    others (Procrustes): chi-square of 3 degrees of freedom by the noise of the shot, of the median
    and of the motion, the noise as stated or, if larger, as the median of all of them has it. The
    worst of each round, by `CHANCE` over the shots (Bonferroni), until none is left. The square is
    what a nest that stood elsewhere takes off the sum of squares: twice a log-likelihood. Others
    agree if their sum is not above the limit of chi-square of `CHANCE` over the rounds.
    """
    good = np.isfinite(place[:, :, 0])
    found, count = np.zeros_like(good), int(good.sum())
    if not good.any(axis=0).all():
        return found
    level = float(chdtri(3, CHANCE / max(count, 1)))
    for _ in range(PASSES):
        square = _against_others(place, good & ~found)
        told = np.isfinite(square)
        if not told.any():
            break
        variance = max(sd**2, float(np.median(square[told])) / float(chdtri(3, 0.5)))
        square = np.where(told, square, 0.0) / variance
        in_turn = np.sort(square, axis=1)
        alone = in_turn[:, -1] - in_turn[:, -2] >= CLEARLY
        worst = (square == in_turn[:, -1:]) & alone[:, None]
        more = worst & (square > level)
        if not more.any():
            break
        found |= more
        if (2 * (good & ~found).sum(axis=0) <= good.sum(axis=0)).any():
            return np.zeros_like(found)
    if found.any():
        left, freedom = _left(place, good & ~found)
        found[left > variance * chdtri(np.maximum(freedom, 1), CHANCE / len(place))] = False
    return found


def _against_others(place: Array, good: Bool) -> Array:
    """Squares (r, k) of how far shots are off by the others of their round, of noise one [m^2].

    Not a number where these are too few.
    """
    usual, found = _usual(place, good), np.full(good.shape, np.nan)
    noise = 1 + OF_MEDIAN / good.sum(axis=0)
    for some in np.unique(good, axis=0):
        rows = np.flatnonzero((good == some).all(axis=1))
        for nest in np.flatnonzero(some):
            others = np.flatnonzero(some & (np.arange(len(some)) != nest))
            if not show_a_turn(usual[others]):
                continue
            R, t = best_fit(usual[others], place[rows[:, None], others])
            off = place[rows, nest] - R @ usual[nest] - t
            own = noise[:, None, None] * np.eye(3)
            of_motion = rigid_fit_covariance(usual[others], usual[nest], own[others])[:3, :3]
            V = own[nest] + of_motion
            turned = np.swapaxes(R, 1, 2) @ off[..., None]  # in the axes of `usual`
            found[rows, nest] = (turned * np.linalg.solve(V, turned)).sum(axis=(1, 2))
    return found


def _left(place: Array, good: Bool) -> tuple[Array, Index]:
    """Sums of squares (r,) that rounds leave of `good` shots, of noise one [m^2], and freedom."""
    usual, left = _usual(place, good), np.zeros(len(place))
    noise = 1 + OF_MEDIAN / good.sum(axis=0)
    for rows, which, there in _brought_onto(usual, place, good):
        left[rows] = ((there - usual[which]) ** 2 / noise[which, None]).sum(axis=(1, 2))
    return left, 3 * good.sum(axis=1) - 6


def _usual(place: Array, good: Bool) -> Array:
    """Median place (k, 3) of each nest, once rounds are brought onto each other."""
    aligned = np.where(good[..., None], place, np.nan)
    for rows, which, there in _brought_onto(np.nanmedian(aligned, axis=0), place, good):
        aligned[rows[:, None], which] = there
    return np.asarray(np.nanmedian(aligned, axis=0))


def _brought_onto(usual: Array, place: Array, good: Bool) -> Iterator[tuple[Index, Index, Array]]:
    """Rounds (n,) whose good shots are of the same nests (j,), brought onto `usual` (n, j, 3).

    Only where these show how.
    """
    for some in np.unique(good, axis=0):
        which = np.flatnonzero(some)
        if show_a_turn(usual[which]):
            rows = np.flatnonzero((good == some).all(axis=1))
            seen = place[rows[:, None], which]
            R, t = best_fit(usual[which], seen)
            yield rows, which, (seen - t[:, None]) @ R
