"""What a model with some joint terms leaves of a robot's rows, by a covariance of the rows.

A joint map has hundreds of numbers and a robot a few dozen poses. Seen from the rows, terms whose
sizes are believed beforehand are noise that is shared between poses, and the covariance of that is
no larger with more of them. With rows in units of the noise its inverse is S = 1 - Y'Y, where each
number, or direction of them, that the rows tell has a row in Y.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf, dtrtri

from calib.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class RowsLeft:
    """Rows under the inverse of their covariance, S = 1 - Y'Y."""

    spent: Array
    """(k, n) Y; the sum of its squares is how many numbers are learned."""
    v: Array
    """(n,) S times what was measured, what is believed of the geometry taken off."""

    def gram(self, columns: Array) -> Array:
        """A'S A (c, c) of columns A (n, c)."""
        told = self.spent @ columns
        return np.asarray(columns.T @ columns - told.T @ told)

    def times(self, rows: Array) -> Array:
        """S times rows (n,) or columns of them (n, c)."""
        return np.asarray(rows - self.spent.T @ (self.spent @ rows))


@dataclass(frozen=True, eq=False)
class Ground:
    """All rows of one robot under a model of geometry and terms."""

    loss: float
    """Sum of squares that is left, with what the prior adds."""
    spread: float
    """Log determinant of the normal equations, as in `NormalEquations.solved`."""
    made: Callable[[], RowsLeft]
    """Its rows, worked out when they are asked for."""
    rests: "dict[int, Rest]" = field(default_factory=dict)
    """By number of the part that is left out."""

    @classmethod
    def of_geometry(
        cls, X: Array, r: Array, precision: Array, offset: Array
    ) -> "tuple[Ground, Array]":
        """Geometry alone, and the step (f,) to its least sum of squares [m, rad].

        Parameters
        ----------
        X : (f, n) array
            Columns of its numbers, in units of the noise.
        r : (n,) array
            Residual, likewise.
        precision : (f, f) array
            Of its prior.
        offset : (f,) array
            From what is believed to where X and r stand [m, rad].
        """
        seen = X @ X.T + precision
        root = np.sqrt(np.diag(seen))
        U = _factor(seen / root[:, None] / root)
        inner = dtrtri(U)[0].T / root
        force = X @ r - precision @ offset
        pulled = inner @ force
        step = inner.T @ pulled
        loss = r @ r + offset @ precision @ offset - pulled @ pulled
        spread = 2 * (np.log(np.diag(U)).sum() + np.log(root).sum())
        rows = RowsLeft(inner @ X, r - step @ X)
        return cls(float(loss), float(spread), lambda: rows), step

    @cached_property
    def rows(self) -> RowsLeft:
        """Its rows."""
        return self.made()

    def widened(self, columns: Array, products: Array) -> "Ground":
        """With further numbers of prior sd one, by their columns (k, n) and those' products (k, k).

        Of the products the lower triangle counts.
        """
        rows = self.rows
        told = rows.spent @ columns.T
        inner = products - told.T @ told
        inner[np.diag_indices(len(inner))] += 1.0
        U = _factor(inner)
        pulled = _behind(U, columns @ rows.v)

        def made() -> RowsLeft:
            new = _behind(U, columns - told.T @ rows.spent)
            return RowsLeft(np.concatenate([rows.spent, new]), rows.v - pulled @ new)

        spread = self.spread + 2 * np.log(np.diag(U)).sum()
        return Ground(float(self.loss - pulled @ pulled), float(spread), made)

    def rest(self, which: int, out: Index) -> "Rest":
        """Without part number `which`, some rows (l,)."""
        if which not in self.rests:
            own = self.rows.spent[:, out]
            self.rests[which] = Rest(self.rows, out, _factor(np.eye(len(out)) - own.T @ own))
        return self.rests[which]


@dataclass(frozen=True, eq=False)
class Rest:
    """A ground without some rows, and what it says of these.

    References
    ----------
    The inverse of a part of a covariance is a Schur complement in the inverse of the whole.
    """

    whole: RowsLeft
    """All rows."""
    out: Index
    """(l,) rows that are left out."""
    U: Array
    """(l, l) upper triangle of their part of S."""

    @cached_property
    def new(self) -> Array:
        """(l, n) what they add to Y; S is zero for them then."""
        spent = self.whole.spent
        across = -(spent[:, self.out].T @ spent)
        across[range(len(self.out)), self.out] += 1.0
        return _behind(self.U, across)

    def told(self, rows: Array, spent: Array) -> Array:
        """What is new in Y times rows (n,) or columns of them (n, c), of which Y takes `spent`."""
        own = rows[self.out] - self.whole.spent[:, self.out].T @ spent
        return _behind(self.U, own)

    @cached_property
    def pulled(self) -> Array:
        """(l,) their part of v in units of the triangle."""
        return _behind(self.U, self.whole.v[self.out])

    @cached_property
    def rows(self) -> RowsLeft:
        """The rows that are not left out; zero for the others."""
        spent = np.concatenate([self.whole.spent, self.new])
        return RowsLeft(spent, self.whole.v - self.pulled @ self.new)

    def left(self, bent: Array | None = None) -> Array:
        """What the others leave (l,) of the rows, where springs bend all rows by `bent` (n,)."""
        found = self.pulled
        if bent is not None:
            found = found - self.told(bent, self.whole.spent @ bent)
        return np.asarray(dtrsm(1.0, self.U, found[:, None])[:, 0])


def _factor(A: Array) -> Array:
    """Upper U with U'U = A, which is overwritten; its lower triangle counts."""
    U, flaw = dpotrf(A.T, overwrite_a=True)
    if flaw:
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return np.asarray(U)


def _behind(U: Array, rows: Array) -> Array:
    """Solve U'X = rows (k,) or (k, n), which are overwritten: from the right, they lie so."""
    found = dtrsm(1.0, U, np.atleast_2d(rows.T), side=1, overwrite_b=True)
    return np.asarray(found.T.reshape(rows.shape))
