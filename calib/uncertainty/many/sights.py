"""Residuals and derivatives of many identified robots at their tables and targets, as arrays.

All robots have the same numbers, free numbers and counts of poses, but their own values, poses and
priors. One prediction serves for the identified model and for all terms that it lacks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.many import ManyModels
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL
from calib.held_out_counts import fewest_poses
from calib.identification.identify import Identification, Status
from calib.identification.joint_models import gravity_quarters
from calib.identification.many.tables import ManyRows, ManyTables, known_to_many, position_rows
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict_at
from calib.uncertainty.statement.applicability import lacking, unheld_columns
from calib.uncertainty.statement.gain import prior_precision

UP = np.array([0.0, 0.0, 1.0])
"""Upwards in the axes of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class ManyRowsSeen:
    """Predictions of R robots at m poses each."""

    q: Array
    """(R, m, n) joint values [rad, m]."""
    residual: Array
    """(R, m, r) measured minus predicted [m, rad]; r is 6, or 3 for targets."""
    rows: Array
    """(R, m, r, P) derivative of the prediction by the numbers of the model."""
    free: Array
    """(R, m, r, f) its columns by the free numbers."""
    unheld: Array
    """(R, m, r, k + 1) derivative by errors that the model lacks: k joint errors, then a foot that
    yields."""
    covariance: Array
    """(R, m, r, r) covariance of the noise [m, rad]."""
    p: Array
    """(R, m, 3) predicted positions [m]."""
    tool: Array
    """(R, m, 3, 3) axes of the tool at these poses; zero for targets."""

    @classmethod
    def of(cls, parts: Sequence[Array], free: Index) -> "ManyRowsSeen":
        """From all fields but `free`, whose columns are those at places `free` (f,)."""
        q, residual, rows, *others = parts
        every = len(free) == rows.shape[3]
        return cls(q, residual, rows, rows if every else rows[..., free], *others)


@dataclass(frozen=True, slots=True, eq=False)
class ManySights:
    """R identifications of one structure, with their predictions."""

    fits: Sequence[Identification]
    free: Index
    """(f,) places of the free numbers."""
    scale: Array
    """(f,) their column scale [m or rad]."""
    covariance: Array
    """(R, f, f) covariance of the estimates [m, rad]."""
    precision: Array
    """(R, f, f) Lambda0 in scaled columns; zero without a prior."""
    train: ManyRowsSeen
    """Training rows."""
    test: ManyRowsSeen
    """Held-out rows."""
    there: ManyRowsSeen
    """Targets, with zero residuals and noise."""

    def __len__(self) -> int:
        return len(self.fits)


def sights(
    fits: Sequence[Identification],
    trains: Sequence[Measurements],
    tests: Sequence[Measurements],
    targets: Sequence[Array],
) -> ManySights:
    """Predictions of robots of one structure at their tables and at targets (t, n) [rad, m]."""
    first = fits[0]
    wide = lacking(first.model)
    # the loads of springs that the model lacks depend on the geometry of each robot
    own = wide.joint_errors.springs is first.model.joint_errors.springs
    if own and known_to_many(wide, (table.conditions for table in (*trains, *tests))):
        models = ManyModels.each(first.model, [fit.model for fit in fits]).widened(wide)
        parts = _of_all(models, np.isin(wide.names, first.model.names), trains, tests, targets)
    else:
        each = [
            _of_one(fit.model, train, test, q)
            for fit, train, test, q in zip(fits, trains, tests, targets, strict=True)
        ]
        parts = [
            [np.stack(part) for part in zip(*of_each, strict=True)]
            for of_each in zip(*each, strict=True)
        ]
    free = first.parameters.free_index
    return ManySights(
        fits, free, first.parameters.free_scale,
        np.stack([fit.covariance for fit in fits]),
        np.stack([prior_precision(fit) for fit in fits]),
        *(ManyRowsSeen.of(part, free) for part in parts),
    )  # fmt: skip


def _of_all(
    models: ManyModels,
    held: Bool,
    trains: Sequence[Measurements],
    tests: Sequence[Measurements],
    targets: Sequence[Array],
) -> list[Sequence[Array]]:
    """Fields of the three tables of robots, in a few passes over arrays.

    `held` (P,) marks the numbers that the identified models have; the others are lacking.
    """
    R, every = len(models), np.arange(models.like.n_numbers)

    def fields(
        q: Array, frames: tuple[Array, Array], J: Array, residual: Array, covariance: Array
    ) -> Sequence[Array]:
        tool, p = frames[0].transpose(2, 3, 1, 0), np.moveaxis(frames[1], 0, 2)
        rows = J.transpose(0, 3, 2, 1)
        arm = (p - models.base[:, None, :, 3]) @ models.base[:, :, :3]
        foot = rows[..., 3:6] @ np.cross(arm, UP)[..., None]
        beyond = np.concatenate([rows[..., ~held], foot], axis=3)
        own = np.ascontiguousarray(rows[..., held])
        return q, residual, own, beyond, covariance, p, tool

    found = []
    for tables in (trains, tests):
        q, position, rotation, covariance = (
            np.array([getattr(table, name) for table in tables])
            for name in ("q", "position", "rotation", "covariance")
        )
        plain = np.broadcast_to(np.eye(6), (1, *covariance.shape[1:]))
        seen = ManyTables.read(q, position, rotation, plain)
        rows = ManyRows.of(models.like, seen, every, "whitened")
        frames = models.frames(models.stands(q, rows.values).links)
        r, J = (part.reshape(*part.shape[:-1], 6, -1) for part in rows.at(models)[:2])
        found.append(fields(q, frames, J, r.swapaxes(1, 2), covariance))
    q = np.array(targets)
    point, J = position_rows(models, q, every)
    m, nowhere = q.shape[1], np.zeros((3, 3, R, q.shape[1]))
    at = nowhere, np.moveaxis(point, 1, 0)
    return [*found, fields(q, at, J, np.zeros((R, m, 3)), np.zeros((R, m, 3, 3)))]


def _of_one(
    model: RobotModel, train: Measurements, test: Measurements, targets: Array
) -> list[tuple[Array, ...]]:
    """Fields of the three tables of one robot."""
    wide = lacking(model)
    held = np.isin(wide.names, model.names)
    own, more = np.flatnonzero(held), np.flatnonzero(~held)
    rows = ((train.q, train.conditions), (test.q, test.conditions), (targets, AS_USUAL))
    parts = [wide.poses_and_jacobian(q, at) for q, at in rows]
    found: list[tuple[Array, ...]] = []
    tables = (train, test, None)
    for table, (q, _), (T, J) in zip(tables, rows, parts, strict=True):
        residual, covariance = np.zeros((len(q), 6)), np.zeros((len(q), 6, 6))
        if table is not None:
            seen = predict_at(T, J, wide.fixtures, wide.first_fixture, table)
            residual, J, covariance = seen.residual, seen.rows, table.covariance
        p, R = T[:, :3, 3], T[:, :3, :3]
        beyond = unheld_columns(wide, more, UP, p, J)
        found.append((q, residual, J[:, :, own], beyond, covariance, p, R))
    return found


def alike(
    fit: Identification, train: Measurements, test: Measurements, probability: float
) -> tuple[object, ...] | None:
    """Key that is equal for robots that can be judged together; None for one judged alone."""
    tables = (train, test)
    plain = (
        fit.status is Status.CONVERGED
        and fit.mode == "whitened"
        and fit.loss == "squared"
        and not fit.model.fixtures.n_numbers
        and len(test) >= fewest_poses(probability)
        and all(map(_plain, tables))
    )
    if not plain:
        return None
    free: Bool = fit.parameters.free
    believed = None if fit.prior is None else fit.prior.names
    poses = train.pose_id.tobytes(), test.pose_id.tobytes()
    springs = fit.model.joint_errors.springs
    # what decides which terms `lacking` adds
    quarters = gravity_quarters(replace(fit.model.chain, T_flange_tool=np.eye(4)))
    kind = springs and springs.kind
    # springs that `lacking` adds are those that gravity loads, which depends on the mounting
    lacked = lacking(fit.model).names if quarters is None and springs is None else ()
    return fit.model.names, free.tobytes(), believed, poses, quarters, kind, lacked


def _plain(table: Measurements) -> bool:
    """Whether a table has only full poses of the chain's tool from one station, each once."""
    return bool(
        table.is_pose.all()
        and not table.station.any()
        and not table.tool.any()
        and table.n_poses == len(table) > 0
    )
