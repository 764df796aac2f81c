"""What a misfit looks like: half in the joints, half at the target, one draw for each pose.

And which angles are further off than that and their noise make them.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.jacobian import joint_columns
from calib.geometry.model import RobotModel
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict

LOUD = 1e-4
"""Chance of angles so far off below which they are further off than stated."""
WRIST = 3.0
"""How much more angles may be off than joints that are all equally wrong make them, for positions
as wrong as these: those of the wrist move the target little."""
FEW = 0.1
"""Part of the poses that may be wrong shots, and be left out of what angles say."""


@dataclass(frozen=True, slots=True, eq=False)
class MisfitShape:
    """A misfit of 1 m per axis: half of its variance in the joints, half at the target.

    Every pose has a draw of its own. Errors of the joints alone would deny what bends at the
    target, errors at the target alone what comes from the gears.

    References
    ----------
    D = [J_q J_q' / s2 + diag(1, 1, 1, 0, 0, 0)] / 2 with s2 the mean of tr(J_q J_q')_pp / 3.
    """

    columns: Annotated[Index, "k"]
    """(k,) numbers of the model that a draw moves: the base's place, and every joint."""
    sd: Annotated[Array, "k"]
    """(k,) standard deviation of each, per metre of size [1, rad/m]."""

    def rows(self, rows: Array) -> Array:
        """Root B (..., k) of D = B B', from rows (..., P) of the model's derivative."""
        return np.asarray(rows[..., self.columns] * self.sd)


def misfit_shape(model: RobotModel, poses: Measurements) -> MisfitShape:
    """Shape of a misfit, scaled over poses from where the robot is used.

    A slide counts like a turning joint: its draw moves the target as far, on average.
    """
    seen = predict(model, poses)
    joints = np.array(joint_columns(model.chain))
    at = seen.filled[:, :3]
    square = np.where(at[:, :, None], seen.rows[:, :3][:, :, joints] ** 2, 0.0).sum((0, 1))
    square /= at.sum()
    turning = np.array([kind == "revolute" for kind in model.chain.kinds])
    usual = square[turning].mean() if turning.any() else square.mean()
    # a joint that never moves the target takes no part
    scale = np.where(turning, 1.0, np.sqrt(usual / np.where(square > 0, square, np.inf)))
    joint_variance = float((scale**2 * square).sum())
    if joint_variance > 0:
        of_joints = scale / np.sqrt(2 * joint_variance)
        of_target = np.full(3, np.sqrt(0.5))
    else:
        of_joints, of_target = np.zeros(len(joints)), np.ones(3)
    return MisfitShape(
        frozen(np.concatenate([[0, 1, 2], joints]), np.int64),
        frozen(np.concatenate([of_target, of_joints])),
    )


def same_count(pose: Index) -> list[Index]:
    """Rows (poses, k) of all poses of k rows, for each k; `pose` (m,) tells whose each row is."""
    order = np.argsort(pose, kind="stable")
    _, first, count = np.unique(pose[order], return_index=True, return_counts=True)
    return [order[first[count == k][:, None] + np.arange(k)] for k in np.unique(count)]


def of_poses(shape: MisfitShape, size: float, rows: Array, covariance: Array) -> Array:
    """Covariances (n, 3 k, 3 k) of the k positions of each of n poses [m^2]: noise and a misfit.

    Parameters
    ----------
    shape : MisfitShape
        Of a misfit of 1 m per axis.
    size : float
        Of the misfit, one for each pose [m].
    rows : (n, k, 3, P) array
        Derivative of the positions.
    covariance : (n, k, 6, 6) array
        Of the noise [m, rad].
    """
    n, k = rows.shape[:2]
    own = size * shape.rows(rows).reshape(n, 3 * k, -1)
    V = own @ np.swapaxes(own, 1, 2)
    for j in range(k):
        part = slice(3 * j, 3 * j + 3)
        V[:, part, part] += covariance[:, j, :3, :3]
    return np.asarray(V)


def angles_apart(residual: Array, B: Array, covariance: Array) -> tuple[Array, Array]:
    """Variances (..., n, 3) of angles along their principal axes, and squares of what they read.

    Parameters
    ----------
    residual : (..., n, 6) array
        Of full poses [m, rad].
    B : (..., n, 3, k) array
        Root of the misfit's shape in their angles, of 1 m per axis.
    covariance : (..., n, 6, 6) array
        Of the noise [m, rad].

    References
    ----------
    r ~ N(0, N + (3 s)^2 D), s the root mean square of the position residuals: a bound of the
    misfit.
    """
    size = WRIST**2 * (residual[..., :3] ** 2).mean(axis=(-2, -1))[..., None, None, None]
    values, axes = np.linalg.eigh(covariance[..., 3:, 3:] + size * (B @ np.swapaxes(B, -1, -2)))
    along = (np.swapaxes(axes, -1, -2) @ residual[..., 3:, None])[..., 0]
    return values, along**2


def are_loud(variance: Array, square: Array) -> Bool:
    """Whether squares (..., n, 3) are larger than their variances make likely.

    A few wrong shots tell nothing of the others: they do not count.
    """
    sound = ~wrong_shots(variance, square)
    each = (square / variance).sum(axis=-1)
    return np.asarray(chdtrc(3 * sound.sum(axis=-1), (each * sound).sum(axis=-1)) < LOUD)


def wrong_shots(variance: Array, square: Array) -> Bool:
    """Which poses (..., n) lie so far off that chance does not make them, at most `FEW` of all."""
    each = (square / variance).sum(axis=-1)
    place = np.argsort(np.argsort(-each, axis=-1, kind="stable"), axis=-1, kind="stable")
    n = each.shape[-1]
    return np.asarray((chdtrc(3, each) < LOUD / n) & (place < int(FEW * n)))
