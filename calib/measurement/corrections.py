"""Rigid motions taken off readings by fixed points, and what their errors leave in the readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.frames import skew
from calib.shown import Shown

BLOCK = 2_000_000
"""Numbers that are held at a time where readings meet corrections: 16 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Corrections(Shown):
    """Rigid motions that were taken off readings, each with an error of its own.

    A reading has the errors of a few of them; a table of thousands of both has no matrix of rows by
    corrections.
    """

    which: Index
    """(m, w) corrections whose errors each reading has, from 0; one may come twice."""
    share: Array
    """(m, w) how much of the error of each of these is in the reading; 0 where there are fewer."""
    lever: Array
    """(m, 3) each reading from the point that the corrections' shifts are of, axes of its station
    [m]."""
    covariance: Array
    """(r, 6, 6) of each correction, shift and rotation [m, rad]."""

    def __repr__(self) -> str:
        return f"Corrections({len(self.covariance)} of {len(self.lever)} readings)"

    def rows(self, index: Index) -> "Corrections":
        """The same of some readings (indices)."""
        return Corrections(self.which[index], self.share[index], self.lever[index], self.covariance)

    @classmethod
    def stacked(cls, several: Sequence[tuple[int, "Corrections | None"]]) -> "Corrections | None":
        """Those of several tables, by their numbers of rows; None where no table has any."""
        there = [one for _, one in several if one is not None]
        if not there:
            return None
        width, at = max(one.which.shape[1] for one in there), 0
        of, shares, levers = list[Index](), list[Array](), list[Array]()
        for m, one in several:
            which, share, lever = np.zeros((m, width), int), np.zeros((m, width)), np.zeros((m, 3))
            if one is not None:
                own = one.which.shape[1]
                which[:, :own], share[:, :own], lever = one.which + at, one.share, one.lever
                at += len(one.covariance)
            of, shares, levers = [*of, which], [*shares, share], [*levers, lever]
        covariance = np.concatenate([one.covariance for one in there])
        return cls(
            np.concatenate(of), frozen(np.concatenate(shares)), frozen(np.concatenate(levers)),
            covariance,
        )  # fmt: skip

    @property
    def roots(self) -> Array:
        """(r, 6, 6) lower roots of the covariances."""
        return np.asarray(np.linalg.cholesky(self.covariance))

    @property
    def motion(self) -> Array:
        """(m, 6, 6) what a shift and a rotation do to each reading [m, rad]."""
        B = np.tile(np.eye(6), (len(self.lever), 1, 1))
        B[:, :3, 3:] = -skew(self.lever)
        return B

    def followed(self, gain: Array) -> Array:
        """(r, f, 6) how f numbers follow the errors of size one of each correction.

        `gain` (m, f, 6) is how they follow each reading.
        """
        by_motion = gain @ self.motion
        moved = np.zeros((len(self.covariance), *by_motion.shape[1:]))
        for which, share in zip(self.which.T, self.share.T, strict=True):
            np.add.at(moved, which, share[:, None, None] * by_motion)
        return np.asarray(moved @ self.roots)

    def left(self, rows: Array, moved: Array) -> Array:
        """(m,) sum of squares, over all errors of size one, of what is left of their shifts [m^2].

        `rows` (m, 3, f) are derivatives of the readings' places, `moved` as from `followed`.
        """
        m, r = len(self.lever), len(moved)
        shifts, roots = self.motion[:, :3], self.roots
        own = [shifts @ roots[which] * share[:, None, None]
               for which, share in zip(self.which.T, self.share.T, strict=True)]  # fmt: skip
        squares, many = np.zeros(m), max(1, BLOCK // max(18 * m, 1))
        for first in range(0, r, many):
            block = moved[first : first + many]
            there = np.einsum("mif,kfe->mkie", rows, block, optimize=True)
            for which, error in zip(self.which.T, own, strict=True):
                # one that comes twice is in another column, so that no entry is met twice here
                inside = np.flatnonzero((which >= first) & (which < first + len(block)))
                there[inside, which[inside] - first] -= error[inside]
            squares += np.square(there).sum(axis=(1, 2, 3))
        return squares


def rigid_fit_covariance(points: Array, middle: Array, noise: Array) -> Array:
    """Covariance (6, 6) of the shift of a point and the rotation that bring points onto readings.

    Parameters
    ----------
    points : (k, 3) array
        Three or more, not in one line [m].
    middle : (3,) array
        The point [m].
    noise : (k, 3, 3) array
        Of each reading [m^2].

    References
    ----------
    Least squares without weights: inv(N) (sum J_i' S_i J_i) inv(N), N = sum J_i'J_i and
    J_i = [I, -[x_i - c]x].
    """
    J = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(points), 3, 3)), -skew(points - middle)], axis=2
    )
    gain = np.linalg.solve(np.einsum("kri,krj->ij", J, J), np.moveaxis(J, 0, 1).reshape(-1, 6).T)
    each = np.moveaxis(gain.reshape(6, 3, -1), 2, 0)
    return np.asarray((each @ noise @ np.swapaxes(each, 1, 2)).sum(axis=0))
