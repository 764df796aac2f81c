"""Scores of observations that fit an identification badly, from residual and leverage."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from calib.arrays import Array, Bool, Index
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.identification.prior import prior_rows
from calib.identification.result import Identification
from calib.identification.tangent import covariance_factor
from calib.measurement.observations import Measurements
from calib.measurement.residual import linearize
from calib.shown import Shown

UNCHECKED = 1e-9
"""Eigenvalue of I - H up to which a direction of a row is not checked by any other row."""


@dataclass(frozen=True, slots=True, eq=False)
class Outliers(Shown):
    """How well each observation fits the others."""

    score: Array
    """(m,) r'inv(I - H) r of its whitened residual: chi-square if the observation is sound."""
    limit: Array
    """(m,) limit of the score: in a table of sound observations, any of them exceeds its limit with
    the probability `chance` (5 % by default)."""

    def __repr__(self) -> str:
        return f"Outliers({self.suspect.sum()} of {len(self.score)} observations suspect)"

    @property
    def suspect(self) -> Bool:
        """(m,) observations beyond the limit."""
        return np.asarray(self.score > self.limit)

    def sentences(self, measurements: Measurements) -> tuple[str, ...]:
        """One sentence per suspect, worst first, that names its pose and row."""
        rows = np.flatnonzero(self.suspect)
        several = len(np.unique(measurements.pose_id)) < len(measurements)
        return tuple(
            f"pose {measurements.pose_id[j]}"
            f"{f' at visit {measurements.repeat[j]}' if several else ''} (row {j}) does not fit "
            f"the others: its score is {self.score[j]:.0f} where a sound one stays below "
            f"{self.limit[j]:.1f}; measure it again or leave it out"
            for j in rows[np.argsort(-self.score[rows], kind="stable")]
        )


def outliers(
    r: Array,
    A: Array,
    row_of: Index,
    *,
    chance: float = 0.05,
    prior: Array | None = None,
    weights: Array | None = None,
) -> Outliers:
    """Judge each observation by its residual and leverage.

    Parameters
    ----------
    r : (N,) array
        Whitened residual at the end of the fit.
    A : (N, f) array
        Whitened Jacobian of the estimated numbers there.
    row_of : (N,) array of int
        Observation of each row; rows of one observation stand together.
    chance : float
        Probability that a sound table has any suspect at all (Bonferroni).
    prior : (k, f) array, optional
        Whitened rows of the prior.
    weights : (m,) array, optional
        Weight of each observation in a robust fit. One of weight zero is judged by the others
        alone.

    References
    ----------
    r_j' inv(I - H_jj) r_j against the chi-square quantile at 1 - chance / m. With weights the
    covariance of r_j is I - 2 w_j A_j inv(H) A_j' + A_j C A_j', C the sandwich.
    """
    rows = np.zeros((0, A.shape[1])) if prior is None else prior
    counts = np.bincount(row_of)
    w = np.ones(len(counts)) if weights is None else weights
    K = covariance_factor(np.concatenate([np.sqrt(w)[row_of, None] * A, rows]))
    B = A @ K
    if weights is None:
        D, pull = B, np.ones(len(w))
    else:
        # sandwich covariance: of the numbers, then of the prediction of each row
        moved, believed = w[row_of, None] * B, rows @ K
        D, pull = B @ (moved.T @ moved + believed.T @ believed), w
    score, checked = np.zeros(len(counts)), np.zeros(len(counts))
    for size in np.unique(counts[counts > 0]):
        which = np.flatnonzero(counts == size)
        of_size = np.isin(row_of, which)
        every = slice(None) if of_size.all() else of_size
        near, far = (X[every].reshape(len(which), size, -1) for X in (B, D))
        spread = (
            np.eye(size)
            - 2 * pull[which, None, None] * (near @ np.swapaxes(near, -1, -2))
            + far @ np.swapaxes(near, -1, -2)
        )
        freedom, axes = np.linalg.eigh((spread + np.swapaxes(spread, -1, -2)) / 2)
        along = (r[of_size].reshape(len(which), 1, size) @ axes)[:, 0]
        known = freedom > UNCHECKED
        score[which] = np.sum(np.where(known, along**2, 0) / np.where(known, freedom, 1), axis=1)
        checked[which] = known.sum(1)
    limit = chdtri(np.maximum(checked, 1), chance / len(counts))
    return Outliers(score, np.where(checked > 0, limit, np.inf))


def inspect(
    nominal: RobotModel, result: Identification, measurements: Measurements, *, chance: float = 0.05
) -> Outliers:
    """Judge every observation of the table that a model was identified from.

    After an ordinary least-squares fit, one gross error spoils the scores of its neighbors. If
    there may be some, identify with a robust loss and inspect that fit.

    Parameters
    ----------
    nominal : RobotModel
        Start of the fit, from which the prior is counted.
    result : Identification
        Result of the fit, in the mode *whitened*.
    measurements : Measurements
        The table it was identified from.
    chance : float
        Probability that a sound table has any suspect at all.
    """
    if result.mode != "whitened":
        message = "an identification in paper mode cannot be inspected: it ignores the noise"
        fix = 'identify in the mode "whitened"'
        raise refuse("result", result.mode, code="A3", message=message, fix=fix)
    stack = linearize(result.model, measurements)
    columns = result.parameters.free_index
    A, prior = stack.A[:, columns], None
    if result.prior is not None:
        belief = prior_rows(result.prior, nominal, result.parameters)
        prior = belief.at(result.model)[1][:, columns]
    weights = None if result.loss == "squared" else result.weights
    return outliers(stack.r, A, stack.row_of, chance=chance, prior=prior, weights=weights)
