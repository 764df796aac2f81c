"""What a model with some joint terms leaves of a robot's rows, by a covariance of the rows.

A joint map has hundreds of numbers and a robot a few dozen poses. Seen from the rows, terms whose
sizes are believed beforehand are noise that is shared between poses, and the covariance of that is
no larger with more of them. What stands below is its inverse, geometry eliminated.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dtrtri, dtrtrs

from calib.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class Ground:
    """Rows of one robot under a model of geometry and terms, in units of the noise.

    With C the covariance of the rows that the noise and what is believed of the model's numbers
    give, S is the inverse of C, and v is S times what was measured.
    """

    loss: float
    """Sum of squares that is left, with what the prior adds."""
    spread: float
    """Log determinant of the normal equations, as in `NormalEquations.solved`."""
    below: "tuple[Ground, Array, Array, Array] | None" = None
    """What it was widened from, (n, k) S times the new columns there, and the triangle and force
    by which these were eliminated."""
    start: tuple[Array, Array] | None = None
    """(n, n) S and (n,) v where it was not widened."""
    memory: "dict[int, Rest]" = field(default_factory=dict)

    @classmethod
    def of_geometry(
        cls, X: Array, r: Array, precision: Array, offset: Array
    ) -> "tuple[Ground, Array]":
        """Of columns X (f, n), residual r (n,), and a prior (f, f) from which the fit is `offset`.

        Also the step (f,) of the geometry.
        """
        seen = X @ X.T + precision
        root = np.sqrt(np.diag(seen))
        L = np.linalg.cholesky(seen / root[:, None] / root)
        inner = dtrtri(L.T)[0].T / root
        force = X @ r - precision @ offset
        pulled = inner @ force
        step = inner.T @ pulled
        Y = inner @ X
        loss = r @ r + offset @ precision @ offset - pulled @ pulled
        spread = 2 * (np.log(np.diag(L)).sum() + np.log(root).sum())
        S = -(Y.T @ Y)
        S[np.diag_indices(len(r))] += 1.0
        return cls(float(loss), float(spread), start=(S, r - step @ X)), step

    @cached_property
    def _whole(self) -> tuple[Array, Array]:
        if self.below is None:
            assert self.start is not None
            return self.start
        below, Z, L, pulled = self.below
        Y = dtrtrs(L.T, Z.T, lower=0, trans=1)[0]
        return below.inverse - Y.T @ Y, below.v - pulled @ Y

    @property
    def inverse(self) -> Array:
        """(n, n) inverse of the covariance."""
        return self._whole[0]

    @property
    def v(self) -> Array:
        """(n,) S times what was measured, what is believed of the geometry taken off."""
        return self._whole[1]

    def widened(self, columns: Array) -> "Ground":
        """With further numbers of prior sd one, by their columns (n, k)."""
        Z = self.inverse @ columns
        inner = columns.T @ Z
        inner[np.diag_indices(len(inner))] += 1.0
        L = np.linalg.cholesky(inner)
        pulled = dtrtrs(L.T, columns.T @ self.v, lower=0, trans=1)[0].ravel()
        loss, spread = self.loss - pulled @ pulled, self.spread + 2 * np.log(np.diag(L)).sum()
        return Ground(float(loss), float(spread), (self, Z, np.asarray(L), pulled))

    def rest(self, rows: Index, which: int) -> "Ground | Rest":
        """Without some rows (l,), the part of number `which`."""
        if which not in self.memory:
            across = self.inverse[:, rows]
            back = np.linalg.solve(across[rows], np.column_stack([self.v[rows], across.T]))
            parts = np.asarray(back[:, 0]), np.asarray(back[:, 1:])
            self.memory[which] = Rest(self, rows, across, *parts)
        return self.memory[which]


@dataclass(frozen=True, eq=False)
class Rest:
    """A ground without some rows, and what it says of these.

    References
    ----------
    The inverse of a part of a covariance is a Schur complement in the inverse of the whole.
    """

    whole: Ground
    rows: Index
    """(l,) those left out."""
    across: Array
    """(n, l) their columns of S."""
    missed: Array
    """(l,) what the others leave of them where nothing is bent."""
    back: Array
    """(l, n) their part of S inverted, times their rows of S."""

    @cached_property
    def inverse(self) -> Array:
        """(n, n) as of a ground; zero for the rows left out."""
        return np.asarray(self.whole.inverse - self.across @ self.back)

    @cached_property
    def v(self) -> Array:
        """(n,) likewise."""
        return np.asarray(self.whole.v - self.across @ self.missed)

    def left(self, bent: Array) -> Array:
        """What the others leave (l,) of the rows where springs bend all rows by `bent` (n,)."""
        return np.asarray(self.missed - self.back @ bent)
