"""Tangent planes of many least-squares problems at once, by normal equations."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.frames import exp_so3, right_jacobian_inverse
from calib.geometry.many import ManyModels
from calib.geometry.parameters import Parameters
from calib.identification.many.tables import ManyRows
from calib.identification.prior import Prior
from calib.identification.tangent import EXACT_FIT
from calib.information.reduction import KEEP_TOLERANCE

SMALLEST_PIVOT = KEEP_TOLERANCE**2
"""Squared part of a column outside those before it: a robot with less is left to `identify`, which
factors rows instead of normal equations."""


def times(vectors: Array, matrices: Array) -> Array:
    """Vectors (R, n) times matrices (n, f), shared or (R, n, f): (R, f).

    Each by itself: a product of matrices would let the bits of a row depend on how many there are.
    """
    return np.asarray((vectors[:, None] @ matrices)[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class ManyBeliefs:
    """What is believed beforehand of all free numbers, the same for all robots."""

    mean: Array
    """(f,) step from the nominal model [m, rad]."""
    precision: Array
    """(f, f) Lambda0."""
    free: Index
    """(f,) places in the full vector."""

    @classmethod
    def of(cls, prior: Prior, parameters: Parameters) -> "ManyBeliefs":
        """A prior of all free numbers, in their order."""
        order = [prior.names.index(name) for name in parameters.free_names]
        precision = prior.precision[np.ix_(order, order)]
        return cls(prior.mean[order], precision, parameters.free_index)

    def at(self, models: ManyModels) -> tuple[Array, Array]:
        """Step still to go to the mean (R, f), and derivative D (R, f, f) of the step so far.

        References
        ----------
        As `prior.step_derivative`.
        """
        step, k = models.steps(), 6 + 5 * models.links.shape[1]
        D = np.broadcast_to(np.eye(step.shape[1]), (*step.shape, step.shape[1])).copy()
        for first in (0, k):
            t, r = slice(first, first + 3), slice(first + 3, first + 6)
            D[:, t, t], D[:, r, r] = exp_so3(step[:, r]), right_jacobian_inverse(step[:, r])
        # in one order of memory, so that sums do not hang on how many robots there are
        left = np.ascontiguousarray(self.mean - step[:, self.free])
        return left, np.ascontiguousarray(D[:, self.free[:, None], self.free])


class PriorCurvature(NamedTuple):
    """A prior at R models: D'Lambda0 D is what it adds to the normal equations."""

    D: Array
    """(R, f, f)"""
    precision: Array
    """(f, f) Lambda0."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyTangents:
    """Residuals and columns of R robots at their models, with those of a prior."""

    r: Array
    """(R, N) whitened measured minus predicted."""
    A: Array
    """(R, f, N) whitened columns."""
    gradient: Array
    """(R, f) A'r + D'Lambda0 (mean - x): the sum of squares falls along it."""
    cost: Array
    """(R,) r'r and the prior's part."""
    held: PriorCurvature | None
    """What the prior holds; None without one."""

    @classmethod
    def of(cls, rows: ManyRows, models: ManyModels, belief: ManyBeliefs | None) -> "ManyTangents":
        """At some models."""
        r, A = rows.at(models)
        gradient, cost = (A @ r[:, :, None])[:, :, 0], np.einsum("ri,ri->r", r, r)
        if belief is None:
            return cls(r, A, gradient, cost, None)
        left, D = belief.at(models)
        weighed = times(left, belief.precision)
        gradient = gradient + (weighed[:, None] @ D)[:, 0]
        cost = cost + (weighed * left).sum(axis=1)
        return cls(r, A, gradient, cost, PriorCurvature(D, belief.precision))

    @property
    def data(self) -> Array:
        """(R, f, f) A'A."""
        return np.asarray(self.A @ np.swapaxes(self.A, 1, 2))

    def normal(self, data: Array) -> Array:
        """(R, f, f) A'A + D'Lambda0 D."""
        if self.held is None:
            return data
        D, precision = self.held
        return np.asarray(data + np.swapaxes(D, 1, 2) @ precision @ D)

    def certificate(self, inside: Array) -> Array:
        """(R,) as in `Tangent.certificate`, from squared offsets (R,)."""
        f, n = self.A.shape[1:]
        over = n - f if self.held is None else n
        outside = np.maximum(self.cost - inside, np.finfo(np.float64).eps * self.cost)
        relative = np.sqrt(np.maximum(inside, 0.0) / f * max(over, 1) / np.maximum(outside, 1e-300))
        return np.where(self.cost < EXACT_FIT**2, np.sqrt(np.maximum(inside, 0.0)), relative)


@dataclass(frozen=True, slots=True, eq=False)
class ManyInverses:
    """Inverses of normal equations."""

    C: Array
    """(R, f, f)"""
    sound: Bool
    """(R,) whether rounding spares them."""
    spread: Array
    """(R,) logarithms of the determinants of the normal equations."""

    @classmethod
    def of(cls, H: Array) -> "ManyInverses":
        """Of H (R, f, f), through unit diagonals; of those that have none, nan."""
        s = np.sqrt(np.diagonal(H, axis1=1, axis2=2))
        with np.errstate(invalid="ignore", divide="ignore"):
            scaled = H / (s[:, :, None] * s[:, None, :])
        try:
            pivots = np.diagonal(np.linalg.cholesky(scaled), axis1=1, axis2=2)
        except np.linalg.LinAlgError:
            # one of them has none: each by itself
            if len(H) > 1:
                each = [cls.of(one[None]) for one in H]
                return cls(*(np.concatenate([getattr(e, n) for e in each]) for n in cls.__slots__))
            return cls(np.full(H.shape, np.nan), np.zeros(1, dtype=bool), np.full(1, np.nan))
        C = np.linalg.solve(scaled, np.eye(H.shape[1])) / (s[:, :, None] * s[:, None, :])
        spread = 2 * (np.log(pivots) + np.log(s)).sum(axis=1)
        return cls((C + np.swapaxes(C, 1, 2)) / 2, pivots.min(axis=1) ** 2 > SMALLEST_PIVOT, spread)
