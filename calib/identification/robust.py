"""Robust losses (M-estimators): one weight per observation, and the covariance of the estimate.

An observation of rows r_j, whitened, has the size s = |r_j| / sqrt(rows), about 1 if it is sound.
"""

from typing import Literal

import numpy as np

from calib.arrays import Array, Index
from calib.identification.tangent import covariance_factor

Loss = Literal["squared", "huber", "cauchy"]
LOSSES: tuple[Loss, ...] = ("squared", "huber", "cauchy")
HUBER = 1.5
"""Size from which Huber's loss grows like s instead of s^2."""
CAUCHY = 2.0
"""Size at which Cauchy's weight is one half."""


def sizes(r: Array, row_of: Index) -> Array:
    """Size (m,) of each observation: root mean square of its whitened rows (N,)."""
    rows = np.bincount(row_of)
    return np.sqrt(np.bincount(row_of, r * r) / np.maximum(rows, 1))


def loss_weights(size: Array, loss: Loss) -> Array:
    """Weight (m,), 0 to 1, of each observation in iteratively reweighted least squares.

    Huber's is min(1, 1.5 / s), Cauchy's 1 / (1 + (s / 2)^2).
    """
    if loss == "huber":
        return np.asarray(HUBER / np.maximum(size, HUBER))
    if loss == "cauchy":
        return np.asarray(1 / (1 + (size / CAUCHY) ** 2))
    return np.ones_like(size)


def mean_loss(size: Array, loss: Loss) -> Array:
    """Loss (m,) of each observation per row; s^2 for small s, derivative by s^2: the weight."""
    if loss == "huber":
        near = np.minimum(size, HUBER)
        return np.asarray(near**2 + 2 * HUBER * (size - near))
    if loss == "cauchy":
        return np.asarray(CAUCHY**2 * np.log1p((size / CAUCHY) ** 2))
    return np.asarray(size**2)


def flattened(r: Array, A: Array, row_of: Index, loss: Loss) -> tuple[Array, Array]:
    """Residual (N,) whose sum of squares is the total loss, and its exact derivative (N, f).

    The residual of each observation is scaled to r_j sqrt(loss_j) / |r_j|, so that a solver for
    plain least squares minimizes the robust loss exactly and certifies its minimum. Reweighted
    least squares has the same minimum, but would have to freeze its weights during each step.

    Parameters
    ----------
    r : (N,) array
        Whitened residual; rows of one observation stand together.
    A : (N, f) array
        Derivative of the prediction.
    row_of : (N,) array of int
        Observation of each row; every observation has rows.
    loss : {"squared", "huber", "cauchy"}
        The loss.
    """
    if loss == "squared":
        return r, A
    size = sizes(r, row_of)
    safe = np.where(size > 0, size, 1.0)
    shorter = np.where(size > 0, np.sqrt(mean_loss(size, loss)) / safe, 1.0)
    # along the residual itself the loss rises more slowly than across it
    along = loss_weights(size, loss) / shorter**2 - 1
    starts = np.flatnonzero(np.diff(row_of, prepend=-1))
    rows = np.bincount(row_of)
    unit = r / (safe * np.sqrt(np.maximum(rows, 1)))[row_of]
    drift = np.add.reduceat(unit[:, None] * A, starts)[row_of]
    factor = shorter[row_of]
    return factor * r, factor[:, None] * (A + (along[row_of] * unit)[:, None] * drift)


def sandwich_factor(A: Array, row_of: Index, weights: Array, scatter: Array, prior: Array) -> Array:
    """K (f, N + k) with K K' the sandwich covariance of an M-estimate.

    Parameters
    ----------
    A : (N, f) array
        Whitened derivative at the answer.
    row_of : (N,) array of int
        Observation of each row.
    weights : (m,) array
        Weight of each observation in the fit.
    scatter : (m,) array
        Actual standard deviation of the whitened rows of each observation; 1 if as stated.
    prior : (k, f) array
        Whitened rows of the prior; may be empty.

    Notes
    -----
    C = inv(H) (J'W S W J + Lambda0) inv(H), H = J'W J + Lambda0, with the final weights W.
    """
    root = covariance_factor(np.concatenate([np.sqrt(weights)[row_of, None] * A, prior]))
    moved = np.concatenate([(weights * scatter)[row_of, None] * A, prior])
    return np.asarray(root @ (moved @ root).T)
