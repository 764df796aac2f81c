"""The likelihood of a drift beside noise and misfit, at the cost of a band."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpbtrf, dtbtrs

from calib.arrays import Array, Index
from calib.uncertainty.statement.shape import MisfitShape, of_poses, same_count


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
