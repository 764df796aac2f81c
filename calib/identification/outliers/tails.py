"""Residuals with longer tails than normal noise, where a few rows have most of the squares.

Noise with such tails and a misfit in a few places look alike if each pose is measured once.
Repeated visits to a pose tell them apart, since a misfit stays the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from scipy.special import chdtrc, chdtri, gammaln

from calib.arrays import LATER, Array
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import padded_covariance
from calib.shown import Shown

Source = Literal["", "noise", "misfit"]
LEVEL = 0.001
"""Probability of tails as long for normal residuals, below which long tails are reported."""
NONE = 0.05
"""The same probability for differences between visits, from which on these have no such tails."""
DEGREES = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0])
"""Degrees of freedom of Student's t that are tried."""
ROUNDS = 100
"""Iterations for the scale of each of them; five or fewer reduce the error ten times."""
FEWEST = 20
"""Fewest poses for a statement about tails."""
MOST_NAMED = 3
"""Poses of the worst rows that are named, where all of these are so few."""
MOST = 0.6
"""Rows with half of all squares, as a fraction of those that normal noise needs; above it tails are
mild, as those of a misfit that is larger in some places than in others."""
UNCHECKED = 0.05
"""Variance of a whitened residual below which other rows hardly check that direction."""


@dataclass(frozen=True, slots=True)
class LongTails(Shown):
    """Position residuals with longer tails than normal noise."""

    degrees: float
    """Degrees of freedom of the Student's t that describes them best."""
    p_value: float
    """Probability that Student's t describes normal residuals so much better."""
    few: int
    """Number of rows, the worst ones, that have half of all squares."""
    usual: int
    """Number of rows that normal noise would need for it."""
    rows: int
    source: Source
    """Source that repeated visits indicate, the noise or a misfit; empty if they do not show it."""
    poses: Annotated[tuple[int, ...], LATER] = ()
    """Poses of these few rows, the worst first; empty if they are more than can be named."""

    @property
    def sentence(self) -> str:
        """The result in words, poses by their numbers."""
        return self.said_of([str(pose) for pose in self.poses])

    def worst_words(self, names: Sequence[str]) -> str:
        """Which rows have half of all squares, by the names (k,) of `poses`."""
        which = f" (pose{'s' if len(names) > 1 else ''} {', '.join(names)})" if names else ""
        worst = f"the worst {self.few} of {self.rows} rows{which} hold"
        if self.few == 1:
            worst = f"one of {self.rows} rows{which} holds"
        return f"{worst} half of all squares, where normal noise needs {self.usual}"

    def said_of(self, names: Sequence[str]) -> str:
        """The result in words, by the names (k,) of `poses`."""
        text = (
            f"the residuals have longer tails than normal noise (p < {LEVEL}): Student's t with "
            f"{self.degrees:g} degrees of freedom describes them better, and "
            f"{self.worst_words(names)}"
        )
        if self.source == "noise":
            return f"{text}; repeated visits to one pose scatter in the same way: it is the noise"
        if self.source == "misfit":
            return (
                f"{text}; repeated visits to one pose show no such tails, which suggests a misfit "
                "in a few places"
            )
        return (
            f"{text}; noise with such tails and a misfit in a few places look alike here: the "
            "region allows for either, and a second visit of every pose would tell them apart"
        )

    @property
    def remedy(self) -> str:
        """How to reduce the influence of these few rows, in words."""
        return 'with loss = "huber" or "cauchy", these few rows have less influence'


def long_tails(
    identification: Identification, used: Measurements, others: Measurements
) -> LongTails | None:
    """Longer tails of position residuals than those of normal noise of any scale; None without any.

    Parameters
    ----------
    identification : Identification
        Result in the mode *whitened*.
    used, others : Measurements
        Rows it was identified from, and rows that it did not use.

    References
    ----------
    r'inv(V) r of each row against the multivariate Student's t; V is the covariance of the noise
    plus that of the estimate, or minus it for rows that were used. Twice the log likelihood ratio
    to the normal distribution, each at its best scale, is an equal mixture of 0 and chi2_1 for
    normal residuals.
    """
    tables = [table for table in (used, others) if len(table)]
    parts = [_squares(identification, table, 1.0 if table is others else -1.0) for table in tables]
    square, freedom, weight = np.concatenate([np.zeros((3, 0)), *parts], axis=1)
    known = freedom > 0
    square, freedom, weight = square[known], freedom[known], weight[known]
    pose = np.concatenate([np.zeros(0, int), *(table.pose_id for table in tables)])[known]
    if weight.sum() < FEWEST:
        return None
    degrees, p = student(square, freedom, weight)
    if p >= LEVEL:
        return None
    usual = chdtrc(3, chdtri(5, 0.5))  # of chi2_3 squares beyond x the share of the sum is chi2_5
    order = np.argsort(-square, kind="stable")
    ranked = np.cumsum(square[order])
    few = 1 + int(np.searchsorted(ranked, ranked[-1] / 2))
    if few > MOST * usual * len(square):
        return None
    source = _of_visits([_between_visits(identification, table) for table in tables])
    worst = tuple(dict.fromkeys(pose[order[:few]].tolist())) if few <= MOST_NAMED else ()
    return LongTails(degrees, p, few, round(usual * len(square)), len(square), source, worst)


def student(square: Array, freedom: Array, weight: Array) -> tuple[float, float]:
    """Degrees of freedom of Student's t that describes squares best, and its p-value if normal.

    Parameters
    ----------
    square : (m,) array
        Whitened squares of observations.
    freedom : (m,) array
        Number of directions in each.
    weight : (m,) array
        Number of observations that each counts for.
    """
    total = float(weight @ freedom)
    size = float(weight @ square) / total
    if size <= 0:
        return float("inf"), 1.0
    normal = -total * (np.log(2 * np.pi * size) + 1) / 2
    nu = DEGREES[:, None]
    scale = np.full((len(DEGREES), 1), size)
    for _ in range(ROUNDS):  # expectation and maximization
        pull = (nu + freedom) / (nu + square / scale)
        scale = ((pull * square) @ weight / total)[:, None]
    each = (
        gammaln((nu + freedom) / 2)
        - gammaln(nu / 2)
        - freedom / 2 * np.log(np.pi * nu * scale)
        - (nu + freedom) / 2 * np.log1p(square / (nu * scale))
    )
    value = each @ weight
    best = int(np.argmax(value))
    ratio = 2 * float(value[best] - normal)
    return float(DEGREES[best]), float(chdtrc(1, ratio) / 2) if ratio > 0 else 1.0


def _squares(identification: Identification, table: Measurements, sign: float) -> Array:
    """Whitened squares, numbers of directions and weights (3, m) of position residuals.

    `sign` is -1 for rows that the estimate used, which reduces their variance, and 1 for others.
    """
    seen, free = predict(identification.model, table), identification.parameters.free_index
    root = np.linalg.cholesky(padded_covariance(table)[:, :3, :3])
    r = np.linalg.solve(root, seen.residual[:, :3, None])
    A = np.linalg.solve(root, seen.rows[:, :3, free])
    V = np.eye(3) + sign * A @ identification.covariance @ np.swapaxes(A, 1, 2)
    variance, axes = np.linalg.eigh(V)
    along = (np.swapaxes(axes, 1, 2) @ r)[:, :, 0]
    # directions without an entry have no residual
    checked = (variance > UNCHECKED) & ((axes**2 * seen.filled[:, :3, None]).sum(axis=1) > 0.5)
    square = np.where(checked, along**2 / np.where(checked, variance, 1.0), 0.0)
    # rows of one pose share its misfit, and count as one
    _, pose, rows = np.unique(table.pose_id, return_inverse=True, return_counts=True)
    return np.stack([square.sum(axis=1), checked.sum(axis=1), 1 / rows[pose.ravel()]])


def _between_visits(identification: Identification, table: Measurements) -> Array:
    """Squares, directions and weights (3, k) of differences between visits of a pose and target."""
    points = table.rows(~table.is_distance)
    keys = np.column_stack([points.pose_id, points.target_key])
    _, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    group, several = group.ravel(), count > 1
    residual = predict(identification.model, points).residual[:, :3]
    mean = np.stack([np.bincount(group, axis) for axis in residual.T], axis=1) / count[:, None]
    rows = several[group]
    left = 1 - 1 / count[group][rows]
    off = (residual - mean[group])[rows, :, None]
    white = np.linalg.solve(np.linalg.cholesky(points.covariance[rows, :3, :3]), off)[:, :, 0]
    return np.stack([(white**2).sum(axis=1) / left, np.full(len(left), 3.0), left])


def _of_visits(parts: Sequence[Array]) -> Source:
    """Source of long tails by the differences between visits, from `_between_visits`."""
    square, freedom, weight = np.concatenate(parts, axis=1)
    if weight.sum() < FEWEST:
        return ""
    _, p = student(square, freedom, weight)
    return "noise" if p < LEVEL else "misfit" if p >= NONE else ""
