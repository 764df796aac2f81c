"""Blocks (N, r, p): whitened, scaled Jacobians of N candidate poses; their rank, in words too."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen, require_kind, require_numbers
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.information.goals import Goals, goal_matrix, hidden_numbers
from calib.information.rank import count, rank, singular_values, triangle
from calib.information.reduction import reduce
from calib.kinds import in_short
from calib.measurement.residual import point_blocks, whitened_blocks
from calib.measurement.tables import covariances_of_sd

PAPER_LENGTH = 1e-3
"""Unit of length of Wen et al. [m]: millimeters, on which their indices depend."""
HUGE = 1e60
"""Largest number allowed in a block; the largest of each column must be at least its inverse."""
NEARLY_SINGULAR = 1e-7
"""M = A'A counts as singular if A, with columns of unit length, has a singular value below this
part of the largest."""


def scaled_blocks(blocks: ArrayLike, parameters: Parameters) -> Array:
    """Blocks (N, r, p) of the free numbers, per scaled unit, from whitened Jacobians (N, r, P)."""
    (blocks,) = check(f"N r {len(parameters.names)}", blocks=blocks)
    return frozen(blocks[:, :, parameters.free] * parameters.free_scale)


@in_short
def identifiable_blocks(
    model: RobotModel,
    q: ArrayLike,
    noise: ArrayLike,
    free: Iterable[str] | None = None,
    *,
    goals: ArrayLike | None = None,
    target: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Parameters]:
    """Scaled blocks (N, r, p) of poses at joint values q (N, n), and the numbers they can identify.

    Parameters
    ----------
    model : RobotModel
        Nominal model.
    q : (N, n) array_like
        Joint values [rad, m].
    noise : array_like
        For measured poses: standard deviations of position and rotation (2,), or of the six axes
        (6,) [m, rad], or covariances (6, 6) or (N, 6, 6). If only a reflector is measured: one
        standard deviation or three [m], or covariances (3, 3) or (N, 3, 3).
    free : iterable of str, optional
        Names of the numbers to identify; by default all of the model.
    goals : (g, n) array_like, optional
        Joint values at which the tool must be right [rad, m].
    target : (3,) array_like
        Tool point in the tool frame, which the goals are about and where the reflector is [m].

    Raises
    ------
    InputError
        A1: no poses or no free numbers; M28: numbers that no pose of the pool shows move the tool
        at the goals.
    """
    require_kind("model", model, RobotModel, "a calib.RobotModel")
    q, target = check(f"N {model.chain.n_joints}, 3", q=q, target=target)
    noise = require_numbers("noise", noise)
    r = 6 if noise.shape == (2,) or noise.shape[-1:] == (6,) else 3
    covariance = covariances_of_sd(noise, r, len(q), "noise")
    if r == 6:
        rows = whitened_blocks(model, q, covariance)
    else:
        rows = point_blocks(model, q, covariance, np.tile(target, (len(q), 1)))
    parameters = parameters_of(model, free)
    if not (len(q) and parameters.n_free):
        missing = "free names no number" if len(q) else "q has no poses"
        raise refuse("free" if len(q) else "q", code="A1", message=missing)
    A = scaled_blocks(rows, parameters).reshape(-1, parameters.n_free)
    if goals is not None:
        _require_shown(A, goal_matrix(model, goals, parameters, target=target), parameters)
    parameters = parameters.freeing(reduce(A, parameters, model=model, q=q).kept)
    return scaled_blocks(rows, parameters), parameters


def _require_shown(A: Array, goals: Goals, parameters: Parameters) -> None:
    """Raise an `InputError` (M28) if directions that rows A (N, f) do not show move the goal."""
    if names := hidden_numbers(A, goals, parameters.free_names):
        message = (
            f"{', '.join(names)} can change together so that the tool point at the goal moves, and "
            "no pose of the pool shows it"
        )
        fix = "widen the pool, or let free name what is to be identified"
        raise refuse("goals", names, code="M28", message=message, fix=fix)


def paper_blocks(model: RobotModel, parameters: Parameters, q: ArrayLike) -> Array:
    """Blocks (N, 6, p) equivalent to the twelve rows of Wen et al. [mm, rad], at joints q (N, n).

    Rotations weighted by sqrt(2) carry exactly the information of the nine direction cosines.

    References
    ----------
    Wen et al. 2022, eq. (4): with twelve rows H and six rows (J_w; J_p), H'H = 2 J_w'J_w + J_p'J_p.
    """
    _, J = model.poses_and_jacobian(q)
    rows = np.array([1.0, 1.0, 1.0, *[np.sqrt(2.0) * PAPER_LENGTH] * 3]) / PAPER_LENGTH
    columns = np.where(parameters.is_length, PAPER_LENGTH, 1.0)
    return frozen((J * rows[:, None] * columns)[:, :, parameters.free])


def most_of_one(blocks: Array) -> int:
    """Largest rank of the block of a single pose in the pool (N, r, p); at least one."""
    full, most = min(blocks.shape[1:]), 1
    for block in blocks:
        # nearly always the first pose has all its rows
        most = max(most, rank(block))
        if most == full:
            break
    return most


def unitless_rank(A: Array) -> int:
    """Rank of rows (N, p) whose columns are first scaled to unit length."""
    size = np.linalg.norm(A, axis=0)
    return count(singular_values(A / np.where(size > 0, size, 1.0)), NEARLY_SINGULAR)


def has_full_rank(A: Array) -> bool:
    """Whether rows (N, p) determine all p numbers, whatever the units of their columns."""
    return unitless_rank(A) == int(A.shape[1])


def unobservable_in_words(A: Array, names: Sequence[str] = ()) -> str:
    """Say which numbers rows (N, p) leave undetermined, in one clause per group of them."""
    p = A.shape[1]
    names = names or [f"number {k}" for k in range(p)]
    size = np.linalg.norm(A, axis=0)
    unit = A / np.where(size > 0, size, 1.0)
    _, singular, Vt = np.linalg.svd(triangle(np.concatenate([unit, np.zeros((p, p))])))
    null = Vt[singular < NEARLY_SINGULAR * singular[0]] if singular[0] > 0 else np.eye(p)
    projector = null.T @ null
    linked = np.abs(projector) > NEARLY_SINGULAR
    clauses, left = [], {int(k) for k in np.flatnonzero(linked.any(1))}
    while left:
        group, frontier = set[int](), {min(left)}
        while frontier:
            group |= frontier
            frontier = {int(j) for k in frontier for j in np.flatnonzero(linked[k])} - group
        left -= group
        clauses.append(_clause(sorted(group), projector, names))
    return "; ".join(clauses)


def _clause(group: Sequence[int], projector: Array, names: Sequence[str]) -> str:
    """Words for one group of numbers that share undetermined directions."""
    words = [names[k] for k in group]
    if len(words) == 1:
        return f"{words[0]} has no effect on anything measured"
    lost = round(float(projector[group, group].sum()))
    more = ", ..." if len(words) > 10 else ""
    listed = ", ".join(words[:-1][:9]) + f"{more} and {words[-1]}"
    if len(words) == 2:
        return f"{listed} cannot be told apart"
    return f"{len(words)} numbers tell only {len(words) - lost} apart: {listed}"


def information(blocks: Array) -> Array:
    """Information matrix M = A'A (p, p) of poses (m, r, p) stacked."""
    A = blocks.reshape(-1, blocks.shape[-1])
    return np.asarray(A.T @ A)


def prior_rows(prior: ArrayLike | None, p: int) -> Array:
    """Rows R (k, p) with R'R equal to the prior precision (p, p).

    Raises
    ------
    InputError
        M34: `prior` is not symmetric positive semidefinite; A3: it is too large.
    """
    if prior is None:
        return np.zeros((0, p))
    (precision,) = check(f"{p} {p}", prior=prior)
    if (size := float(np.abs(precision).max())) > HUGE**2:
        said = f"prior holds numbers of the size {size:g}"
        fix = "leave out what is known exactly"
        raise refuse("prior", size, f"at most {HUGE**2:g}", code="A3", message=said, fix=fix)
    w, U = np.linalg.eigh((precision + precision.T) / 2)
    slack = p * np.finfo(np.float64).eps * max(np.abs(w).max(), np.finfo(np.float64).tiny)
    if np.abs(precision - precision.T).max() > 1e-9 * np.abs(precision).max() or w[0] < -slack:
        message, wanted = "prior is not a precision matrix", "symmetric, no negative eigenvalue"
        raise refuse("prior", float(w[0]), wanted, code="M34", message=message)
    kept = w > slack
    return np.asarray((U[:, kept] * np.sqrt(w[kept])).T)
