"""Adaptive Monte Carlo for several outputs at once, with their coverage region."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from calib.arrays import Array, check, frozen
from calib.errors import InputError
from calib.uncertainty.adaptive import MOST_DRAWS, Sample, batch_size, outcome, tolerance_of
from calib.uncertainty.covariance import correlation

Region = Literal["ellipsoid", "box"]


@dataclass(frozen=True, slots=True, eq=False)
class AdaptiveVector:
    """Outcome of the adaptive procedure for k outputs together."""

    mean: Array
    """(k,) means."""
    covariance: Array
    """(k, k)."""
    largest_eigenvalue: float
    """Of the correlation matrix: 1 without correlation, k with nothing else."""
    factor: float
    """k_p of the region: reach in units of u (box) or of the Mahalanobis distance (ellipsoid)."""
    region: Region
    probability: float
    draws: int
    tolerance: Array
    """(2 k + 2,) of means, standard uncertainties, largest eigenvalue, factor."""
    error: Array
    """(2 k + 2,) twice the standard error of the same."""
    batches: int
    stable: bool
    sentence: str

    @property
    def standard(self) -> Array:
        """(k,) standard uncertainties."""
        return np.sqrt(np.diagonal(self.covariance))


def adaptive_vector(
    sample: Sample,
    rng: np.random.Generator,
    *,
    digits: int = 2,
    probability: float = 0.95,
    region: Region = "ellipsoid",
    finer: float = 1.0,
    batch: int | None = None,
    most: int = MOST_DRAWS // 4,
) -> AdaptiveVector:
    """The adaptive procedure for k outputs: means, u, largest eigenvalue of the correlation, k_p.

    Parameters
    ----------
    sample : callable
        (M, rng) -> (M, k) values of the outputs.
    region : {"ellipsoid", "box"}
        Shape that `factor` is for: the ellipsoid of the covariance, or the box of half widths k u.
    rng, digits, probability, finer, batch, most
        As in `adaptive`.

    References
    ----------
    JCGM 102:2011, 7.7 (regions), 7.8 (adaptive procedure).
    """
    if region not in ("ellipsoid", "box"):
        raise InputError(
            f'region is "{region}"', code="A3", field="region", allowed="ellipsoid or box"
        )
    size = batch_size(digits, probability, finer, batch, most)
    values: list[Array] = []
    rows: list[Array] = []
    tolerance = error = np.full(0, np.inf)
    sums: tuple[Array, Array] | None = None
    stable = False
    while not stable and (len(rows) + 1) * size <= most:
        (y,) = check(f"{size} k", sample=sample(size, rng))
        values.append(y)
        rows.append(_vector_row(y, probability, region))
        offset = y - values[0].mean(axis=0)
        new = (offset.sum(axis=0), offset.T @ offset)
        sums = new if sums is None else (sums[0] + new[0], sums[1] + new[1])
        h, k = len(rows), y.shape[1]
        if h < 2:
            continue
        total = h * size
        U = (sums[1] - np.outer(sums[0], sums[0]) / total) / (total - 1)
        u = [tolerance_of(float(v), digits) for v in np.sqrt(np.diagonal(U))]
        # eigenvalue and factor are treated like an uncertainty: digits of their own size
        largest = float(np.linalg.eigvalsh(correlation(U))[-1])
        factor = float(np.mean([row[-1] for row in rows]))
        extra = [tolerance_of(largest, digits), tolerance_of(factor, digits)]
        tolerance = np.array([*u, *u, *extra]) / finer
        error = 2 * np.std(rows, axis=0, ddof=1) / np.sqrt(h)
        stable = bool((error <= tolerance).all())
    whole = np.concatenate(values)
    row, k = _vector_row(whole, probability, region), whole.shape[1]
    return AdaptiveVector(
        frozen(row[:k]),
        frozen(np.cov(whole, rowvar=False).reshape(k, k)),
        float(row[-2]),
        float(row[-1]),
        region,
        probability,
        len(whole),
        frozen(tolerance),
        frozen(error),
        len(rows),
        stable,
        outcome(stable, len(whole), len(rows), float(tolerance.min(initial=np.inf))),
    )


def _vector_row(y: Array, probability: float, region: Region) -> Array:
    """Means, standard uncertainties, largest eigenvalue and factor (2 k + 2,) of draws (M, k)."""
    mean, U = y.mean(axis=0), np.cov(y, rowvar=False).reshape(y.shape[1], -1)
    u = np.sqrt(np.diagonal(U))
    rho = correlation(U)
    scaled = (y - mean) / u
    if region == "box":
        reach = np.abs(scaled).max(axis=1)
    else:
        try:
            root = np.linalg.cholesky(rho)
        except np.linalg.LinAlgError:
            raise InputError(
                "the outputs depend on each other exactly",
                code="A3",
                field="sample",
                allowed="outputs with a positive definite covariance",
                fix='leave one out, or ask for the region "box"',
            ) from None
        reach = np.linalg.norm(solve_triangular(root, scaled.T, lower=True), axis=0)
    inner = min(int(np.ceil(probability * len(y))), len(y)) - 1
    factor = np.partition(reach, inner)[inner]
    return np.array([*mean, *u, np.linalg.eigvalsh(rho)[-1], factor])
