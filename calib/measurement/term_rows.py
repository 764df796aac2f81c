"""Rows of a table for models of many joint terms: columns of terms are never multiplied out.

The column of a term is that of its joint's own move times one value a pose, which no fit changes.
Six rows of a pose then meet once for each pair of joints, whatever terms these have.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.joint_errors import NO_JOINT
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict_at

MANY = 64
"""Terms from which on it pays."""


@dataclass(frozen=True, slots=True, eq=False)
class TermRows:
    """A table, and what all models of the same terms share at it."""

    measurements: Measurements
    whitening: Array
    """(m, 6, 6)"""
    basis: Array
    """(m, k) values of all terms."""
    width: int
    """Free numbers p."""
    own: Index
    """(e,) places among them of those that are no terms of a joint."""
    narrow: Index
    """(e,) column of each: chain, springs, fixtures, lengths in turn."""
    terms: tuple[tuple[Index, Array], ...]
    """Of each joint: places (k,) of its terms among the free numbers, and their values (m, k)."""

    @classmethod
    def of(
        cls, model: RobotModel, measurements: Measurements, whitening: Array, parameters: Parameters
    ) -> "TermRows | None":
        """Those of a model's free numbers; None where columns as they are cost less.

        Further tools have columns of their own in place of those of the flange: not here.
        """
        joints, first = np.array(model.joint_errors.joints), model.chain.n_numbers
        if len(joints) < MANY or measurements.tool.any():
            return None
        number, k = parameters.free_index, len(joints)
        kind = np.full(model.n_numbers, NO_JOINT)
        kind[first : first + k] = joints
        column = np.arange(model.n_numbers)
        column[first + k :] -= k
        column[first + np.array(model.joint_errors.of_lengths, dtype=np.int64)] = (
            model.n_numbers - k + np.arange(len(model.joint_errors.of_lengths))
        )
        own = np.flatnonzero(kind[number] == NO_JOINT)
        basis = model.joint_errors.basis(measurements.q, measurements.conditions)
        places = (np.flatnonzero(kind[number] == j) for j in range(model.chain.n_joints))
        terms = tuple((at, np.ascontiguousarray(basis[:, number[at] - first])) for at in places)
        return cls(measurements, whitening, basis, len(number), own, column[number[own]], terms)

    def at(self, model: RobotModel) -> tuple[Array, Array, Index]:
        """Whitened residual (N,), columns (N, e + n) as in `ByJoint`, and whose rows these are."""
        table, errors = self.measurements, model.joint_errors
        apart = model.columns_apart(table.q, table.conditions, self.basis)
        first = apart.chain.shape[2] + apart.springs.shape[2]
        fixtures = np.zeros((len(table), 6, model.fixtures.n_numbers))
        lengths = apart.along[:, :, None] * self.basis[:, None, errors.of_lengths]
        columns = [apart.chain, apart.springs, fixtures, lengths, apart.turns]
        seen = predict_at(apart.T, np.concatenate(columns, 2), model.fixtures, first, table)
        used = [*self.narrow, *range(-model.chain.n_joints, 0)]
        A = (self.whitening @ seen.rows[:, :, used])[seen.filled]
        r = (self.whitening @ seen.residual[:, :, None])[:, :, 0][seen.filled]
        return r, A, np.nonzero(seen.filled)[0]

    def by_joint(self, A: Array) -> "ByJoint":
        """The whole derivative, of columns (N, e + n) of all its rows."""
        return ByJoint(self, A, np.arange(6) < self.measurements.equations[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class ByJoint:
    """A derivative (N, p) by numbers of which most are terms of joints."""

    table: TermRows
    columns: Array
    """(N, e + n) of the numbers that are no terms, then of each joint's own move."""
    filled: Bool
    """(m, 6) which entries the rows are."""

    @property
    def width(self) -> int:
        """Numbers p."""
        return self.table.width

    @property
    def dense(self) -> Array:
        """(N, p)."""
        out, e = np.empty((len(self.columns), self.width)), len(self.table.own)
        out[:, self.table.own] = self.columns[:, :e]
        pose = np.nonzero(self.filled)[0]
        for joint, (places, values) in enumerate(self.table.terms):
            out[:, places] = self.columns[:, e + joint, None] * values[pose]
        return out

    def products(self, r: Array) -> tuple[Array, Array]:
        """A'A (p, p) and A'r (p,), r (N,)."""
        own, terms, e = self.table.own, self.table.terms, len(self.table.own)
        whole = np.zeros((*self.filled.shape, self.columns.shape[1] + 1))
        whole[self.filled] = np.column_stack([self.columns, r])
        flat = whole.reshape(-1, whole.shape[2])[:, [*range(e), -1]]
        of_own = flat[:, :e].T @ flat
        # what the rows of each pose say of each pair of columns
        met = np.swapaxes(whole[:, :, e:-1], 1, 2) @ whole
        normal, pull = np.empty((self.width,) * 2), np.empty(self.width)
        normal[np.ix_(own, own)], pull[own] = of_own[:, :e], of_own[:, e]
        for i, (places, values) in enumerate(terms):
            beside = values.T @ met[:, i][:, [*range(e), -1]]
            normal[np.ix_(places, own)], pull[places] = beside[:, :e], beside[:, e]
            normal[np.ix_(own, places)] = beside[:, :e].T
            for j, (others, theirs) in enumerate(terms[: i + 1]):
                block = values.T @ (met[:, i, e + j, None] * theirs)
                normal[np.ix_(places, others)] = block
                normal[np.ix_(others, places)] = block.T
        return normal, pull
