"""One judge for every claim of uncertainty: bias, NEES and coverage against bands of chance."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from calib.arrays import Array

LEVEL = 0.999
"""Chance that a sound estimator falls inside one band."""


@dataclass(frozen=True, slots=True)
class Band:
    """What chance allows a statistic of a sound estimator to be."""

    low: float
    high: float

    def __contains__(self, value: object) -> bool:
        return isinstance(value, float) and self.low <= value <= self.high


def nees_band(p: int, replications: int, level: float = LEVEL) -> Band:
    """Band of the mean of chi-square(p) over replications."""
    tails = [(1 - level) / 2, (1 + level) / 2]
    low, high = stats.chi2.ppf(tails, p * replications) / replications
    return Band(float(low), float(high))


def coverage_band(replications: int, probability: float = 0.95, level: float = LEVEL) -> Band:
    """Band of the share of intervals that hold the truth."""
    tails = [(1 - level) / 2, (1 + level) / 2]
    low, high = stats.binom.ppf(tails, replications, probability) / replications
    return Band(float(low), float(high))


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What replications say of an estimator and its covariance."""

    nees: float
    """Mean of e'inv(C)e; p if sound."""
    nees_band: Band
    bias: float
    """n ebar'inv(Cbar)ebar; chi-square with p degrees of freedom if there is no bias."""
    bias_limit: float
    coverage: Array
    """(p,) share of 95 % intervals that hold the truth."""
    coverage_band: Band

    @property
    def sound(self) -> bool:
        """Whether every statistic lies where chance allows."""
        return (
            self.nees in self.nees_band
            and self.bias <= self.bias_limit
            and all(float(share) in self.coverage_band for share in self.coverage)
        )


def judge(errors: Array, covariances: Array, *, quantile: float = 1.959963984540054) -> Verdict:
    """Judge errors (n, p), estimate minus truth, against the covariances (n, p, p) stated for them.

    `quantile` times the standard uncertainty is the half-width of the intervals stated at 95 %.
    Every parameter has its own chance to fall outside by luck: the coverage band is Bonferroni's.
    """
    n, p = errors.shape
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    mean = errors.mean(0)
    sd = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    return Verdict(
        nees=float(np.sum(errors * solved, axis=1).mean()),
        nees_band=nees_band(p, n),
        bias=float(n * mean @ np.linalg.solve(covariances.mean(0), mean)),
        bias_limit=float(stats.chi2.ppf(LEVEL, p)),
        coverage=(np.abs(errors) <= quantile * sd).mean(0),
        coverage_band=coverage_band(n, level=1 - (1 - LEVEL) / p),
    )
