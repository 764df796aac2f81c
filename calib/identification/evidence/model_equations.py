"""Normal equations of one model: its part of those of all models, at any scale of the noise."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor
from scipy.linalg.lapack import dpotri, dtrtrs

from calib.arrays import Array, Index
from calib.identification.evidence.spring_products import Bent, ModelSprings, settled

SETTLED = 1e-4
"""Relative change below which the iteration for the noise scale has converged."""
MOST_TURNS = 50
"""Largest number of its iterations."""
LEAST_FREE = 0.2
"""Least degrees of freedom, as a part of the rows, however many numbers are learned."""


class Sums(NamedTuple):
    """Sums over whitened rows, with columns A (n, c) and residuals r (n,)."""

    normal: Array
    """(c, c) A'A."""
    pull: Array
    """(c,) A'r."""
    square: float
    """r'r."""

    def less(self, part: float, other: "Sums") -> "Sums":
        """These sums less a part of others."""
        normal = part * other.normal
        np.subtract(self.normal, normal, out=normal)  # of megabytes: one new array, not two
        return Sums(normal, self.pull - part * other.pull, self.square - part * other.square)


class Solved(NamedTuple):
    """Solution of a model's part of the normal equations."""

    step: Array
    """(k,) step from the fit they are about: geometry, terms, springs [m, rad; kg, kg m]."""
    applied: Array
    """(c,) coefficient of each column of the equations, products of springs multiplied out."""
    evidence: float
    """Log evidence by Laplace's method, up to a constant that all models share."""
    left: float
    """Whitened sum of squares of the measurements after the step."""


class _Inside(NamedTuple):
    """Factors by which a model was solved."""

    factor: Array
    """(k, k) lower triangle L, of the matrix of the linear numbers with unit diagonal."""
    root: Array
    """(k,) square roots of its diagonal."""
    crossed: Array
    """(k, p) inv(L) of the columns by which products meet the linear numbers, divided by `root`."""
    bent: Bent
    """The fit of the springs."""

    def back(self, halfway: Array) -> Array:
        """Linear numbers (k, ...) of a right side that inv(L) was applied to."""
        solved = dtrtrs(self.factor, halfway, lower=1, trans=1)[0]
        return np.asarray((solved.T / self.root).T)


@dataclass(frozen=True, slots=True, eq=False)
class ModelEquations:
    """Normal equations of one model: linear numbers, geometry and terms, then products of springs.

    Terms are counted in units of their prior. Products that no row sees, as those of a joint and
    the moments of a link before it, are zero in every sum, and left out.
    """

    sums: Sums
    """Of the k linear numbers and the p products that some row sees."""
    precision: Array
    """(k, k) prior precision of the linear numbers."""
    believed: float
    """Log determinant of that."""
    away: Array
    """(k,) step from their prior mean to the fit."""
    size: Array
    """(k,) unit of each: one for those of the geometry, the prior sd for terms."""
    springs: ModelSprings
    """Springs of the model."""
    columns: Index
    """(k + p,) columns of all these among those of all models."""
    live: Index
    """(p,) places of the products among all of the springs."""
    width: int
    """Number c of columns of all models."""

    def picked(self, whole: Sums) -> Sums:
        """The model's part of sums over rows with the columns of all models."""
        size = np.append(self.size, np.ones(len(self.live)))
        normal = whole.normal[np.ix_(self.columns, self.columns)] * (size[:, None] * size)
        return Sums(normal, size * whole.pull[self.columns], whole.square)

    def solved(self, scale: float) -> Solved:
        """Maximum a posteriori at a scale of the noise; see `NormalEquations.solved`."""
        return self._solved(scale)[0]

    def noise(self, rows: float) -> float:
        """Scale of the noise, one or more, that the model leaves of a number of rows."""
        scale = 1.0
        for _ in range(MOST_TURNS):
            found, inside = self._solved(scale)
            free = max(rows - self._learned(inside), LEAST_FREE * rows)
            last, scale = scale, max(1.0, float(np.sqrt(found.left / free)))
            if abs(scale / last - 1) < SETTLED:
                break
        return scale

    def learned(self, scale: float) -> float:
        """Effective number of parameters that the model learns from the rows."""
        return self._learned(self._solved(scale)[1])

    def _solved(self, s: float) -> tuple[Solved, _Inside]:
        """The solution, and what it was found by.

        With H = A'A/s^2 + Lambda0 of the linear numbers, H = D L L' D, and C of their products with
        the springs' columns, C'inv(H) C is B'B with B = inv(L) inv(D) C: half the work of inv(H) C.
        """
        k = len(self.size)
        normal, pull, square = self.sums
        held = self.precision @ self.away
        seen = normal[:k, :k] / s**2 + self.precision
        root = np.sqrt(np.diag(seen))
        factor = cho_factor(
            seen / root[:, None] / root, lower=True, overwrite_a=True, check_finite=False
        )[0]
        right = np.column_stack([pull[:k] / s**2 - held, normal[:k, k:] / s**2]) / root[:, None]
        halfway, crossed = np.split(dtrtrs(factor, right, lower=1)[0], [1], axis=1)
        force = halfway[:, 0]
        own = normal[k:, k:] / s**2 - crossed.T @ crossed
        bent = self._bent(own, pull[k:] / s**2 - force @ crossed)
        inside = _Inside(factor, root, crossed, bent)
        products = bent.products[self.live]
        step = inside.back(force - crossed @ products)
        loss = square / s**2 + self.away @ held - force @ force + bent.loss
        spread = 2 * float(np.log(np.diag(factor)).sum() + np.log(root).sum()) + bent.spread
        beside = step + self.away
        believed = beside @ self.precision @ beside + bent.numbers @ bent.numbers
        applied = np.zeros(self.width)
        applied[self.columns] = np.append(self.size * step, products)
        found = Solved(
            np.append(self.size * step, self.springs.sd * bent.numbers),
            applied,
            float(self.believed - loss - spread) / 2,
            float(loss - believed) * s**2,
        )
        return found, inside

    def _bent(self, own: Array, pull: Array) -> Bent:
        """Fit of the springs within equations of the live products."""
        wide = len(self.springs.columns)
        normal, force = np.zeros((wide, wide)), np.zeros(wide)
        normal[np.ix_(self.live, self.live)], force[self.live] = own, pull
        return settled(self.springs, normal, force)

    def _learned(self, inside: _Inside) -> float:
        """Effective number of parameters learned: all less the part that the prior holds.

        It is tr(Lambda0 V) of the covariance V, which is inv(H) and what the springs move of the
        linear numbers beside it.
        """
        bent = inside.bent
        inverse = np.tril(dpotri(inside.factor, lower=1)[0]) / inside.root[:, None] / inside.root
        held = 2 * (self.precision * inverse).sum() - np.diag(self.precision) @ np.diag(inverse)
        moved = inside.back(inside.crossed @ bent.slopes[self.live])
        held += ((self.precision @ moved @ bent.inverse) * moved).sum() + np.trace(bent.inverse)
        return float(len(self.size) + len(bent.inverse) - held)
