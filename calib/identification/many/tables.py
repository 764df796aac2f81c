"""Tables of many robots at the same number of poses, and the linearized equations of each."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.many import JointValues, ManyModels, ManyStands
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.identification.many.columns import ColumnPlaces
from calib.identification.result import Mode
from calib.kernels.robots_plain import residual, system
from calib.measurement.noise import whiteners
from calib.measurement.observations import POSE, Measurements
from calib.shown import Shown

PAPER = np.sqrt([1e6, 1e6, 1e6, 2.0, 2.0, 2.0])
"""Square roots of the weights of position [1/m] and of half the sum of axis x measured axis [1],
with which six rows have the normal equations of the paper's twelve; see
`covariance.matrix_row_weights`."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyTables(Shown):
    """Measurements of R robots at m full poses each, from one station.

    Operating conditions of the rows are not kept.
    """

    q: Array
    """(R or 1, m, n) commanded joint values; 1 if all robots have the same [rad, m]."""
    seen: Array
    """(12, R, m) position measured [m], then the rotation row by row."""
    covariance: Array
    """(R or 1, m, 6, 6) stated covariance of the readings [m^2, m rad, rad^2]."""

    def __len__(self) -> int:
        return int(self.seen.shape[1])

    def __repr__(self) -> str:
        return f"ManyTables({len(self)} tables of {self.seen.shape[2]} poses)"

    @classmethod
    def read(cls, q: Array, position: Array, rotation: Array, covariance: Array) -> "ManyTables":
        """Tables of measured positions (R, m, 3) [m] and rotations (R, m, 3, 3)."""
        both = np.concatenate([position, rotation.reshape(*position.shape[:2], 9)], axis=2)
        return cls(q, np.ascontiguousarray(np.moveaxis(both, 2, 0)), covariance)

    @classmethod
    def of(cls, tables: Sequence[Measurements]) -> "ManyTables":
        """Tables of full poses from one station, all of the same length; see `alike`."""
        q, covariance = (
            np.array([getattr(table, name) for table in tables]) for name in ("q", "covariance")
        )
        if (q == q[0]).all() and (covariance == covariance[0]).all():
            q, covariance = q[:1], covariance[:1]
        return cls.read(
            q,
            np.array([table.position for table in tables]),
            np.array([table.rotation for table in tables]),
            covariance,
        )

    @classmethod
    def alike(cls, tables: Sequence[Measurements]) -> "ManyTables | None":
        """Tables as in `of`; None for no tables, different lengths, or rows of other kinds."""
        if len({len(table) for table in tables}) != 1:
            return None
        plain = all(
            table.is_pose.all() and not (table.station.any() or table.tool.any())
            for table in tables
        )
        return cls.of(tables) if plain else None

    def one(self, k: int) -> Measurements:
        """Table of robot k, with its poses numbered in order."""
        m = self.seen.shape[2]
        q, covariance = (part[0 if len(part) == 1 else k] for part in (self.q, self.covariance))
        rotation = self.seen[3:, k].T.reshape(m, 3, 3)
        return Measurements(
            q, self.seen[:3, k].T, rotation, covariance, np.full(m, POSE), np.zeros((m, 3)),
            np.arange(m), np.zeros(m, dtype=np.int64),
        )  # fmt: skip

    def some(self, which: slice | Index) -> "ManyTables":
        """The tables of some robots."""
        return replace(
            self,
            q=self.q if len(self.q) == 1 else self.q[which],
            covariance=self.covariance if len(self.covariance) == 1 else self.covariance[which],
            seen=self.seen[:, which],
        )


def known_to_many(model: RobotModel, beside: Iterable[OperatingConditions] | None = None) -> bool:
    """Whether arrays can express a model: a chain, waves of its joints, and springs of one pass.

    Fixtures and terms of operating conditions are not supported. With springs, the conditions
    `beside` of all tables are needed, and none may state a payload, which would load the springs.
    """
    errors = model.joint_errors
    if model.fixtures.n_numbers or not all(term.is_wave for term in errors.terms):
        return False
    if errors.springs is None:
        return True
    plain = errors.springs.passes == 1 and len(errors.springs.load) > 0
    return plain and beside is not None and not any(errors.follow(at) for at in beside)


class ManySystem(NamedTuple):
    """Whitened equations of R robots at m poses each; of the 6 m rows, poses vary fastest."""

    r: Array
    """(R, 6 m) measured minus predicted."""
    A: Array
    """(R, f, 6 m) derivative of the prediction."""
    bend: Array | None
    """(R, f, f) minus the residuals times the second derivatives by springs and their moments and
    tilts; None for models without these."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyRows:
    """Parts of the equations that depend on no model: rows, columns and whitening."""

    like: RobotModel
    free: Index
    """(f,) columns of J: places in the full vector."""
    places: ColumnPlaces
    tables: ManyTables
    values: JointValues
    whitening: Array
    """(6, 6, R or 1, m) whitening matrices, lower triangular."""
    used: Bool
    """(6, 6) which of their entries are nonzero anywhere."""
    mode: Mode

    @classmethod
    def of(cls, model: RobotModel, tables: ManyTables, free: Index, mode: Mode) -> "ManyRows":
        """Rows for models like `model`, with columns for the numbers at places `free` (f,)."""
        places = ColumnPlaces.of(model, free)
        if mode == "paper":
            N = np.diag(PAPER)[:, :, None, None] * np.ones(tables.seen.shape[2])
        else:
            covariance = tables.covariance
            flat = whiteners(covariance.reshape(-1, 6, 6)).reshape(covariance.shape)
            N = np.ascontiguousarray(flat.transpose(2, 3, 0, 1))
        values = ManyModels.of(model, 1).values(tables.q)
        used = np.abs(N).max(axis=(2, 3)) > 0
        return cls(model, free, places, tables, values, N, used, mode)

    def some(self, which: slice | Index) -> "ManyRows":
        """The rows of some robots."""
        N = self.whitening
        return replace(
            self,
            tables=self.tables.some(which),
            values=self.values.some(which),
            whitening=N if N.shape[2] == 1 else N[:, :, which],
        )

    def seeing(self, models: ManyModels) -> "ManyRows":
        """The same rows with readings equal to what the models predict."""
        axes, origin = models.frames(models.stands(self.tables.q, self.values).links)
        rotation = axes.swapaxes(0, 1).reshape(9, *origin.shape[1:])
        seen = np.ascontiguousarray(np.concatenate([origin, rotation]))
        return replace(self, tables=replace(self.tables, seen=seen))

    def at(self, models: ManyModels) -> ManySystem:
        """The equations linearized at some models.

        In paper mode they have the normal equations of the twelve rows, but not their sum of
        squares; see `twelve_rows`.
        """
        R, m, f = len(models), self.tables.seen.shape[2], len(self.free)
        J, r = np.empty((R, self.places.hidden + f, 6, m)), np.empty((6, R, m))
        stands = models.stands(self.tables.q, self.values)
        _fill(models, stands, self.places, J, r, rows=self)
        bend = None if stands.loads is None else self.places.bend(stands.loads, J, r)
        return ManySystem(_by_robot(r), J[:, self.places.hidden :].reshape(R, f, 6 * m), bend)

    def residual_at(self, models: ManyModels) -> Array:
        """The residual (R, 6 m) at some models, without derivatives."""
        axes, origin = models.frames(models.stands(self.tables.q, self.values).links)
        seen, logarithm = self.tables.seen, self.mode == "whitened"
        return _by_robot(residual(axes, origin, seen, self.whitening, self.used, logarithm)[2])


def _by_robot(rows: Array) -> Array:
    """Rows (6, R, m) as (R, 6 m)."""
    return np.ascontiguousarray(rows.swapaxes(0, 1)).reshape(rows.shape[1], -1)


def _fill(
    models: ManyModels, stands: ManyStands, places: ColumnPlaces, J: Array, r: Array,
    rows: ManyRows | None = None, target: Array | None = None,
) -> Array:  # fmt: skip
    """Fill J (R, f, 6 or 3, m), and with `rows` r (6, R, m); predicted points (3, R, m) [m]."""
    point = np.empty((3, len(models), J.shape[3]))
    seen: Array = np.zeros((12, 1, 0))
    whitening: Array = np.zeros((6, 6, 1, 0))
    used: Bool = np.zeros((6, 6), dtype=np.bool_)
    if rows is not None:
        seen, whitening, used = rows.tables.seen, rows.whitening, rows.used
    system(
        stands.links, models.base, models.tool, places.screws, places.made(stands),
        np.zeros(3) if target is None else target, seen, whitening, used,
        rows is not None and rows.mode == "whitened", J, r, point,
    )  # fmt: skip
    return point


def position_rows(
    models: ManyModels, q: Array, free: Index, target: Array | None = None
) -> tuple[Array, Array]:
    """Predicted points (R, 3, m) and their derivative (R, f, 3, m) at commanded q (R or 1, m, n).

    `target` (3,) is the point in the tool frame, its origin if left out [m].
    """
    places, R = ColumnPlaces.of(models.like, free), len(models)
    J = np.empty((R, places.hidden + len(free), 3, q.shape[1]))
    point = _fill(models, models.stands(q), places, J, np.empty((6, R, 0)), target=target)
    return point.swapaxes(0, 1), J[:, places.hidden :]


def twelve_rows(models: ManyModels, tables: ManyTables) -> Array:
    """Sum of squares (R,) of the paper's twelve rows, 1 and mm.

    References
    ----------
    Wen et al. 2022, eqs. (3)-(5).
    """
    axes, origin = models.frames(models.stands(tables.q).links)
    there = tables.seen[3:].reshape(3, 3, *origin.shape[1:]).swapaxes(0, 1)
    turned, shifted = there - axes, 1e3 * (tables.seen[:3] - origin)
    return np.asarray((turned**2).sum(axis=(0, 1, 3)) + (shifted**2).sum(axis=(0, 2)))
