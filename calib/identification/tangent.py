"""The tangent plane of a least-squares problem at one point: steps, certificate, covariance."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from calib.arrays import Array

RELATIVE_OFFSET = 1e-6
"""Largest relative offset that counts as converged (Bates & Watts 1988)."""
EXACT_FIT = 1e-6
"""Below this norm of r the relative offset compares rounding with rounding: |Q1'r| judges."""
EXACT_OFFSET = 1e-9
"""Largest |Q1'r| that counts as converged for an exact fit."""
NEGLIGIBLE = 1e-10
"""Relative offset at which to stop: what is left is some 1e-10 standard deviations."""
EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, eq=False)
class Tangent:
    """A residual with the singular value decomposition of its column-scaled Jacobian."""

    r: Array
    A: Array
    cost: float
    scale: Array
    """(p,) by which the columns of A are divided: their norms, or larger ones met before."""
    singular: Array
    """(p,) singular values of A / scale, largest first."""
    Vt: Array
    inside: Array
    """(p,) U'r, the residual inside the tangent plane."""

    @property
    def offset(self) -> float:
        """|Q1'r|: with unit noise, the length of the undamped step in standard deviations."""
        return float(np.linalg.norm(self.inside))

    @property
    def exact(self) -> bool:
        """Whether nothing but rounding lies outside the tangent plane."""
        n, p = self.A.shape
        return n == p or self.cost < EXACT_FIT**2

    @property
    def certificate(self) -> float:
        """How much of the residual the parameters could still explain, against what they cannot.

        The relative offset sqrt[(|Q1'r|^2 / p) / (|Q2'r|^2 / (n - p))], Q1 spanning the columns of
        A; below 1e-6 the fit has converged. Where |r| < 1e-6, or n = p, that ratio is rounding over
        rounding: it is |Q1'r|, to be below 1e-9.

        References
        ----------
        Bates & Watts 1988.
        """
        if self.exact:
            return self.offset
        n, p = self.A.shape
        # on the way to an exact fit nothing but rounding is left outside
        outside = max(self.cost - self.offset**2, np.finfo(np.float64).eps * self.cost)
        return float(np.sqrt((self.offset**2 / p) / (outside / (n - p))))

    @property
    def certified(self) -> bool:
        """Whether the certificate is good enough."""
        return self.certificate < (EXACT_OFFSET if self.exact else RELATIVE_OFFSET)

    @property
    def finished(self) -> bool:
        """Whether the next step cannot matter."""
        return not self.exact and self.certificate <= NEGLIGIBLE

    @property
    def at_rounding(self) -> bool:
        """Whether what a step could gain is lost in the rounding of the sum of squares."""
        return self.offset < EXACT_OFFSET if self.exact else self.offset**2 <= 1e-15 * self.cost

    @property
    def deficient(self) -> bool:
        """Whether some direction leaves the prediction still, to rounding."""
        return bool(self.singular[-1] <= len(self.r) * EPSILON * self.singular[0])

    def step(self, radius: float) -> tuple[Array, float, float]:
        """Best step (p,) within a scaled length, that length, and the drop of |r|^2 it predicts.

        The undamped step if short enough; else the Levenberg-Marquardt step of just that length.
        """
        damping = self.damping(radius)
        power = self.singular**2
        along = self.singular * self.inside / (power + damping)
        left = damping / (power + damping)
        drop = float(np.sum(self.inside**2 * (1 - left**2)))
        return (self.Vt.T @ along) / self.scale, float(np.linalg.norm(along)), drop

    def damping(self, radius: float) -> float:
        """Lambda at which the step has length `radius` to 1 %; 0 if the undamped one is shorter."""
        damping, power, gradient = 0.0, self.singular**2, self.singular * self.inside
        if self.deficient:
            damping = EPSILON * float(power[0]) or 1.0
        for _ in range(30):
            along = gradient / (power + damping)
            length = float(np.linalg.norm(along))
            if length <= 1.01 * radius:
                break
            # Newton on 1/length, nearly straight in lambda; from the left it never overshoots
            slope = float(np.sum(along**2 / (power + damping))) / length
            damping += (length - radius) / radius * length / slope
        return damping


def covariance_factor(A: Array) -> Array:
    """K (p, p) with K K' = inv(A'A), through the singular values of the column-scaled A (n, p)."""
    scale = column_norms(A)
    _, singular, Vt = np.linalg.svd(np.linalg.qr(A / scale, mode="r"))
    return np.asarray(Vt.T / singular / scale[:, None])


def column_norms(A: Array) -> Array:
    """Norms (p,) of the columns; 1 for a column of zeros."""
    norms = np.linalg.norm(A, axis=0)
    return np.where(norms > 0, norms, 1.0)


def tangent_plane(r: Array, A: Array, scale: Array) -> Tangent:
    """Tangent plane at a point, its columns divided by `scale` (p,)."""
    n, p = A.shape
    # the residual as one more column: Q'r without Q, which costs as much as the triangle
    whole = np.empty((n, p + 1), order="F")
    np.divide(A, scale, out=whole[:, :p])
    whole[:, p] = r
    R: Array = qr(whole, mode="r", overwrite_a=True, check_finite=False)[0][:p]
    U, singular, Vt = np.linalg.svd(R[:, :p], full_matrices=False)
    return Tangent(r, A, float(r @ r), scale, singular, Vt, U.T @ R[:, p])
