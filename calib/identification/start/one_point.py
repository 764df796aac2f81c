"""Base and one unknown point of the flange in turn, from sums over the poses that are made once."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.identification.start.closed_forms import FAINT, centroid, factored, turned_onto


@dataclass(frozen=True, slots=True, eq=False)
class OnePoint:
    """Sums over m poses from which the base follows from the point, and the point from the base.

    For measured (m, 3) = X (R_F c + p_F) + t, with all rows less their means. A step of the
    alternation takes products of 3 x 3 matrices, however many poses there are.
    """

    measured: Array
    """(3,) mean of the measured points [m]."""
    place: Array
    """(3,) mean place of the flange in the base [m]."""
    turn: Array
    """(3, 3) mean of R_F."""
    with_place: Array
    """(3, 3) sum of measured p_F' [m^2]."""
    with_turn: Array
    """(3, 3, 3) sum of measured (x) R_F [m]."""
    factors: tuple[Array, Array, float]
    """s and V' of the columns R_F = W diag(s) V', and the s up to which a direction is open."""
    onto: Array
    """(9, 3) W' X' measured by the entries of X [m]."""
    of_place: Array
    """(3,) W' p_F [m]."""

    @classmethod
    def of(cls, F: Array, measured: Array) -> "OnePoint":
        """Sums of poses F (m, 4, 4) and what was measured there (m, 3) [m]."""
        m, R, p = len(F), F[:, :3, :3], F[:, :3, 3]
        means = centroid(measured), centroid(p), centroid(R)
        seen, p, R = measured - means[0], p - means[1], (R - means[2]).reshape(3 * m, 3)
        Q, U, s, Vt = factored(R)
        W = Q @ U
        return cls(
            *means,
            with_place=seen.T @ p,
            with_turn=(seen.T @ R.reshape(m, 9)).reshape(3, 3, 3),
            factors=(s, Vt, FAINT * float(np.sqrt(m))),
            onto=(seen.T @ W.reshape(m, 9)).reshape(9, 3),
            of_place=W.T @ p.ravel(),
        )

    def arm(self, X: Array) -> Array:
        """The point c (3,) for a rotation X (3, 3) of the base [m].

        Along directions that constant orientation leaves undetermined it is zero.
        """
        s, Vt, faint = self.factors
        counted = s > faint
        along = (X.ravel() @ self.onto - self.of_place) / np.where(counted, s, 1.0)
        return np.asarray(Vt.T @ np.where(counted, along, 0.0))

    def rotation(self, arm: Array, about: Array) -> Array:
        """The rotation X (3, 3) for a point (3,) [m]; `about` (3, 3) as in `fitted_frame`."""
        return turned_onto(self.with_place + self.with_turn @ arm, about)

    def shift(self, X: Array, arm: Array) -> Array:
        """The shift t (3,) for a rotation X (3, 3) and a point (3,) [m]."""
        return np.asarray(self.measured - X @ (self.place + self.turn @ arm))
