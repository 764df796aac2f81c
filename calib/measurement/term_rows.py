"""Equations of a table for models of many joint terms, without multiplying out their columns.

The column of a term is the column of its joint value times one value per pose, which does not
change during a fit. A'A then needs the product of two joint columns once per pose, however many
terms these joints have.
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
"""Number of terms from which on this is faster."""


@dataclass(frozen=True, slots=True, eq=False)
class TermRows:
    """A table, with all that models of the same joint terms have in common at its rows."""

    measurements: Measurements
    """The table."""
    whitening: Array
    """(m, 6, 6) whitening matrices of its rows."""
    basis: Array
    """(m, k) values of all terms."""
    width: int
    """Number p of free numbers."""
    own: Index
    """(e,) indices, among the free numbers, of those that are no terms of a joint."""
    narrow: Index
    """(e,) column of each in the order chain, springs, fixtures, lengths."""
    terms: tuple[tuple[Index, Array], ...]
    """Per joint: indices (k,) of its terms among the free numbers, and their values (m, k)."""

    @classmethod
    def of(
        cls, model: RobotModel, measurements: Measurements, whitening: Array, parameters: Parameters
    ) -> "TermRows | None":
        """Rows for the free numbers of a model; None where plain columns are faster.

        None also for tables with further tools, whose columns replace those of the chain's tool.
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
        """Whitened residual (N,), columns (N, e + n) as in `ByJoint`, and the row (N,) of each."""
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
        """The whole derivative, from columns (N, e + n) of all rows."""
        return ByJoint(self, A, np.arange(6) < self.measurements.equations[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class ByJoint:
    """A derivative A (N, p) by numbers most of which are joint terms, in factored form."""

    table: TermRows
    """The table, with the values of the terms."""
    columns: Array
    """(N, e + n) columns of the numbers that are no terms, then of each joint value."""
    filled: Bool
    """(m, 6) which entries the rows of the table have."""

    @property
    def width(self) -> int:
        """Number p of columns."""
        return self.table.width

    @property
    def dense(self) -> Array:
        """A (N, p), multiplied out."""
        out, e = np.empty((len(self.columns), self.width)), len(self.table.own)
        out[:, self.table.own] = self.columns[:, :e]
        pose = np.nonzero(self.filled)[0]
        for joint, (places, values) in enumerate(self.table.terms):
            out[:, places] = self.columns[:, e + joint, None] * values[pose]
        return out

    def products(self, r: Array) -> tuple[Array, Array]:
        """A'A (p, p) and A'r (p,) for a residual r (N,)."""
        own, terms, e = self.table.own, self.table.terms, len(self.table.own)
        whole = np.zeros((*self.filled.shape, self.columns.shape[1] + 1))
        whole[self.filled] = np.column_stack([self.columns, r])
        flat = whole.reshape(-1, whole.shape[2])[:, [*range(e), -1]]
        of_own = flat[:, :e].T @ flat
        # products of each pair of columns, summed over the rows of each pose
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
