"""Blocks (N, r, p) of candidate poses, their rank, and what they leave unobservable, in words."""

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
from calib.measurement.residual import point_blocks, whitened_blocks
from calib.measurement.tables import covariances_of_sd

PAPER_LENGTH = 1e-3
"""The paper counts lengths in mm: its indices depend on that."""
HUGE = 1e60
"""Largest number in a block, and one over the smallest largest one of a column."""
NEARLY_SINGULAR = 1e-7
"""Unit columns with a singular value below this part of the largest leave M = A'A singular."""


def scaled_blocks(blocks: ArrayLike, parameters: Parameters) -> Array:
    """Blocks (N, r, p) of the free numbers, per scaled unit, from whitened ones (N, r, P)."""
    (blocks,) = check(f"N r {len(parameters.names)}", blocks=blocks)
    return frozen(blocks[:, :, parameters.free] * parameters.free_scale)


def identifiable_blocks(
    model: RobotModel,
    q: ArrayLike,
    noise: ArrayLike,
    free: Iterable[str] | None = None,
    *,
    goals: ArrayLike | None = None,
) -> tuple[Array, Parameters]:
    """Scaled blocks (N, r, p) of poses at joint values q (N, n), and the numbers they can identify.

    Parameters
    ----------
    model : RobotModel
        Nominal model.
    q : (N, n) array_like
        Joint values [rad, m].
    noise : array_like
        Of a measured pose the standard deviations of position and rotation (2,), of the six axes
        (6,) [m, rad], or covariances, one (6, 6) or (N, 6, 6); or, where only the tool origin is
        measured, one standard deviation or three [m], or covariances, one (3, 3) or (N, 3, 3).
    free : iterable of str, optional
        Names of the numbers to identify; by default all of the model.
    goals : (g, n) array_like, optional
        Joint values at which the tool must be right [rad, m]: refused where numbers that no pose
        shows, and which are therefore held, move it there.
    """
    require_kind("model", model, RobotModel, "a calib.RobotModel")
    (q,) = check(f"N {model.chain.n_joints}", q=q)
    noise = require_numbers("noise", noise)
    r = 6 if noise.shape == (2,) or noise.shape[-1:] == (6,) else 3
    covariance = covariances_of_sd(noise, r, len(q), "noise")
    if r == 6:
        rows = whitened_blocks(model, q, covariance)
    else:
        rows = point_blocks(model, q, covariance, np.zeros((len(q), 3)))
    parameters = parameters_of(model, free)
    if not (len(q) and parameters.n_free):
        missing = "free names no number" if len(q) else "q has no poses"
        raise refuse("free" if len(q) else "q", code="A1", message=missing)
    A = scaled_blocks(rows, parameters).reshape(-1, parameters.n_free)
    if goals is not None:
        _require_shown(A, goal_matrix(model, goals, parameters), parameters)
    parameters = parameters.freeing(reduce(A, parameters, model=model, q=q).kept)
    return scaled_blocks(rows, parameters), parameters


def _require_shown(A: Array, goals: Goals, parameters: Parameters) -> None:
    """Refuse a goal that moves with something that rows A (N, f) never show."""
    if names := hidden_numbers(A, goals, parameters.free_names):
        message = (
            f"{', '.join(names)} can change together so that the tool point at the goal moves, and "
            "no pose of the pool shows it"
        )
        fix = "widen the pool, or let free name what is to be identified"
        raise refuse("goals", names, code="M28", message=message, fix=fix)


def paper_blocks(model: RobotModel, parameters: Parameters, q: ArrayLike) -> Array:
    """Blocks (N, 6, p) equivalent to the paper's twelve rows, in mm and rad, at joints q (N, n).

    dr weighted by sqrt(2) carries exactly the information of the nine direction cosines.

    References
    ----------
    Wen et al. 2022, eq. (4): with twelve rows H and six rows (J_w; J_p), H'H = 2 J_w'J_w + J_p'J_p.
    """
    _, J = model.poses_and_jacobian(q)
    rows = np.array([1.0, 1.0, 1.0, *[np.sqrt(2.0) * PAPER_LENGTH] * 3]) / PAPER_LENGTH
    columns = np.where(parameters.is_length, PAPER_LENGTH, 1.0)
    return frozen((J * rows[:, None] * columns)[:, :, parameters.free])


def most_of_one(blocks: Array) -> int:
    """Largest rank of one pose of the pool (N, r, p); at least one."""
    full, most = min(blocks.shape[1:]), 1
    for block in blocks:
        # nearly always the first pose has all its rows
        most = max(most, rank(block))
        if most == full:
            break
    return most


def unitless_rank(A: Array) -> int:
    """Rank of rows (N, p), whatever the units of their columns."""
    size = np.linalg.norm(A, axis=0)
    return count(singular_values(A / np.where(size > 0, size, 1.0)), NEARLY_SINGULAR)


def has_full_rank(A: Array) -> bool:
    """Whether rows (N, p) determine all p numbers, whatever the units of the columns."""
    return unitless_rank(A) == int(A.shape[1])


def unobservable_in_words(A: Array, names: Sequence[str] = ()) -> str:
    """What rows (N, p) leave undetermined, one clause per group of numbers."""
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
    """Rows (k, p) whose information is the prior precision."""
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
