"""Misfit that all rows of one pose share, visits and reflectors alike, beside the noise of each.

Their mean averages the noise but not the misfit. If rows counted as independent, the evidence would
be overconfident and ask for any model that fits the misfit of few poses.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from calib.arrays import Array, Index
from calib.geometry.joint_errors import JointErrors
from calib.identification.evidence.model_equations import ModelEquations, Solved, Sums
from calib.identification.evidence.normal_equations import NormalEquations
from calib.measurement.grouping import first_met
from calib.measurement.observations import Measurements
from calib.shown import Shown

LEAST, MOST = 1e-4, 1e6
"""Limits of the search for the variance of the misfit, in units of that of the noise."""
FINE = 1e-2
"""Tolerance of its logarithm; hundreds of rows determine that to no better than a tenth."""
MOST_TURNS = 20
"""Largest number of iterations for noise and misfit together."""

Asked = tuple[JointErrors, Array, Array]
"""A model, as `NormalEquations.solved` takes it."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedMisfit(Shown):
    """Normal equations of rows of which those of one pose share a misfit.

    With noise s and a misfit of variance s^2 v the r rows of a group have the covariance
    s^2 (1 + v 1 1'): their mean counts for r / (1 + r v) rows, and what they differ by in full.
    The variance is that of most evidence, of each model its own.

    Groups are rows of one kind at one pose, seen from one place: visits of it, and its reflectors,
    which a bent joint moves about alike. Each has the misfit in its own noise. Weights of a robust
    loss are those of the rows in their mean.
    """

    bare: NormalEquations
    """Without any misfit, at the scale of the noise."""
    group: Index
    """(m,) group of each row."""
    share: Array
    """(m,) part of each row in the mean of its group; their squares add up to one."""
    count: Array
    """(g,) rows of each group."""
    equations: Array
    """(g,) of each of these rows."""
    means: tuple[tuple[float, Sums], ...]
    """For each number of rows above one: the number, and the sums over the means."""

    def __repr__(self) -> str:
        return f"SharedMisfit({len(self.group)} rows in {len(self.count)} groups)"

    @classmethod
    def of(cls, bare: NormalEquations, measurements: Measurements) -> "SharedMisfit":
        """Equations with shared misfit, for the rows of a table, which are weighted already."""
        rows = measurements.equations
        seen = (rows, measurements.station, measurements.anchor)
        group = first_met(np.column_stack([measurements.together, *seen]))
        weight = bare.equations / rows
        count = np.bincount(group).astype(np.float64)
        share = np.sqrt(weight / np.bincount(group, weight)[group])
        A, r = _means(bare.A, share, group), _means(bare.r, share, group)
        found = []
        for size in np.unique(count[count > 1]).tolist():
            own = A[count == size].reshape(-1, A.shape[2])
            left = r[count == size].ravel()
            found.append((size, Sums(own.T @ own, own.T @ left, float(left @ left))))
        return cls(bare, group, share, count, np.bincount(group, rows) / count, tuple(found))

    def solved(self, asked: Asked) -> tuple[Solved, float]:
        """Maximum a posteriori of a model with the misfit of most evidence, and its variance."""
        return self.of_model(asked).solved(self.bare.scale)

    def of_model(self, asked: Asked) -> "ModelMisfit":
        """The part of a model, whose columns are taken out once for all variances."""
        model = self.bare.of_model(*asked)
        parts = tuple((size, model.picked(sums)) for size, sums in self.means)
        return ModelMisfit(model, parts, self._spread)

    def _spread(self, v: float) -> float:
        """Half the log determinant of the rows' covariance, in units of the noise."""
        return float(self.equations @ np.log1p((self.count > 1) * self.count * v)) / 2

    def at(self, v: float) -> NormalEquations:
        """The normal equations under a misfit of variance v."""
        bare = self.bare
        if v == 0.0 or not self.means:
            return bare
        normal, pull, square = _under(v, bare.sums, self.means)
        return replace(bare, normal=normal, pull=pull, square=square)

    def rows_at(self, v: float) -> NormalEquations:
        """The same with rows that add up to it, of which those of some poses can be left out."""
        if v == 0.0 or not self.means:
            return self.bare
        less = 1 - 1 / np.sqrt(1 + (self.count > 1) * self.count * v)
        part = (self.share * less[self.group])[:, None]
        A, r = (_means(each, self.share, self.group) for each in (self.bare.A, self.bare.r))
        A, r = self.bare.A - part[:, :, None] * A[self.group], self.bare.r - part * r[self.group]
        return replace(self.at(v), A=A, r=r)

    def at_noise_of(self, asked: Asked, near: float = 0.0) -> tuple["SharedMisfit", float]:
        """The same at the noise, one or more times the stated, that a model and misfits leave.

        With it comes the variance of the model's misfit there. The search for both begins at a
        misfit of variance `near`, such as that of a similar model.
        """
        model, rows = self.of_model(asked), float(self.bare.equations.sum())
        v, scale = near, model.at(near).noise(rows)
        for _ in range(MOST_TURNS):
            last, v = v, model.variance(scale)
            if abs(np.log((v + LEAST) / (last + LEAST))) < 2 * FINE:
                break
            scale = model.at(v).noise(rows)
        return replace(self, bare=replace(self.bare, scale=scale)), v

    def noise_factor(self, v: float) -> float:
        """Noise of rows that would tell as much without a misfit, in units of the stated one."""
        rows = self.count * self.equations
        told = rows / (1 + (self.count > 1) * self.count * v)
        return self.bare.scale * float(np.sqrt(rows.sum() / told.sum()))


@dataclass(frozen=True, slots=True, eq=False)
class ModelMisfit:
    """One model, of which rows of one pose share a misfit."""

    bare: ModelEquations
    """Without any misfit."""
    means: tuple[tuple[float, Sums], ...]
    """The model's part of those of `SharedMisfit`."""
    spread: Callable[[float], float]
    """Half the log determinant of the rows' covariance at a variance of the misfit."""

    def at(self, v: float) -> ModelEquations:
        """The model under a misfit of variance v."""
        if v == 0.0:
            return self.bare
        return replace(self.bare, sums=_under(v, self.bare.sums, self.means))

    def solved(self, scale: float) -> tuple[Solved, float]:
        """Its solution at a scale of the noise, with the misfit of most evidence; its variance."""
        v = self.variance(scale)
        return self.solved_at(v, scale), v

    def solved_at(self, v: float, scale: float) -> Solved:
        """The same with a misfit of a given variance."""
        found = self.at(v).solved(scale)
        return found._replace(evidence=found.evidence - self.spread(v))

    def variance(self, scale: float) -> float:
        """Variance of the misfit with the largest evidence, in units of that of the noise."""
        if not self.means:
            return 0.0

        def less(log: float) -> float:
            return -self.solved_at(float(np.exp(log)), scale).evidence

        ends = np.log([LEAST, MOST])
        found = minimize_scalar(less, bounds=ends, method="bounded", options={"xatol": FINE})
        none = -self.bare.solved(scale).evidence
        return float(np.exp(found.x)) if found.fun < none else 0.0


def _under(v: float, sums: Sums, means: Iterable[tuple[float, Sums]]) -> Sums:
    """Sums over rows under a misfit of variance v, from those of the rows and of their means."""
    for size, of_means in means:
        sums = sums.less(size * v / (1 + size * v), of_means)
    return sums


def _means(values: Array, share: Array, group: Index) -> Array:
    """(g, ...) sum of the shares (m,) of the rows (m, ...) of each group."""
    found = np.zeros((int(group.max()) + 1, *values.shape[1:]))
    np.add.at(found, group, share.reshape(-1, *(1,) * (values.ndim - 1)) * values)
    return found
