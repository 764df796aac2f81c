"""Tables of many robots at the same number of poses, and the system that each makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.identification.result import Mode
from calib.kernels.robots_plain import residual, system
from calib.measurement.noise import whiteners
from calib.measurement.observations import POSE, Measurements
from calib.shown import Shown

PAPER = np.sqrt([1e6, 1e6, 1e6, 2.0, 2.0, 2.0])
"""Root weights of position [1/m] and of half the sum of axis x axis seen [1], by which six rows
have the normal equations of the paper's twelve; see `covariance.matrix_row_weights`."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyTables(Shown):
    """What was measured of R robots at m full poses each, from one station."""

    q: Array
    """(R or 1, m, n) commanded joints; 1 where all visited the same [rad, m]."""
    seen: Array
    """(12, R, m) position measured [m], then the rotation row by row."""
    covariance: Array
    """(R or 1, m, 6, 6) stated with the readings [m^2, m rad, rad^2]."""

    def __len__(self) -> int:
        return int(self.seen.shape[1])

    def __repr__(self) -> str:
        return f"ManyTables({len(self)} tables of {self.seen.shape[2]} poses)"

    @classmethod
    def read(cls, q: Array, position: Array, rotation: Array, covariance: Array) -> "ManyTables":
        """Of positions (R, m, 3) and rotations (R, m, 3, 3) measured [m]."""
        both = np.concatenate([position, rotation.reshape(*position.shape[:2], 9)], axis=2)
        return cls(q, np.ascontiguousarray(np.moveaxis(both, 2, 0)), covariance)

    @classmethod
    def of(cls, tables: Sequence[Measurements]) -> "ManyTables":
        """Of tables of full poses from one station, all of the same length; see `alike`."""
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
        """The same; None where there are none, or of other rows or lengths."""
        if len({len(table) for table in tables}) != 1:
            return None
        plain = all(
            table.is_pose.all() and not (table.station.any() or table.tool.any())
            for table in tables
        )
        return cls.of(tables) if plain else None

    @property
    def position(self) -> Array:
        """(R, m, 3) positions measured [m]."""
        return np.moveaxis(self.seen[:3], 0, 2)

    def one(self, k: int) -> Measurements:
        """The table of robot k; its poses are numbered in order."""
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


def known_to_many(model: RobotModel) -> bool:
    """Whether a model is chain and joint terms alone: no springs, fixtures or lengths that grow."""
    errors = model.joint_errors
    waves = all(term.is_wave for term in errors.terms)
    return errors.springs is None and not model.fixtures.n_numbers and waves


@dataclass(frozen=True, slots=True, eq=False)
class ManyRows:
    """Which rows and columns a system has: what depends on no model, made once."""

    like: RobotModel
    free: Index
    """(f,) columns of J: places in the full vector."""
    place: Index
    """(P,) from `row_places`."""
    tables: ManyTables
    basis: Array
    """(K, R or 1, m) values of the joint terms."""
    whitening: Array
    """(6, 6, R or 1, m) lower triangles."""
    used: Bool
    """(6, 6) which of their entries are not zero everywhere."""
    mode: Mode

    @classmethod
    def of(cls, model: RobotModel, tables: ManyTables, free: Index, mode: Mode) -> "ManyRows":
        """Of the numbers at places `free` of models like one."""
        place = row_places(model, free)
        if mode == "paper":
            N = np.diag(PAPER)[:, :, None, None] * np.ones(tables.seen.shape[2])
        else:
            covariance = tables.covariance
            flat = whiteners(covariance.reshape(-1, 6, 6)).reshape(covariance.shape)
            N = np.ascontiguousarray(flat.transpose(2, 3, 0, 1))
        basis = ManyModels.of(model, 1).basis(tables.q)
        used = np.abs(N).max(axis=(2, 3)) > 0
        return cls(model, free, place, tables, basis, N, used, mode)

    def some(self, which: slice | Index) -> "ManyRows":
        """The rows of some robots."""
        return replace(
            self,
            tables=self.tables.some(which),
            basis=_some(self.basis, which),
            whitening=_some(self.whitening, which),
        )

    def seeing(self, models: ManyModels) -> "ManyRows":
        """The rows of tables that see what models predict."""
        axes, origin = models.frames(models.reached(self.tables.q, self.basis))
        rotation = axes.swapaxes(0, 1).reshape(9, *origin.shape[1:])
        seen = np.ascontiguousarray(np.concatenate([origin, rotation]))
        return replace(self, tables=replace(self.tables, seen=seen))

    def at(self, models: ManyModels) -> tuple[Array, Array]:
        """Residual (R, 6 m) and derivative (R, f, 6 m) at the models, whitened; rows by pose last.

        In paper mode they have the normal equations of the twelve rows, but another sum of squares:
        `twelve_rows`.
        """
        R, m, f = len(models), self.tables.seen.shape[2], len(self.free)
        hidden = self.place.max() + 1 - f
        J, r = np.empty((R, hidden + f, 6, m)), np.empty((6, R, m))
        _fill(models, self.tables.q, self.basis, self.place, J, r, rows=self)
        return _by_robot(r), J[:, hidden:].reshape(R, f, 6 * m)

    def residual_at(self, models: ManyModels) -> Array:
        """The residual (R, 6 m) alone."""
        axes, origin = models.frames(models.reached(self.tables.q, self.basis))
        seen, logarithm = self.tables.seen, self.mode == "whitened"
        return _by_robot(residual(axes, origin, seen, self.whitening, self.used, logarithm)[2])


def _by_robot(rows: Array) -> Array:
    """Rows (6, R, m) as (R, 6 m)."""
    return np.ascontiguousarray(rows.swapaxes(0, 1)).reshape(rows.shape[1], -1)


def _some(array: Array, which: slice | Index) -> Array:
    """Of some robots, where an array (..., R or 1, m) is not of all."""
    return array if array.shape[-2] == 1 else array[..., which, :]


def row_places(model: RobotModel, free: Index) -> Index:
    """Row (P,) of a system that each number has, -1 for none.

    Rows of free numbers come last and in order; before them those that only others need: the own
    columns of joints that are held but have free terms.
    """
    chain, joints = model.chain, np.array(model.joint_errors.joints, dtype=np.int64)
    wanted = np.zeros(model.n_numbers, dtype=bool)
    wanted[free] = True
    moved = joints[wanted[chain.n_numbers :][: len(joints)]]
    hidden = {*(6 + 5 * moved + chain.prismatic[moved].astype(int)).tolist()} - {*free.tolist()}
    place = np.full(model.n_numbers, -1)
    place[[*sorted(hidden), *free]] = np.arange(len(hidden) + len(free))
    return place


def _fill(
    models: ManyModels, q: Array, basis: Array, place: Index, J: Array, r: Array,
    rows: ManyRows | None = None, target: Array | None = None,
) -> Array:  # fmt: skip
    """Fill J (R, f, 6 or 3, m), and with `rows` r (6, R, m); predicted points (3, R, m) [m]."""
    like, point = models.like, np.empty((3, len(models), q.shape[1]))
    seen: Array = np.zeros((12, 1, 0))
    whitening: Array = np.zeros((6, 6, 1, 0))
    used: Bool = np.zeros((6, 6), dtype=np.bool_)
    if rows is not None:
        seen, whitening, used = rows.tables.seen, rows.whitening, rows.used
    system(
        models.links, models.base, models.tool, *models.turns(models.reached(q, basis)), basis,
        np.array(like.joint_errors.joints, dtype=np.int64), like.chain.prismatic == 0, place,
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
    place, R, m = row_places(models.like, free), len(models), q.shape[1]
    hidden = place.max() + 1 - len(free)
    J = np.empty((R, hidden + len(free), 3, m))
    point = _fill(models, q, models.basis(q), place, J, np.empty((6, R, 0)), target=target)
    return point.swapaxes(0, 1), J[:, hidden:]


def twelve_rows(models: ManyModels, tables: ManyTables) -> Array:
    """Sum of squares (R,) of the paper's twelve rows, 1 and mm.

    References
    ----------
    Wen et al. 2022, eqs. (3)-(5).
    """
    axes, origin = models.frames(models.reached(tables.q))
    there = tables.seen[3:].reshape(3, 3, *origin.shape[1:]).swapaxes(0, 1)
    turned, shifted = there - axes, 1e3 * (tables.seen[:3] - origin)
    return np.asarray((turned**2).sum(axis=(0, 1, 3)) + (shifted**2).sum(axis=(0, 2)))
