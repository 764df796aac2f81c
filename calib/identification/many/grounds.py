"""Residuals of one robot's rows under a model with joint terms, by the covariance of the rows.

A joint map has hundreds of numbers and a robot a few dozen poses. To the rows, terms with a prior
are noise that is correlated between poses, and the covariance of that is no larger with more terms.
With rows in units of the noise its inverse is S = 1 - Y'Y, where Y has a row for each number, or
direction of numbers, that the rows inform about.
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
    """Rows weighted by the inverse of their covariance, S = 1 - Y'Y."""

    spent: Array
    """(k, n) Y; the sum of its squares is the number of parameters learned from the rows."""
    v: Array
    """(n,) S times the residual at the prior mean of the geometry."""

    def gram(self, columns: Array) -> Array:
        """A'S A (c, c) of columns A (n, c)."""
        told = self.spent @ columns
        return np.asarray(columns.T @ columns - told.T @ told)

    def times(self, rows: Array) -> Array:
        """S times rows (n,) or columns of them (n, c)."""
        return np.asarray(rows - self.spent.T @ (self.spent @ rows))


@dataclass(frozen=True, eq=False)
class Ground:
    """Fit of all rows of one robot by a model of geometry and terms."""

    loss: float
    """Residual sum of squares, with that of the prior."""
    spread: float
    """Log determinant of the normal equations, as in `NormalEquations.solved`."""
    made: Callable[[], RowsLeft]
    """Function that computes `rows` when they are needed."""
    rests: "dict[int, Rest]" = field(default_factory=dict)
    """Results of `rest` so far, by the number of the part that is left out."""

    @classmethod
    def of_geometry(
        cls, X: Array, r: Array, precision: Array, offset: Array
    ) -> "tuple[Ground, Array]":
        """Fit of geometry alone, and the step (f,) to its minimum [m, rad].

        Parameters
        ----------
        X : (f, n) array
            Columns of the free numbers, in units of the noise.
        r : (n,) array
            Residual in units of the noise.
        precision : (f, f) array
            Precision of the prior [1/m^2, 1/(m rad), 1/rad^2].
        offset : (f,) array
            Linearization point of X and r minus the prior mean [m, rad].
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
        """The rows weighted by the inverse of their covariance, computed once."""
        return self.made()

    def widened(self, columns: Array, products: Array) -> "Ground":
        """The fit with k further numbers of prior sd one.

        `columns` (k, n) are theirs, and `products` (k, k) has the inner products of these columns;
        only its lower triangle is read.
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
        """The fit without part number `which`, whose rows are `out` (l,)."""
        if which not in self.rests:
            own = self.rows.spent[:, out]
            self.rests[which] = Rest(self.rows, out, _factor(np.eye(len(out)) - own.T @ own))
        return self.rests[which]


@dataclass(frozen=True, eq=False)
class Rest:
    """A ground without some rows, and its prediction errors of these.

    References
    ----------
    The inverse of a part of a covariance is a Schur complement in the inverse of the whole.
    """

    whole: RowsLeft
    """All rows."""
    out: Index
    """(l,) rows that are left out."""
    U: Array
    """(l, l) upper Cholesky factor of their block of S."""

    @cached_property
    def new(self) -> Array:
        """(l, n) rows to add to Y, which make S zero for the rows left out."""
        spent = self.whole.spent
        across = -(spent[:, self.out].T @ spent)
        across[range(len(self.out)), self.out] += 1.0
        return _behind(self.U, across)

    def told(self, rows: Array, spent: Array) -> Array:
        """`new` times rows (n,) or columns of them (n, c), for which Y gives `spent`."""
        own = rows[self.out] - self.whole.spent[:, self.out].T @ spent
        return _behind(self.U, own)

    @cached_property
    def pulled(self) -> Array:
        """(l,) solution of U'x = v for the rows left out."""
        return _behind(self.U, self.whole.v[self.out])

    @cached_property
    def rows(self) -> RowsLeft:
        """Weighted rows of the fit, with zeros for the rows left out."""
        spent = np.concatenate([self.whole.spent, self.new])
        return RowsLeft(spent, self.whole.v - self.pulled @ self.new)

    def left(self, bent: Array | None = None) -> Array:
        """Prediction errors (l,) of the rows left out; springs move all rows by `bent` (n,)."""
        found = self.pulled
        if bent is not None:
            found = found - self.told(bent, self.whole.spent @ bent)
        return np.asarray(dtrsm(1.0, self.U, found[:, None])[:, 0])


def _factor(A: Array) -> Array:
    """Upper U with U'U = A; only the lower triangle of A is read, and A is overwritten."""
    U, flaw = dpotrf(A.T, overwrite_a=True)
    if flaw:
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return np.asarray(U)


def _behind(U: Array, rows: Array) -> Array:
    """Solution X of U'X = rows (k,) or (k, n), which are overwritten; solved as X'U = rows'."""
    found = dtrsm(1.0, U, np.atleast_2d(rows.T), side=1, overwrite_b=True)
    return np.asarray(found.T.reshape(rows.shape))
