"""Rigid motions taken off readings by fixed points, and what their errors leave in the readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.geometry.frames import skew
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class Corrections(Shown):
    """Rigid motions that were taken off readings, each with an error of its own."""

    share: Array
    """(m, r) how much of the error of each correction is in each reading."""
    lever: Array
    """(m, 3) each reading from the point that the corrections' shifts are of, axes of its station
    [m]."""
    covariance: Array
    """(r, 6, 6) of each correction, shift and rotation [m, rad]."""

    def __repr__(self) -> str:
        return f"Corrections({self.share.shape[1]} of {len(self.share)} readings)"

    def rows(self, index: Index) -> "Corrections":
        """The same of some readings (indices)."""
        return Corrections(self.share[index], self.lever[index], self.covariance)

    @classmethod
    def stacked(cls, several: Sequence[tuple[int, "Corrections | None"]]) -> "Corrections | None":
        """Those of several tables, by their numbers of rows; None where no table has any."""
        there = [(m, one) for m, one in several if one is not None]
        if not there:
            return None
        count, at = sum(len(one.covariance) for _, one in there), 0
        shares = []
        for m, one in several:
            share = np.zeros((m, count))
            if one is not None:
                share[:, at : at + len(one.covariance)] = one.share
                at += len(one.covariance)
            shares.append(share)
        levers = [np.zeros((m, 3)) if one is None else one.lever for m, one in several]
        covariance = np.concatenate([one.covariance for _, one in there])
        return cls(frozen(np.concatenate(shares)), frozen(np.concatenate(levers)), covariance)

    def errors(self, k: int) -> Array:
        """(m, 6, 6) what correction k does to each reading, its errors of size one [m, rad]."""
        B = np.tile(np.eye(6), (len(self.lever), 1, 1))
        B[:, :3, 3:] = -skew(self.lever)
        return np.asarray(
            self.share[:, k, None, None] * (B @ np.linalg.cholesky(self.covariance[k]))
        )


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
