"""Test of many robots for held-out rows in another frame, by the p-value of a common motion."""

import numpy as np
from scipy.special import chdtrc

from calib.arrays import Array
from calib.uncertainty.frames.motion_fit import FOLLOWED
from calib.uncertainty.many.gains import ManyGains, halved, many_whiteners
from calib.uncertainty.many.sights import ManyRowsSeen, ManySights


def motion_chances(seen: ManySights, gains: ManyGains, covariance: Array, upper: Array) -> Array:
    """The smaller p-value (R,) of a motion of the base and of one of the target.

    Parameters
    ----------
    seen, gains
        Predictions and gains of R robots.
    covariance : (R, f, f) array
        Covariance of the free numbers [m, rad].
    upper : (R,) array
        Upper limit of the misfit [m].

    References
    ----------
    As `other_frame`, with errors that rows share in the covariance.
    """
    e = seen.test.residual[:, :, :3]
    size = np.minimum(upper, np.sqrt((e**2).mean(axis=(1, 2))))
    about = seen.test.p.mean(axis=1, keepdims=True)
    motion = _motions(seen.test, about)[:, :, :3]
    common, usual = _standing(seen, gains, size, about, motion)
    rows = seen.test.free[:, :, :3]
    R, n = rows.shape[:2]
    root = _whiteners(gains, seen.test, size)
    whole = np.concatenate([rows, common, (e - usual)[..., None], motion], axis=3)
    white = (root @ whole).reshape(R, 3 * n, -1)
    f, c = rows.shape[3], common.shape[3]
    J, shared, error, motion = np.split(white, [f, f + c, f + c + 1], axis=2)
    C = covariance + size[:, None, None] ** 2 * gains.misfit
    V = J @ C @ np.swapaxes(J, 1, 2) + shared @ np.swapaxes(shared, 1, 2)
    V[:, range(3 * n), range(3 * n)] += 1.0
    both = halved(V, np.concatenate([error, motion], axis=2))
    error, base, tool = both[..., :1], both[..., 1:7], both[..., 7:]
    chances = chdtrc(6, _fall(error, base)), chdtrc(3, _fall(error, tool))
    return np.asarray(np.minimum(*chances))


def _fall(e: Array, motion: Array) -> Array:
    """Drop (R,) of the sum of squares of whitened errors (R, n, 1) by the best motion (R, n, k)."""
    U, s, _ = np.linalg.svd(motion, full_matrices=False)
    shown = s > np.finfo(np.float64).eps * motion.shape[1] * s[:, :1]
    return np.asarray((((np.swapaxes(U, 1, 2) @ e)[..., 0] ** 2) * shown).sum(axis=1))


def _motions(table: ManyRowsSeen, about: Array) -> Array:
    """Derivative (R, m, 6, 9) of rows by a shift and turn of the station and a shift of the target.

    The station turns about the points `about` (R, 1, 3) [m].
    """
    arm = table.p - about
    motions = np.zeros((*arm.shape[:2], 6, 9))
    motions[:, :, :3, :3] = np.eye(3)
    motions[:, :, :3, 3:6] = -np.cross(arm[..., None], np.eye(3)[None, None], axis=2)
    motions[:, :, 3:, 3:6] = np.eye(3)
    motions[:, :, :3, 6:] = table.tool
    return motions


def _whiteners(gains: ManyGains, table: ManyRowsSeen, size: Array) -> Array:
    """Inverse Cholesky factors (R, m, 3, 3) of noise plus a misfit of size (R,) [m]."""
    own = size[:, None, None, None] * gains.shapes(table.rows[:, :, :3])
    V = own @ np.swapaxes(own, 2, 3) + table.covariance[:, :, :3, :3]
    return many_whiteners(V)


def _standing(
    seen: ManySights, gains: ManyGains, size: Array, about: Array, there: Array
) -> tuple[Array, Array]:
    """Errors of held-out rows from a motion of all readings: columns (R, n, 3, 9), mean (R, n, 3).

    `there` (R, n, 3, 9) are the derivatives by the motion at these rows. See `motion_fit`.
    """
    motions = _motions(seen.train, about)
    R, m = motions.shape[:2]
    followed = gains.F @ motions.reshape(R, 6 * m, 9)
    own = seen.train.free.reshape(R, 6 * m, -1)
    rest = (motions.reshape(R, 6 * m, 9) - own @ followed).reshape(motions.shape)
    columns = [rest[:, :, :3], seen.train.residual[:, :, :3, None], motions[:, :, :3]]
    white = _whiteners(gains, seen.train, size) @ np.concatenate(columns, axis=3)
    B, e, whole = np.split(white.reshape(R, 3 * m, -1), [9, 10], axis=2)
    U, s, V = np.linalg.svd(B, full_matrices=False)
    largest = np.linalg.svd(whole, compute_uv=False)[:, :1]
    back = np.where(s > FOLLOWED * largest, 1 / np.where(s > 0, s, 1.0), 0.0)
    n = there.shape[1]
    rows = seen.test.free[:, :, :3].reshape(R, 3 * n, -1)
    reach = there.reshape(R, 3 * n, 9) - rows @ followed
    common = reach @ (np.swapaxes(V, 1, 2) * back[:, None])
    kept = (back > 0)[:, :, None] * (np.swapaxes(U, 1, 2) @ e)
    return common.reshape(R, n, 3, 9), (common @ kept).reshape(R, n, 3)
