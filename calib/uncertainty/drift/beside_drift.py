"""The likelihood of a drift beside noise and misfit, at the cost of a band."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpbtrf, dtbtrs

from calib.arrays import Array, Index
from calib.errors import refuse
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.uncertainty.statement.evidence import believed_before, reduced, sound_rows
from calib.uncertainty.statement.shape import MisfitShape, of_poses, same_count

MOST_ROWS, STRETCH = 300, 100
"""Rows whose likelihood is asked, and rows of one stretch: three times the longest memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """What a drift is asked beside, rows in time: noise and misfit V0, the numbers and residuals.

    A drift that forgets exponentially knows of the past only what its last value was: its inverse
    covariance couples neighbors alone, so that V0 + S costs no more than a band.
    """

    band: Array
    """(w + 1, 3 m) inv(V0), lower bands."""
    X: Array
    """(3 m, p + 1) inv(V0) [A, y], its columns contiguous."""
    square: Array
    """(p + 1, p + 1) [A, y]' inv(V0) [A, y]."""
    logarithm: float
    """ln|V0|."""

    def alone(self) -> float:
        """Restricted log-likelihood without a drift."""
        return _restricted(self.square, self.logarithm)

    def likelihood(self, sd: float, kept: Array) -> float:
        """With a drift of `sd` [m] per axis that keeps the share `kept` (m - 1,) to the next row.

        References
        ----------
        S = sd^2 K x I3. |V0 + S| = |V0| |S| |L| and inv(V0 + S) = inv(V0) - inv(V0) inv(L) inv(V0)
        with L = inv(S) + inv(V0), of which half the solution does.
        """
        new = 1 - kept**2
        own = np.append(1 / new, 1.0)
        own[1:] += kept**2 / new
        L = self.band.copy()
        L[0] += np.repeat(own, 3) / sd**2
        L[3, :-3] -= np.repeat(kept / new, 3) / sd**2
        root, flaw = dpbtrf(L, lower=1, overwrite_ab=1)
        if flaw:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        half, _ = dtbtrs(root, self.X, uplo="L")
        follows, m = half.T @ half, len(own)
        logarithm = 3 * np.log(new).sum() + 6 * m * np.log(sd) + 2 * np.log(root[0]).sum()
        return _restricted(self.square - follows, self.logarithm + float(logarithm))


@dataclass(frozen=True, slots=True, eq=False)
class RowsInTime:
    """Positions in the order in which they were measured, linear in the free numbers."""

    order: Index
    """(m,) place of each in time, rising."""
    pose: Index
    """(m,) numbers of their poses; those that identify and those held out have no number in common.
    """
    station: Index
    """(m,) from which each was seen."""
    rows: Array
    """(m, 3, P) derivative by all numbers."""
    covariance: Array
    """(m, 6, 6) noise."""
    A: Array
    """(3 m + k, p) derivative by what they show of the free numbers, with k rows of a prior."""
    y: Array
    """(3 m + k,) residuals."""

    @property
    def noise_sd(self) -> float:
        """Noise, root mean square per axis [m]."""
        return float(np.sqrt(np.trace(self.covariance[:, :3, :3], axis1=1, axis2=2).mean() / 3))

    def beside(self, shape: MisfitShape, misfit: float, first: Array | None = None) -> Beside:
        """Noise and misfit of these rows, with further columns (3 m, k) `first` if any."""
        m3 = 3 * len(self.order)
        X = np.column_stack([self.A, self.y])
        if first is not None:
            of_prior = np.zeros((len(X) - m3, first.shape[1]))
            X = np.column_stack([np.concatenate([first, of_prior]), X])
        found = beside_drift(X[:m3], self.rows, self.covariance, self.pose, shape, misfit)
        # no drift moves what was believed beforehand
        return replace(found, square=found.square + X[m3:].T @ X[m3:])


def rows_in_time(
    identification: Identification, train: Measurements, train_order: Index,
    held_out: Measurements, held_out_order: Index,
) -> RowsInTime:  # fmt: skip
    """Sound rows that identify, and those held out, as `memory.drift` takes them; of many some."""
    counts = sound_rows(identification, len(train))
    looked_at = train.rows(counts)
    both = joined([looked_at, held_out]) if len(held_out) else looked_at
    if both.is_distance.any():
        raise refuse("train", code="A3", message="distances show no drift of the station",
                     allowed="poses and points")  # fmt: skip
    order = np.concatenate([train_order[counts], held_out_order])
    pose = np.concatenate([looked_at.pose_id, -1 - held_out.pose_id])  # numbered apart
    some = stretches(order)
    both = both.rows(some)
    parameters = identification.parameters
    seen, m = predict(identification.model, both), len(both)
    rows = seen.rows[:, :3]
    A = rows[..., parameters.free_index] * parameters.free_scale
    before = believed_before(identification)
    A = reduced(np.concatenate([A.reshape(3 * m, -1), before.A]))
    y = np.concatenate([seen.residual[:, :3].ravel(), before.y])
    return RowsInTime(order[some], pose[some], both.station, rows, both.covariance, A, y)


def stretches(order: Index) -> Index:
    """Rows (k,) in time whose likelihood is asked: all, or of many some stretches, spread out."""
    in_time = np.argsort(order, kind="stable")
    if len(in_time) <= MOST_ROWS:
        return in_time
    parts = np.array_split(in_time, MOST_ROWS // STRETCH)
    return np.concatenate([part[:STRETCH] for part in parts])


def beside_drift(
    X: Array, rows: Array, covariance: Array, pose: Index, shape: MisfitShape, misfit: float
) -> Beside:
    """Noise and misfit of rows in time; rows of one pose share its misfit, wherever they stand."""
    m, logarithm, blocks = len(pose), 0.0, []
    for some in same_count(pose):
        V = of_poses(shape, misfit, rows[some], covariance[some])
        at = (3 * some[:, :, None] + np.arange(3)).reshape(len(some), -1)
        blocks.append((at, np.linalg.solve(V, np.eye(V.shape[1]))))
        logarithm += float(np.linalg.slogdet(V)[1].sum())
    width = max(3, *(int(np.ptp(at, axis=1).max()) for at, _ in blocks))
    band, white = np.zeros((width + 1, 3 * m)), np.empty_like(X)
    for at, inverse in blocks:
        row, column = np.broadcast_arrays(at[:, :, None], at[:, None])
        low = row >= column
        band[(row - column)[low], column[low]] = inverse[low]
        white[at] = inverse @ X[at]
    return Beside(band, np.asfortranarray(white), X.T @ white, logarithm)


def _restricted(square: Array, logarithm: float) -> float:
    """Restricted log-likelihood from [A, y]' inv(V) [A, y] and ln|V|."""
    root = np.linalg.cholesky(square[:-1, :-1])
    b = solve_triangular(root, square[:-1, -1], lower=True, check_finite=False)
    logarithm += 2 * float(np.log(np.diag(root)).sum())
    return -0.5 * (logarithm + float(square[-1, -1] - b @ b))
