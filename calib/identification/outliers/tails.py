"""Residuals with longer tails than normal noise: a few rows hold most of their squares.

Noise with such tails and a misfit in a few places look alike where each pose is read once. Visits
of one pose tell them apart: a misfit stays the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc, chdtri, gammaln

from calib.arrays import Array
from calib.identification.result import Identification
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.measurement.residual import padded_covariance
from calib.shown import Shown

Source = Literal["", "noise", "misfit"]
LEVEL = 0.001
"""Chance of tails so long, of normal residuals, below which they are told."""
NONE = 0.05
"""The same of what visits differ by, from which on they show no such tails."""
DEGREES = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0])
"""Degrees of freedom of Student's t that are tried."""
ROUNDS = 100
"""Steps to the scale of each of them; they come ten times nearer in five or less."""
FEWEST = 20
"""Poses below which no tails are asked about."""
MOST = 0.6
"""Part of the rows that normal noise needs for half of all squares, above which tails are mild: a
misfit that is larger in some places than in others has such."""
UNCHECKED = 0.05
"""Part of the variance of a residual, below which other rows hardly check that direction."""


@dataclass(frozen=True, slots=True)
class LongTails(Shown):
    """How much longer tails of position residuals are than those of normal noise."""

    degrees: float
    """Degrees of freedom of the Student's t that describes them best."""
    p_value: float
    """Chance of describing normal residuals so much better."""
    few: int
    """Rows that hold half of all squares, the worst ones."""
    usual: int
    """How many rows would, of normal noise."""
    rows: int
    source: Source
    """What visits of one pose speak for, the noise or a misfit; empty where they do not tell."""

    @property
    def sentence(self) -> str:
        """The result in words."""
        worst = f"the worst {self.few} of {self.rows} rows hold" if self.few > 1 else (
            f"one of {self.rows} rows holds"
        )  # fmt: skip
        text = (
            f"the residuals have longer tails than normal noise (p < {LEVEL}): Student's t with "
            f"{self.degrees:g} degrees of freedom describes them better, and {worst} half of all "
            f"squares, where normal noise needs {self.usual}"
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
        """What lets so few rows pull the numbers less, in words."""
        return 'with loss = "huber" or "cauchy", these few rows have less influence'


def long_tails(
    identification: Identification, used: Measurements, others: Measurements
) -> LongTails | None:
    """Whether position residuals have longer tails than normal ones of any size; None if not.

    Parameters
    ----------
    identification : Identification
        In the mode *whitened*.
    used, others : Measurements
        What it was identified from, and what it never saw.

    References
    ----------
    r'inv(V) r of each row, V its covariance with what the estimate adds, or takes from it, against
    the multivariate Student's t: twice the logarithm of the likelihood ratio to the normal
    distribution, both of the best scale, is half chi2_1 where that holds.
    """
    tables = [table for table in (used, others) if len(table)]
    parts = [_squares(identification, table, 1.0 if table is others else -1.0) for table in tables]
    square, freedom, weight = np.concatenate([np.zeros((3, 0)), *parts], axis=1)
    known = freedom > 0
    square, freedom, weight = square[known], freedom[known], weight[known]
    if weight.sum() < FEWEST:
        return None
    degrees, p = student(square, freedom, weight)
    if p >= LEVEL:
        return None
    usual = chdtrc(3, chdtri(5, 0.5))  # of chi2_3 squares beyond x the share of the sum is chi2_5
    ranked = np.cumsum(np.sort(square)[::-1])
    few = 1 + int(np.searchsorted(ranked, ranked[-1] / 2))
    if few > MOST * usual * len(square):
        return None
    source = _of_visits([_between_visits(identification, table) for table in tables])
    return LongTails(degrees, p, few, round(usual * len(square)), len(square), source)


def student(square: Array, freedom: Array, weight: Array) -> tuple[float, float]:
    """Degrees of the t that describes squares best, and the chance of that if they are normal.

    Parameters
    ----------
    square : (m,) array
        Whitened squares of observations.
    freedom : (m,) array
        Directions in each.
    weight : (m,) array
        How many observations each counts for.
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
    """Whitened squares, directions and weights (3, m) of position residuals.

    By `sign` the estimate is a part of them, -1, or adds to their variance, 1.
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
    # rows of one pose share its misfit: they count as one
    _, pose, rows = np.unique(table.pose_id, return_inverse=True, return_counts=True)
    return np.stack([square.sum(axis=1), checked.sum(axis=1), 1 / rows[pose.ravel()]])


def _between_visits(identification: Identification, table: Measurements) -> Array:
    """Squares, directions and weights (3, k) of what visits of a pose and target differ by."""
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
    """What the differences of visits, from `_between_visits`, say of long tails."""
    square, freedom, weight = np.concatenate(parts, axis=1)
    if weight.sum() < FEWEST:
        return ""
    _, p = student(square, freedom, weight)
    return "noise" if p < LEVEL else "misfit" if p >= NONE else ""
