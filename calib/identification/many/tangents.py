"""Tangent planes of many least-squares problems at once, by normal equations."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

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
    """What is believed beforehand of all free numbers: the same of all robots, but for a weight."""

    mean: Array
    """(f,) step from the nominal model [m, rad]."""
    precision: Array
    """(f, f) Lambda0, of weight one."""
    weight: Array
    """(R or 1,) of each robot."""
    free: Index
    """(f,) places in the full vector."""

    @classmethod
    def of(cls, prior: Prior, parameters: Parameters, weight: Array | None = None) -> "ManyBeliefs":
        """A prior of all free numbers, in their order; `weight` (R,), one if left out."""
        order = [prior.names.index(name) for name in parameters.free_names]
        precision, own = prior.precision[np.ix_(order, order)], np.ones(1)
        weight = own if weight is None else weight
        return cls(prior.mean[order], precision, weight, parameters.free_index)

    def some(self, which: slice | Index) -> "ManyBeliefs":
        """Those of some robots."""
        return self if len(self.weight) == 1 else replace(self, weight=self.weight[which])

    def at(self, models: ManyModels) -> "ManyHeld":
        """What is held of the free numbers at some models.

        References
        ----------
        As `prior.step_derivative`.
        """
        step, k = models.steps(), 6 + 5 * models.links.shape[1]
        turned = np.zeros((len(step), 12, 12))
        for to, first in ((0, 0), (6, k)):
            t, r = slice(to, to + 3), slice(to + 3, to + 6)
            turn = step[:, first + 3 : first + 6]
            turned[:, t, t], turned[:, r, r] = exp_so3(turn), right_jacobian_inverse(turn)
        frames = np.array([*range(6), *range(k, k + 6)])
        own = np.flatnonzero(np.isin(frames, self.free))
        # in one order of memory, so that sums do not hang on how many robots there are
        left = np.ascontiguousarray(self.mean - step[:, self.free])
        D = np.ascontiguousarray(turned[:, own[:, None], own])
        return ManyHeld(left, D, np.searchsorted(self.free, frames[own]), self)


class ManyHeld(NamedTuple):
    """A prior at R models."""

    left: Array
    """(R, f) step still to go to the mean."""
    D: Array
    """(R, k, k) derivative of the step so far by a small one, of base and tool: there it turns."""
    framed: Index
    """(k,) places of their numbers among the free ones; all other steps add."""
    belief: ManyBeliefs

    @property
    def pull(self) -> Array:
        """(R, f) weighed step to the mean, as a step of the mean."""
        return times(self.left, self.belief.precision) * self.belief.weight[:, None]

    def along(self, pull: Array) -> Array:
        """D'pull (R, f): the same as a small step."""
        out = pull.copy()
        out[:, self.framed] = (pull[:, None, self.framed] @ self.D)[:, 0]
        return out

    @property
    def curvature(self) -> Array:
        """(R, f, f) D'Lambda0 D: what the prior adds to normal equations."""
        weight = self.belief.weight[:, None, None]
        H = np.broadcast_to(self.belief.precision, (len(self.D), *self.belief.precision.shape))
        H = H * weight
        H[:, :, self.framed] = H[:, :, self.framed] @ self.D
        H[:, self.framed] = np.swapaxes(self.D, 1, 2) @ H[:, self.framed]
        return H

    @property
    def spread(self) -> Array:
        """(R,) logarithm of the determinant of the curvature."""
        of_weight = len(self.belief.free) * np.log(self.belief.weight)
        of_all = np.linalg.slogdet(self.belief.precision)[1] + of_weight
        return np.asarray(2 * np.linalg.slogdet(self.D)[1] + of_all)


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
    bend: Array | None
    """(R, f, f) as in `ManySystem`."""
    held: ManyHeld | None
    """What the prior holds; None without one."""

    @classmethod
    def of(cls, rows: ManyRows, models: ManyModels, belief: ManyBeliefs | None) -> "ManyTangents":
        """At some models."""
        r, A, bend = rows.at(models)
        gradient, cost = (A @ r[:, :, None])[:, :, 0], np.einsum("ri,ri->r", r, r)
        if belief is None:
            return cls(r, A, gradient, cost, bend, None)
        held = belief.at(models)
        pull = held.pull
        gradient = gradient + held.along(pull)
        cost = cost + (pull * held.left).sum(axis=1)
        return cls(r, A, gradient, cost, bend, held)

    @property
    def data(self) -> Array:
        """(R, f, f) A'A."""
        return np.asarray(self.A @ np.swapaxes(self.A, 1, 2))

    def certificate(self, inside: Array) -> Array:
        """(R,) as in `Tangent.certificate`, from squared offsets (R,)."""
        f, n = self.A.shape[1:]
        over = n - f if self.held is None else n
        outside = np.maximum(self.cost - inside, np.finfo(np.float64).eps * self.cost)
        relative = np.sqrt(np.maximum(inside, 0.0) / f * max(over, 1) / np.maximum(outside, 1e-300))
        return np.where(self.cost < EXACT_FIT**2, np.sqrt(np.maximum(inside, 0.0)), relative)


@dataclass(frozen=True, slots=True, eq=False)
class ManyCurvatures:
    """Normal equations of R robots and their Cholesky factors, of unit diagonals."""

    data: Array
    """(R, f, f) A'A."""
    normal: Array
    """(R, f, f) A'A + D'Lambda0 D."""
    scale: Array
    """(R, f) roots of the diagonal."""
    factor: Array
    """(R, f, f) upper triangles; nan where there is none."""
    bent: Array
    """(R, f, f) the same with what bends the models, by which steps go; `factor` where that has
    none, or is no use."""

    @classmethod
    def of(cls, at: ManyTangents) -> "ManyCurvatures":
        """At some models."""
        data = at.data
        normal = data if at.held is None else data + at.held.curvature
        s = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
        factor = bent = _factors(normal, s)
        if at.bend is not None:
            bent = _factors(normal + at.bend, s)
            bent = np.where(np.isnan(bent[:, :1, :1]), factor, bent)
        return cls(data, normal, s, factor, bent)

    @property
    def pivots(self) -> Array:
        """(R, f) on the diagonals of the factors."""
        return np.diagonal(self.factor, axis1=1, axis2=2)

    @property
    def sound(self) -> Bool:
        """(R,) whether rounding spares their inverses."""
        return np.asarray(self.pivots.min(axis=1) ** 2 > SMALLEST_PIVOT)

    @property
    def spread(self) -> Array:
        """(R,) logarithms of the determinants of the normal equations."""
        return np.asarray(2 * (np.log(self.pivots) + np.log(self.scale)).sum(axis=1))

    def step(self, gradient: Array) -> Array:
        """(R, f) where the gradient (R, f) leads; nan where there is no factor."""
        scaled = gradient / self.scale
        each = zip(self.bent, scaled, strict=True)
        return np.array([dpotrs(one.T, g, lower=1)[0] for one, g in each]) / self.scale

    @property
    def inverses(self) -> Array:
        """(R, f, f) of the normal equations."""
        # LAPACK fills one triangle, here the upper one
        found = np.array([dpotri(one.T, lower=1)[0].T for one in self.factor])
        lower = np.tril_indices(found.shape[1], -1)
        found[:, *lower] = found[:, *lower[::-1]]
        return np.asarray(found / (self.scale[:, :, None] * self.scale[:, None, :]))


def _factors(normal: Array, scale: Array) -> Array:
    """Cholesky factors (R, f, f) of matrices over their scales (R, f), nan where there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.ascontiguousarray(normal / (scale[:, :, None] * scale[:, None, :]))
    for one in found:
        # of a transposed symmetric matrix, which LAPACK overwrites
        flaw = dpotrf(one.T, lower=1, overwrite_a=1)[1] if np.isfinite(one).all() else 1
        if flaw:
            one[:] = np.nan
    return found
