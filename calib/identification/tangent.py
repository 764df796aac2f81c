"""The tangent plane of a least-squares problem at one point: steps, certificate, covariance.

All follows from a triangle R with R'R = A'A, columns scaled. It comes cheaply from the normal
equations where these are well conditioned, and otherwise, as at the end of a fit, from A itself.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg.lapack import dgeqrf, dpotrf, dtrcon, dtrtri, dtrtrs

from calib.arrays import Array

RELATIVE_OFFSET = 1e-6
"""Largest relative offset that counts as converged (Bates & Watts 1988)."""
EXACT_FIT = 1e-6
"""Below this norm of r the relative offset is a ratio of rounding errors, and |Q1'r| is used."""
EXACT_OFFSET = 1e-9
"""Largest |Q1'r| that counts as converged for an exact fit."""
NEGLIGIBLE = 1e-10
"""Relative offset at which to stop: the remaining step is some 1e-10 standard deviations."""
EPSILON = float(np.finfo(np.float64).eps)
BLOCK = 64
"""Columns that are eliminated together."""
SQUARED = 1e-5
"""Inverse condition of the scaled triangle from which on normal equations serve: squared, it leaves
six digits of a step, and the certificate 1e-11 |r| of rounding."""
SOUND = 1e-9
"""The same from which on no direction is lost, whatever the number of rows."""


class Believed(NamedTuple):
    """Rows of a prior: full ones, and one for each number whose prior is independent."""

    r: Array
    """(t,) residual."""
    A: Array
    """(t, p) derivative."""
    alone: Array
    """(p,) residual of the row that has one number alone."""
    slope: Array
    """(p,) derivative of that row by its number; zero where there is no such row."""


class Structured(Protocol):
    """A derivative (n, p) in factored form, which gives its products without its columns."""

    @property
    def dense(self) -> Array:
        """The derivative (n, p) with all its columns."""

    def products(self, r: Array) -> tuple[Array, Array]:
        """A'A (p, p) and A'r (p,)."""


class System(NamedTuple):
    """A least-squares problem at one point: r is about A dx for a small step dx."""

    r: Array
    """(n,) residual."""
    A: Array | Structured
    """(n, p) derivative of the prediction."""
    believed: Believed | None = None
    """Rows of a prior, most of which have one number each."""

    @property
    def square(self) -> float:
        """R'r of all rows."""
        own = self.believed
        square = float(self.r @ self.r)
        return square if own is None else square + float(own.r @ own.r + own.alone @ own.alone)

    @property
    def whole(self) -> tuple[Array, Array]:
        """Residual and derivative of all rows."""
        A = self.A if isinstance(self.A, np.ndarray) else self.A.dense
        if self.believed is None:
            return self.r, A
        held = np.flatnonzero(self.believed.slope)
        alone = np.zeros((len(held), A.shape[1]))
        alone[range(len(held)), held] = self.believed.slope[held]
        return (
            np.concatenate([self.r, self.believed.r, self.believed.alone[held]]),
            np.concatenate([A, self.believed.A, alone]),
        )

    @property
    def normal(self) -> tuple[Array, Array, float]:
        """A'A (p, p), A'r (p,) and r'r of all rows."""
        if isinstance(self.A, np.ndarray):
            normal, pull = self.A.T @ self.A, self.r @ self.A
        else:
            normal, pull = self.A.products(self.r)
        if (own := self.believed) is not None:
            normal += own.A.T @ own.A
            normal[np.diag_indices_from(normal)] += own.slope**2
            pull += own.r @ own.A + own.slope * own.alone
        return normal, pull, self.square


@dataclass(frozen=True, eq=False)
class Tangent:
    """A residual and the column-scaled Jacobian as a triangle, Q R = A / scale."""

    system: System
    shape: tuple[int, int]
    """Rows n and numbers p."""
    cost: float
    scale: Array
    """(p,) by which the columns of A are divided: their norms, or larger ones met before."""
    R: Array
    """(p, p) upper triangle; of fewer than p rows where there are fewer."""
    inside: Array
    """(p,) Q'r, the residual inside the tangent plane."""
    orthogonal: bool
    """Whether R is of A itself; else of A'A."""

    @cached_property
    def spectrum(self) -> tuple[Array, Array, Array]:
        """Singular values (p,), largest first, V' (p, p), and U'Q'r (p,)."""
        U, singular, Vt = np.linalg.svd(self.R, full_matrices=False)
        return singular, Vt, U.T @ self.inside

    @cached_property
    def sound(self) -> bool:
        """Whether the columns are clearly independent, by the condition of R."""
        return _inverse_condition(self.R) > SOUND

    @cached_property
    def along(self) -> Array:
        """(p,) undamped step in scaled numbers, for independent columns."""
        return np.asarray(dtrtrs(self.R, self.inside)[0])

    @cached_property
    def offset(self) -> float:
        """|Q1'r|: with unit noise, the length of the undamped step in standard deviations."""
        return float(np.linalg.norm(self.inside))

    @property
    def exact(self) -> bool:
        """Whether nothing but rounding lies outside the tangent plane."""
        n, p = self.shape
        return n == p or self.cost < EXACT_FIT**2

    @cached_property
    def certificate(self) -> float:
        """Relative offset: the residual inside the tangent plane over that orthogonal to it.

        It is sqrt[(|Q1'r|^2 / p) / (|Q2'r|^2 / (n - p))], Q1 spanning the columns of A; below 1e-6
        the fit has converged. If |r| < 1e-6 or n = p, that would be a ratio of rounding errors: it
        is |Q1'r| instead, which has to be below 1e-9.

        References
        ----------
        Bates & Watts 1988.
        """
        if self.exact:
            return self.offset
        n, p = self.shape
        # on the way to an exact fit nothing but rounding is left outside
        outside = max(self.cost - self.offset**2, np.finfo(np.float64).eps * self.cost)
        return float(np.sqrt((self.offset**2 / p) / (outside / (n - p))))

    @property
    def certified(self) -> bool:
        """Whether the certificate is below its limit."""
        return self.certificate < (EXACT_OFFSET if self.exact else RELATIVE_OFFSET)

    def within(self, offset: float) -> bool:
        """Whether the relative offset is at most `offset`; at 1e-10 further steps do not matter."""
        return not self.exact and self.certificate <= offset

    @property
    def at_rounding(self) -> bool:
        """Whether the gain of a step is below the rounding of the sum of squares."""
        return self.offset < EXACT_OFFSET if self.exact else self.offset**2 <= 1e-15 * self.cost

    @property
    def deficient(self) -> bool:
        """Whether A is rank deficient, to rounding."""
        if self.sound:
            return False
        singular = self.spectrum[0]
        return bool(singular[-1] <= self.shape[0] * EPSILON * singular[0])

    @property
    def factor(self) -> Array:
        """K (p, p) with K K' = inv(A'A)."""
        if self.sound:
            return np.asarray(dtrtri(self.R)[0] / self.scale[:, None])
        singular, Vt, _ = self.spectrum
        return np.asarray(Vt.T / singular / self.scale[:, None])

    def step(self, radius: float) -> tuple[Array, float, float]:
        """Best step (p,) within a trust radius, its scaled length, and the predicted drop of |r|^2.

        It is the undamped step if short enough, else the Levenberg-Marquardt step of that length.
        """
        damping = self.damping(radius)
        if not damping and self.sound:
            length = float(np.linalg.norm(self.along))
            return self.along / self.scale, length, self.offset**2
        singular, Vt, inside = self.spectrum
        power = singular**2
        along = singular * inside / (power + damping)
        left = damping / (power + damping)
        drop = float(np.sum(inside**2 * (1 - left**2)))
        return (Vt.T @ along) / self.scale, float(np.linalg.norm(along)), drop

    def damping(self, radius: float) -> float:
        """Lambda at which the step has length `radius` to 1 %; 0 if the undamped one is shorter."""
        if self.sound and np.linalg.norm(self.along) <= 1.01 * radius:
            return 0.0
        singular, _, inside = self.spectrum
        damping, power, gradient = 0.0, singular**2, singular * inside
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

    def on_rows(self) -> "Tangent":
        """Tangent plane by orthogonal factors of A, its columns scaled by their own norms."""
        r, A = self.system.whole
        own = column_norms(A)
        if self.orthogonal and np.array_equal(own, self.scale):
            return self
        return tangent_plane(r, A, own)


def covariance_factor(A: Array) -> Array:
    """K (p, p) with K K' = inv(A'A), by orthogonal factors of the column-scaled A (n, p)."""
    return tangent_plane(np.zeros(len(A)), A, column_norms(A)).factor


def column_norms(A: Array) -> Array:
    """Norms (p,) of the columns; 1 for a column of zeros."""
    norms = np.sqrt(np.einsum("ij,ij->j", A, A))
    return np.where(norms > 0, norms, 1.0)


def tangent_plane(r: Array, A: Array, scale: Array) -> Tangent:
    """Tangent plane at a point, its columns divided by `scale` (p,), by orthogonal factors of A."""
    n, p = A.shape
    # the residual as one more column: Q'r without Q, which costs as much as the triangle
    whole = np.empty((n, p + 1), order="F")
    np.divide(A, scale, out=whole[:, :p])
    whole[:, p] = r
    R = dgeqrf(whole, lwork=BLOCK * (p + 1), overwrite_a=True)[0][:p]
    triangle, inside = np.triu(R[:, :p]), R[:, p].copy()
    return Tangent(System(r, A), A.shape, float(r @ r), scale, triangle, inside, True)


def normal_plane(
    system: System, least: Array | float = 0.0, most: float = np.inf
) -> Tangent | None:
    """The same by normal equations, with scales no smaller than `least`; by A where these fail.

    None where something is not finite, or the sum of squares exceeds `most`.

    References
    ----------
    Bjorck 1996, Numerical Methods for Least Squares Problems, 2.2: the error of a step grows with
    the square of the condition, that of the gradient does not.
    """
    if system.square > most:
        return None
    normal, pull, cost = system.normal
    power = np.diagonal(normal)
    if not np.isfinite(cost + power.sum()):
        return None
    norms = np.sqrt(power)
    scale = np.maximum(np.where(norms > 0, norms, 1.0), least)
    R, failed = dpotrf((normal / scale / scale[:, None]).T, overwrite_a=True)
    if failed or not _inverse_condition(R) > SQUARED:
        r, A = system.whole
        return tangent_plane(r, A, np.maximum(column_norms(A), least))
    inside = dtrtrs(R, pull / scale, trans=1)[0]
    rows = len(system.r)
    if (own := system.believed) is not None:
        rows += len(own.r) + int(np.count_nonzero(own.slope))
    return Tangent(system, (rows, len(pull)), cost, scale, R, inside, False)


def _inverse_condition(R: Array) -> float:
    """One over the condition of a triangle in the norm of column sums, within a factor of some."""
    return float(dtrcon(R)[0]) if R.shape[0] == R.shape[1] else 0.0
