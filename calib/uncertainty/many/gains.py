"""Gains of the estimates of many robots, and the errors that these estimates cannot absorb."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv, dpotrf, dtrtrs

from calib.arrays import Array, Index
from calib.geometry.jacobian import joint_columns
from calib.measurement.noise import whiteners
from calib.uncertainty.many.sights import ManyRowsSeen, ManySights
from calib.uncertainty.statement.evidence import diagonal


@dataclass(frozen=True, slots=True, eq=False)
class ManyGains:
    """Effect of rows on the estimates of R robots; see `gain`, `shape` and `applicability`."""

    F: Array
    """(R, f, 6 m) derivative of the free numbers by each training row [m, rad]."""
    columns: Index
    """(k,) numbers of the model that a draw of misfit moves."""
    sd: Array
    """(R, k) standard deviation of each, for a misfit of 1 m per axis [1, rad/m]."""
    misfit: Array
    """(R, f, f) covariance of the estimates from a misfit of 1 m per axis in the training rows."""
    spread: tuple[Array, Array]
    """(R, n, 3, 3) and (R, t, 3, 3) covariances of held-out points and targets by the noise."""
    left: tuple[Array, Array]
    """(R, 3, n) and (R, 3, t) variance of these points from unit errors of all terms that the model
    lacks, from a foot that yields, and from the noise."""

    @property
    def usual(self) -> Array:
        """(R, 3) means of `left` over the held-out poses."""
        return np.asarray(self.left[0].mean(axis=2))

    def shapes(self, rows: Array) -> Array:
        """Factor B (R, m, r, k), B B' the covariance of a misfit of 1 m per axis.

        `rows` (R, m, r, P) is the derivative of the prediction.
        """
        return np.asarray(rows[..., self.columns] * self.sd[:, None, None])


def gains_of(seen: ManySights) -> ManyGains:
    """Gains of R robots, of which each row is one pose."""
    R, m = seen.train.q.shape[:2]
    f, A = len(seen.free), seen.train.free * seen.scale
    F = seen.scale[:, None] * gain_of_rows(A, seen.train.covariance, seen.precision)
    columns, sd = _shapes(seen)
    B = seen.train.rows[..., columns] * sd[:, None, None]
    each_pose = (F.reshape(R, f, m, 6).swapaxes(1, 2) @ B).swapaxes(1, 2).reshape(R, f, -1)
    absorbed = F @ seen.train.unheld.reshape(R, 6 * m, -1)
    tables = seen.test, seen.there
    spread = [propagated(table.free[:, :, :3], seen.covariance) for table in tables]
    left = [_left(*both, absorbed) for both in zip(tables, spread, strict=True)]
    misfit = each_pose @ np.swapaxes(each_pose, 1, 2)
    return ManyGains(F, columns, sd, misfit, (spread[0], spread[1]), (left[0], left[1]))


def gain_of_rows(A: Array, N: Array, precision: Array) -> Array:
    """Gains F (R, f, 6 m) of rows A (R, m, 6, f), with noise N (R, m, 6, 6), prior (R, f, f).

    References
    ----------
    inv(A'WA + Lambda0) A'W; with more numbers than rows inv(Lambda0) A' inv(N + A inv(Lambda0) A').
    """
    R, m, _, f = A.shape
    flat = A.reshape(R, 6 * m, f)
    if f > 6 * m and all(map(diagonal, precision)):
        spread = flat / np.diagonal(precision, axis1=1, axis2=2)[:, None]
        V = flat @ np.swapaxes(spread, 1, 2)
        for k in range(m):
            V[:, 6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += N[:, k]
        return np.array([dposv(v, a, lower=1)[1].T for v, a in zip(V, spread, strict=True)])
    root = many_whiteners(N)
    white = root @ A
    WA = (np.swapaxes(root, 2, 3) @ white).reshape(R, 6 * m, f)
    white = np.swapaxes(white.reshape(R, 6 * m, f), 1, 2)
    H = white @ np.swapaxes(white, 1, 2) + precision
    return np.array([dposv(h, w.T, lower=1)[1] for h, w in zip(H, WA, strict=True)])


def _left(table: ManyRowsSeen, spread: Array, absorbed: Array) -> Array:
    """Variances (R, 3, N) as in `ManyGains.left`."""
    R, N = table.q.shape[:2]
    flat = table.free[:, :, :3].reshape(R, 3 * N, -1)
    G = table.unheld[:, :, :3].reshape(R, 3 * N, -1) - flat @ absorbed
    square = (G**2).reshape(R, N, 3, -1).sum(axis=2)
    noise = np.trace(spread, axis1=2, axis2=3)
    return np.stack([square[..., :-1].sum(axis=2), square[..., -1], noise], axis=1)


def many_whiteners(covariance: Array) -> Array:
    """Whiteners (R, m, k, k) of covariances (R, m, k, k)."""
    k = covariance.shape[2]
    return whiteners(covariance.reshape(-1, k, k)).reshape(covariance.shape)


def halved(covariance: Array, columns: Array) -> Array:
    """Columns (R, n, k) whitened by Cholesky factors of covariances (R, n, n) (overwritten)."""
    found = np.empty_like(columns)
    for to, V, own in zip(found, covariance, columns, strict=True):
        # of a transposed symmetric matrix, which LAPACK overwrites
        root, flaw = dpotrf(V.T, lower=1, clean=0, overwrite_a=1)
        if flaw:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        to[:] = dtrtrs(root, own, lower=1)[0]
    return found


def propagated(rows: Array, covariance: Array) -> Array:
    """Covariances (R, N, k, k) of linear functions with rows (R, N, k, f), from those (R, f, f)."""
    R, N, k, f = rows.shape
    half = (rows.reshape(R, N * k, f) @ covariance).reshape(rows.shape)
    sigma = half @ np.swapaxes(rows, 2, 3)
    return np.asarray((sigma + np.swapaxes(sigma, 2, 3)) / 2)


def _shapes(seen: ManySights) -> tuple[Index, Array]:
    """Numbers (k,) that a misfit moves, with sd (R, k), as `misfit_shape` at held-out poses."""
    chain = seen.fits[0].model.chain
    joints = np.array(joint_columns(chain))
    square = (seen.test.rows[:, :, :3, joints] ** 2).sum((1, 2)) / (3 * seen.test.q.shape[1])
    turning = np.array([kind == "revolute" for kind in chain.kinds])
    usual = (square[:, turning] if turning.any() else square).mean(axis=1, keepdims=True)
    scale = np.where(turning, 1.0, np.sqrt(usual / np.where(square > 0, square, np.inf)))
    variance = (scale**2 * square).sum(axis=1, keepdims=True)
    moves = variance > 0
    of_joints = np.where(moves, scale / np.sqrt(2 * np.where(moves, variance, 1.0)), 0.0)
    of_target = np.broadcast_to(np.where(moves, np.sqrt(0.5), 1.0), (len(seen), 3))
    return np.concatenate([[0, 1, 2], joints]), np.concatenate([of_target, of_joints], axis=1)
