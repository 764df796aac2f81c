"""How many estimates follow their rows, and what they cannot hold: products over robots."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.jacobian import joint_columns
from calib.uncertainty.many.sights import ManyRowsSeen, ManySights


@dataclass(frozen=True, slots=True, eq=False)
class ManyGains:
    """What the rows of R robots do to their estimates; see `gain`, `shape` and `applicability`."""

    F: Array
    """(R, f, 6 m) how free numbers follow each row identified from [m, rad]."""
    columns: Index
    """(k,) numbers of the model that a draw of misfit moves."""
    sd: Array
    """(R, k) standard deviation of each, for a misfit of 1 m per axis [1, rad/m]."""
    misfit: Array
    """(R, f, f) covariance of the estimates from a misfit of 1 m per axis in the training rows."""
    absorbed: Array
    """(R, f, k + 1) how estimates follow a unit of what no number holds."""
    usual: Array
    """(R, 3) means of `left` over the held-out poses."""

    def shapes(self, rows: Array) -> Array:
        """Root B (R, m, r, k) of a misfit of 1 m per axis, from rows (R, m, r, P)."""
        return np.asarray(rows[..., self.columns] * self.sd[:, None, None])


def gains_of(seen: ManySights) -> ManyGains:
    """Those of R robots; poses of a table stand for themselves."""
    R, m = seen.train.q.shape[:2]
    A = seen.train.rows[..., seen.free] * seen.scale
    f = len(seen.free)
    WA = np.linalg.solve(seen.train.covariance, A).reshape(R, 6 * m, f)
    H = np.swapaxes(WA, 1, 2) @ A.reshape(R, 6 * m, f) + seen.precision
    F = seen.scale[:, None] * np.linalg.solve(H, np.swapaxes(WA, 1, 2))
    columns, sd = _shapes(seen)
    B = seen.train.rows[..., columns] * sd[:, None, None]
    each = (F.reshape(R, f, m, 6).swapaxes(1, 2) @ B).swapaxes(1, 2).reshape(R, f, -1)
    absorbed = F @ seen.train.unheld.reshape(R, 6 * m, -1)
    found = ManyGains(F, columns, sd, each @ np.swapaxes(each, 1, 2), absorbed, np.ones((R, 3)))
    usual = left(seen, found, seen.test).mean(axis=2)
    return ManyGains(F, columns, sd, found.misfit, absorbed, usual)


def left(seen: ManySights, gains: ManyGains, table: ManyRowsSeen) -> Array:
    """(R, 3, N) variance of the target left by a unit of every term, by the foot, by the noise."""
    own = table.rows[:, :, :3, seen.free]
    R, N = own.shape[:2]
    flat = own.reshape(R, 3 * N, -1)
    G = table.unheld[:, :, :3].reshape(R, 3 * N, -1) - flat @ gains.absorbed
    noise = (flat @ seen.covariance * flat).reshape(R, N, -1).sum(axis=2)
    square = (G**2).reshape(R, N, 3, -1).sum(axis=2)
    return np.stack([square[..., :-1].sum(axis=2), square[..., -1], noise], axis=1)


def propagated(rows: Array, covariance: Array) -> Array:
    """Covariances (R, N, k, k) of what follows rows (R, N, k, f), from (R, f, f)."""
    R, N, k, f = rows.shape
    half = (rows.reshape(R, N * k, f) @ covariance).reshape(rows.shape)
    sigma = half @ np.swapaxes(rows, 2, 3)
    return np.asarray((sigma + np.swapaxes(sigma, 2, 3)) / 2)


def _shapes(seen: ManySights) -> tuple[Index, Array]:
    """Numbers (k,) that a misfit moves and sd (R, k), as `misfit_shape` at the held-out poses."""
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
