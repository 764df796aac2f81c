"""Many identifications at once: exact gradient, frozen Hessian, in compiled batches."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from calib.arrays import Array, Bool, check, frozen, require_numbers, wrong_shape
from calib.errors import refuse
from calib.geometry.frames import points_of_frames
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.rank import RANK_TOLERANCE
from calib.kernels.loops import loops_for
from calib.kinds import checked_kinds
from calib.measurement.observations import GIVEN, Measurements
from calib.measurement.prediction import perfect, targets
from calib.measurement.residual import linearize, padded_covariance, table_whiteners
from calib.shown import Shown
from calib.uncertainty.batch import WIDTH, Batch
from calib.uncertainty.covariance import covariance_factor
from calib.uncertainty.parallel import mapped

BLOCKS = 16
"""Blocks of `WIDTH` replicates in a batch; part of what fixes the bits of a result."""
SETTLED = 0.01
"""Longest last step, in standard deviations, of a replicate that counts as converged."""
LARGEST_TERM = 0.05
"""Largest turn [rad] by a step of the joint terms, for which the compiled loop has a series; a
replicate beyond it does not count as converged."""
RUNAWAY = 1.0
"""A step after the first ones that moves a number so far [m, rad] leads nowhere: none is taken."""
STEPS = 2
"""Steps from the model itself: 1e-8 standard deviations are left after them, or 1e-6 where the
first is known to first order alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Refits(Shown):
    """K fits of one set of numbers to K tables that differ only in what was measured."""

    steps: Array
    """(K, f) estimate minus model, as `RobotModel.step_to` would say [m, rad]."""
    chi_square: Array
    """(K,) whitened sum of squares of the rows, without the prior."""
    last: Array
    """(K,) length of the last step in standard deviations; infinite where a fit ran away."""

    def __repr__(self) -> str:
        return f"Refits({len(self.last)} fits, {int(self.converged.sum())} converged)"

    def first(self, count: int) -> "Refits":
        """The first `count` fits: what fills the last block up is left out."""
        return Refits(self.steps[:count], self.chi_square[:count], self.last[:count])

    @property
    def converged(self) -> Bool:
        """(K,) whether the last step hardly moved."""
        return np.asarray(self.last <= SETTLED)


@dataclass(frozen=True, slots=True, eq=False)
class Frozen:
    """What all replicates share: one model, one plan, and the curvature there."""

    model: RobotModel
    """Where the Hessian is taken, and where every fit starts."""
    parameters: Parameters
    """Free numbers, all of which the rows or the prior can tell."""
    measurements: Measurements
    """The plan: joints, covariances and kinds of rows; measured are the model's own predictions."""
    weight: Array
    """(m, 6, 6) inverse covariances; zero where a row has no entries."""
    factor: Array
    """(m, 6, 6) lower factors of the covariances; zero likewise."""
    precision: Array
    """(f, f) Hessian A'A + Lambda0 at the model."""
    prior: Array
    """(f, f) Lambda0; zero without a prior."""
    covariance: Array
    """(f, f) its inverse, the covariance of each estimate."""

    @property
    def n_rows(self) -> int:
        """Scalar equations of the plan."""
        return self.measurements.n_equations


@checked_kinds
def freeze(
    model: RobotModel,
    measurements: Measurements,
    parameters: Parameters,
    *,
    prior_precision: ArrayLike | None = None,
) -> Frozen:
    """Take the curvature of a fit at a model, for use in `refit` and in budgets.

    Parameters
    ----------
    model : RobotModel
        The identified robot, or any start close to the answers.
    measurements : Measurements
        The plan; its measured values are not used.
    parameters : Parameters
        Free numbers: those that were identified, `Identification.parameters`.
    prior_precision : (f, f) array_like, optional
        Lambda0, inverse covariance of what is known beforehand, positive semidefinite.

    Raises
    ------
    InputError
        Rows that cannot tell all free numbers; a covariance or prior that is not positive.
    """
    f = parameters.n_free
    if unknown_to_loops(model, measurements, parameters) is None:
        own = targets(model.fixtures, measurements)
        measurements = replace(measurements, offset=own, reflector=np.full(len(own), GIVEN))
        T = model.poses(measurements.q, measurements.conditions)
        position = points_of_frames(T, measurements.offset)
        plan = replace(measurements, position=position, rotation=T[:, :3, :3])
    else:
        plan = perfect(model, measurements)
    N = table_whiteners(measurements)
    A = linearize(model, plan, whitening=N).A[:, parameters.free_index]
    prior, rows = np.zeros((f, f)), A
    if prior_precision is not None:
        (prior,) = check(f"{f} {f}", prior_precision=prior_precision)
        rows = np.concatenate([A, covariance_factor(prior).T])
    scale = np.linalg.norm(rows, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    R = np.linalg.qr(rows / scale, mode="r")
    singular = np.linalg.svd(R, compute_uv=False)
    rank = int((singular > RANK_TOLERANCE * singular[0]).sum()) if f else 0
    if rank < f or not f:
        raise refuse(
            "parameters", rank, "at least one free number, all of them identifiable", code="A5",
            message=f"the rows have rank {rank}, with {f} free numbers",
            fix="free only what was identified (Identification.parameters), or give a prior",
        )  # fmt: skip
    root = solve_triangular(R, np.eye(f)) / scale[:, None]
    N, missing = N.copy(), np.arange(6) >= measurements.equations[:, None]
    N[missing] = 0
    factor = np.linalg.cholesky(padded_covariance(measurements))
    factor[missing] = 0
    return Frozen(
        model, parameters, plan, frozen(np.swapaxes(N, -1, -2) @ N), frozen(factor),
        frozen(rows.T @ rows), frozen(prior), frozen(root @ root.T),
    )  # fmt: skip


def unknown_to_loops(
    model: RobotModel, measurements: Measurements, parameters: Parameters
) -> tuple[str, str] | None:
    """Field and words of what the compiled loops of virtual calibrations do not know, if any."""
    free = [name for name in parameters.free_names if name in model.fixtures.names]
    for wrong, field, what in (
        (measurements.is_distance.any(), "kind", "distances"),
        (measurements.station.any(), "station", "rows of further stations"),
        (measurements.tool.any(), "tool", "rows of further tools"),
        (model.joint_errors.springs is not None, "model", "arm that gives way under its weight"),
        (bool(free), "parameters", f"free fixtures ({', '.join(free[:3])})"),
        (bool(model.joint_errors.of_lengths), "model", "lengths that follow the temperature"),
    ):
        if wrong:
            return field, what
    return None


def require_loops(start: Frozen) -> None:
    """Refuse a plan with distances, several stations or free fixtures."""
    found = unknown_to_loops(start.model, start.measurements, start.parameters)
    if found is not None:
        field, what = found
        raise refuse(
            field, code="A3", message=f"virtual calibrations know no {what}",
            allowed="poses and points seen from one station, fixtures held",
            fix="use the covariance of the identification, or hold what was set up",
        )  # fmt: skip


@checked_kinds
def refit(
    start: Frozen,
    position: ArrayLike,
    rotation: ArrayLike,
    *,
    prior_mean: ArrayLike | None = None,
    steps: int = STEPS,
    threads: int = 1,
) -> Refits:
    """Fit the free numbers to each of K tables.

    Parameters
    ----------
    start : Frozen
        From `freeze`; two steps suffice where it is the answer to within the noise, about five
        where it is the nominal robot.
    position : (K, m, 3) array_like
        Positions measured, in the world: tool origin, or reflector for point rows [m].
    rotation : (K, m, 3, 3) array_like
        Rotations measured; anything for point rows.
    prior_mean : (K, f) or (f,) array_like, optional
        Where the prior of each replicate has its center, as a step from the model [m, rad].
    steps : int
        Steps of each fit.
    threads : int
        At work side by side; the result does not depend on it.
    """
    require_loops(start)
    m, f = len(start.measurements), start.parameters.n_free
    position, rotation = check(f"k {m} 3, k {m} 3 3", position=position, rotation=rotation)
    K = len(position)
    if K == 0 or steps < 1:
        field, message = "steps" if K else "position", f"{K} tables and {steps} steps"
        raise refuse(field, allowed="at least one of each", code="A3", message=message)
    center = np.zeros((K, f)) if prior_mean is None else require_numbers("prior_mean", prior_mean)
    if center.shape not in ((f,), (K, f)):
        raise wrong_shape("prior_mean", center.shape, f"({f},) or ({K}, {f})")
    (center,) = check(f"{K} {f}", prior_mean=np.broadcast_to(center, (K, f)))
    size = BLOCKS * WIDTH
    gradient = loops_for(K).gradient

    def work(first: int) -> Refits:
        part = np.arange(first, first + min(size, K - first))
        padded = np.resize(part, -(-len(part) // WIDTH) * WIDTH).reshape(-1, WIDTH)
        measured = np.empty((len(padded), m, 12, WIDTH))
        measured[:, :, :3] = np.moveaxis(position[padded], 1, -1)
        measured[:, :, 3:] = np.moveaxis(rotation.reshape(K, m, 9)[padded], 1, -1)
        whole = descend(start, measured, np.moveaxis(center[padded], 1, -1), steps, gradient)
        return whole.first(len(part))

    return joined(mapped(work, range(0, K, size), threads))


def joined(parts: Sequence[Refits]) -> Refits:
    """Parts of a whole, in order."""
    columns = (np.concatenate([getattr(part, name) for part in parts]) for name in Refits.__slots__)
    return Refits(*map(frozen, columns))


def descend(
    start: Frozen,
    measured: Array,
    center: Array,
    steps: int,
    gradient: Callable[..., None],
    first: Array | None = None,
) -> Refits:
    """Fit the tables of one batch: x += C (J'W r + Lambda0 (center - x)).

    Parameters
    ----------
    start : Frozen
        Model, plan, curvature.
    measured : (B, m, 12, 32) array
        Position and rotation rows measured [m].
    center : (B, f, 32) array
        Center of the prior, as a step from the model.
    steps : int
        Steps to take; inputs are trusted.
    gradient : callable
        Of `calib.kernels.loops`.
    first : (B, f, 32) array, optional
        J'W r at the model, where it is known to first order in the noise: a later step finds the
        rest, so that one gradient less is asked for.
    """
    batch = Batch(start.model, start.parameters, start.measurements, len(measured))
    B, f = len(measured), start.parameters.n_free
    free, lost = start.parameters.free_index, np.zeros((B, WIDTH), dtype=np.bool_)
    slope = np.empty((B, start.model.n_numbers, WIDTH))
    square = np.empty((B, WIDTH))
    for k in range(steps):
        if first is not None and k == 0 and steps > 1:
            own = first
        else:
            gradient(
                batch.links, batch.base, batch.tool, batch.terms, measured, start.weight,
                start.measurements.offset, *batch.configurations, slope, square,
            )  # fmt: skip
            own = slope[:, free]
        pull = own + start.prior @ (center - batch.x)
        step = start.covariance @ pull
        if k >= STEPS:  # the steps of a replicate that runs away would end beyond all numbers
            lost = np.abs(step).max(axis=1, initial=0.0) > RUNAWAY
            step = np.where(lost[:, None], 0.0, step)
        batch.move(step)
    data = start.precision - start.prior
    chi_square = square - np.einsum("bfl,bfl->bl", step, 2 * own - data @ step)
    length = np.sqrt(np.einsum("bfl,bfl->bl", step, start.precision @ step))
    length[(batch.turned > LARGEST_TERM) | lost] = np.inf
    return Refits(np.moveaxis(batch.x, 1, -1).reshape(-1, f), chi_square.ravel(), length.ravel())
