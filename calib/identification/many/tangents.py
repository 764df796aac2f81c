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
from calib.information.rank import KEEP_TOLERANCE

SMALLEST_PIVOT = KEEP_TOLERANCE**2
"""Smallest squared part of a column orthogonal to those before it, relative to the column; a robot
with less is left to `identify`, which factors rows instead of normal equations."""


def times(vectors: Array, matrices: Array) -> Array:
    """Products (R, f) of vectors (R, n) with one matrix (n, f), or with one each (R, n, f).

    One product per vector: in a product of matrices, rounding would depend on the number of rows.
    """
    return np.asarray((vectors[:, None] @ matrices)[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class ManyBeliefs:
    """Prior of all free numbers, the same for all robots but for a weight."""

    mean: Array
    """(f,) prior mean, as a step from the nominal model [m, rad]."""
    precision: Array
    """(f, f) Lambda0, the precision at weight one."""
    weight: Array
    """(R or 1,) factor on the precision for each robot."""
    free: Index
    """(f,) places of the free numbers in the full vector."""

    @classmethod
    def of(cls, prior: Prior, parameters: Parameters, weight: Array | None = None) -> "ManyBeliefs":
        """Prior of all free numbers, in their order; `weight` (R,) is one if left out."""
        order = [prior.names.index(name) for name in parameters.free_names]
        precision, own = prior.precision[np.ix_(order, order)], np.ones(1)
        weight = own if weight is None else weight
        return cls(prior.mean[order], precision, weight, parameters.free_index)

    def some(self, which: slice | Index) -> "ManyBeliefs":
        """The prior of some robots."""
        return self if len(self.weight) == 1 else replace(self, weight=self.weight[which])

    def at(self, models: ManyModels) -> "ManyHeld":
        """Residual and derivative of the prior at some models.

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
        # in one memory order, so that sums do not depend on the number of robots
        left = np.ascontiguousarray(self.mean - step[:, self.free])
        D = np.ascontiguousarray(turned[:, own[:, None], own])
        return ManyHeld(left, D, np.searchsorted(self.free, frames[own]), self)


class ManyHeld(NamedTuple):
    """Residual of the prior, and its derivative, at R models."""

    left: Array
    """(R, f) prior mean minus the step so far [m, rad]."""
    D: Array
    """(R, k, k) derivative of the step so far of base and tool by a small further step."""
    framed: Index
    """(k,) places of their numbers among the free ones; steps of all other numbers simply add."""
    belief: ManyBeliefs

    @property
    def pull(self) -> Array:
        """(R, f) Lambda0 (mean - x), times the weight of each robot."""
        return times(self.left, self.belief.precision) * self.belief.weight[:, None]

    def along(self, pull: Array) -> Array:
        """D'pull (R, f): the force of the prior on a small further step."""
        out = pull.copy()
        out[:, self.framed] = (pull[:, None, self.framed] @ self.D)[:, 0]
        return out

    @property
    def curvature(self) -> Array:
        """(R, f, f) D'Lambda0 D, the prior's part of the normal equations."""
        weight = self.belief.weight[:, None, None]
        H = np.broadcast_to(self.belief.precision, (len(self.D), *self.belief.precision.shape))
        H = H * weight
        H[:, :, self.framed] = H[:, :, self.framed] @ self.D
        H[:, self.framed] = np.swapaxes(self.D, 1, 2) @ H[:, self.framed]
        return H

    @property
    def spread(self) -> Array:
        """(R,) log determinant of `curvature`."""
        of_weight = len(self.belief.free) * np.log(self.belief.weight)
        of_all = np.linalg.slogdet(self.belief.precision)[1] + of_weight
        return np.asarray(2 * np.linalg.slogdet(self.D)[1] + of_all)


@dataclass(frozen=True, slots=True, eq=False)
class ManyTangents:
    """Residuals and columns of R robots at their models, with the prior's part of both."""

    r: Array
    """(R, N) whitened measured minus predicted."""
    A: Array
    """(R, f, N) whitened columns."""
    gradient: Array
    """(R, f) A'r + D'Lambda0 (mean - x), minus half the gradient of the sum of squares."""
    cost: Array
    """(R,) sum of squares r'r, with that of the prior."""
    bend: Array | None
    """(R, f, f) as in `ManySystem`."""
    held: ManyHeld | None
    """The prior at these models; None without one."""

    @classmethod
    def of(cls, rows: ManyRows, models: ManyModels, belief: ManyBeliefs | None) -> "ManyTangents":
        """Tangent planes at some models."""
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
        """(R,) relative offsets as in `Tangent.certificate`, from |Q1'r|^2 (R,)."""
        f, n = self.A.shape[1:]
        over = n - f if self.held is None else n
        outside = np.maximum(self.cost - inside, np.finfo(np.float64).eps * self.cost)
        relative = np.sqrt(np.maximum(inside, 0.0) / f * max(over, 1) / np.maximum(outside, 1e-300))
        return np.where(self.cost < EXACT_FIT**2, np.sqrt(np.maximum(inside, 0.0)), relative)


@dataclass(frozen=True, slots=True, eq=False)
class ManyCurvatures:
    """Normal equations of R robots, and their Cholesky factors after scaling to a unit diagonal."""

    data: Array
    """(R, f, f) A'A."""
    normal: Array
    """(R, f, f) A'A + D'Lambda0 D."""
    scale: Array
    """(R, f) square roots of the diagonal of `normal`."""
    factor: Array
    """(R, f, f) upper Cholesky factors; nan if there is none."""
    bent: Array
    """(R, f, f) the same of `normal` plus second derivatives, used for steps; equal to `factor` if
    there are none, or if the sum is not positive definite."""

    @classmethod
    def of(cls, at: ManyTangents) -> "ManyCurvatures":
        """Normal equations of tangent planes."""
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
        """(R, f) diagonals of the Cholesky factors."""
        return np.diagonal(self.factor, axis1=1, axis2=2)

    @property
    def sound(self) -> Bool:
        """(R,) whether the pivots are large enough for an accurate inverse."""
        return np.asarray(self.pivots.min(axis=1) ** 2 > SMALLEST_PIVOT)

    @property
    def spread(self) -> Array:
        """(R,) log determinants of the normal equations."""
        return np.asarray(2 * (np.log(self.pivots) + np.log(self.scale)).sum(axis=1))

    def step(self, gradient: Array) -> Array:
        """Newton steps (R, f) for the gradient (R, f); nan if there is no factor."""
        scaled = gradient / self.scale
        each = zip(self.bent, scaled, strict=True)
        return np.array([dpotrs(one.T, g, lower=1)[0] for one, g in each]) / self.scale

    @property
    def inverses(self) -> Array:
        """(R, f, f) inverses of the normal equations."""
        # LAPACK fills one triangle, here the upper one
        found = np.array([dpotri(one.T, lower=1)[0].T for one in self.factor])
        lower = np.tril_indices(found.shape[1], -1)
        found[:, *lower] = found[:, *lower[::-1]]
        return np.asarray(found / (self.scale[:, :, None] * self.scale[:, None, :]))


def _factors(normal: Array, scale: Array) -> Array:
    """Cholesky factors (R, f, f) of matrices scaled by `scale` (R, f); nan if there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.ascontiguousarray(normal / (scale[:, :, None] * scale[:, None, :]))
    for one in found:
        # of a transposed symmetric matrix, which LAPACK overwrites
        flaw = dpotrf(one.T, lower=1, overwrite_a=1)[1] if np.isfinite(one).all() else 1
        if flaw:
            one[:] = np.nan
    return found
