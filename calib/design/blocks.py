"""What one more pose would tell: blocks (N, r, p) of rows of candidate poses, and their checks."""

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import InputError
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.information.rank import rank, singular_values

PAPER_LENGTH = 1e-3
"""The paper counts lengths in mm: its indices depend on that."""
NEARLY_SINGULAR = 1e-7
"""Unit columns with a singular value below this part of the largest leave M = A'A singular."""


def scaled_blocks(blocks: ArrayLike, parameters: Parameters) -> Array:
    """Blocks (N, r, p) of the free numbers, per scaled unit, from whitened ones (N, r, P)."""
    (blocks,) = check(f"N r {len(parameters.names)}", blocks=blocks)
    return frozen(blocks[:, :, parameters.free] * parameters.free_scale)


def paper_blocks(model: RobotModel, parameters: Parameters, q: ArrayLike) -> Array:
    """Blocks (N, 6, p) worth the paper's twelve rows, in mm and rad, at joint values q (N, n).

    dr weighted by sqrt(2) tells exactly what the nine direction cosines tell: H'H is the same.

    References
    ----------
    Wen et al. 2022, eq. (4); MATH 2.
    """
    _, J = model.poses_and_jacobian(q)
    rows = np.array([1.0, 1.0, 1.0, *[np.sqrt(2.0) * PAPER_LENGTH] * 3]) / PAPER_LENGTH
    columns = np.where(parameters.is_length, PAPER_LENGTH, 1.0)
    return frozen((J * rows[:, None] * columns)[:, :, parameters.free])


def fewest_poses(blocks: Array) -> int:
    """Fewest poses of the pool (N, r, p) whose rows can reach rank p."""
    return int(-(-blocks.shape[2] // max(rank(blocks[0]), 1)))


def checked_blocks(blocks: ArrayLike, m: int) -> Array:
    """Blocks (N, r, p), after refusing a size m they cannot give and numbers they cannot see."""
    (blocks,) = check("N r p", blocks=blocks)
    n_pool, n_rows, p = blocks.shape
    if not blocks.size:
        raise InputError(
            f"blocks has shape {blocks.shape}", code="A1", field="blocks", allowed="none may be 0"
        )
    if m > n_pool:
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed=f"the pool has {n_pool}",
            fix="enlarge the pool or choose fewer poses",
        )
    fewest = fewest_poses(blocks)
    if m < fewest:
        raise InputError(
            f"{m} poses wanted",
            code="M27",
            field="m",
            value=m,
            allowed=f"{p} numbers need at least {fewest} poses of {n_rows} rows",
            fix="choose more poses or free fewer numbers",
        )
    if is_singular(blocks):
        raise InputError(
            f"even all {n_pool} poses cannot tell the {p} numbers apart",
            code="M28",
            field="blocks",
            fix="reduce the free numbers first (calib.information.reduction)",
        )
    return blocks


def is_singular(blocks: Array) -> bool:
    """Whether poses (m, r, p) together leave a direction unseen, whatever the column units."""
    A = blocks.reshape(-1, blocks.shape[-1])
    size = np.linalg.norm(A, axis=0)
    if len(A) < A.shape[1] or not size.all():
        return True
    singular = singular_values(A / size)
    return bool(singular[-1] < NEARLY_SINGULAR * singular[0])


def information(blocks: Array) -> Array:
    """Information matrix M = A'A (p, p) of poses (m, r, p) stacked."""
    A = blocks.reshape(-1, blocks.shape[-1])
    return np.asarray(A.T @ A)
