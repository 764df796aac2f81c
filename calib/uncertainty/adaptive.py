"""Adaptive Monte Carlo (JCGM 101 and 102): as many draws as the wanted digits need."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from calib.arrays import Array, check, frozen
from calib.errors import InputError
from calib.uncertainty.covariance import correlation
from calib.uncertainty.monte_carlo import numerical_tolerance

Sample = Callable[[int, np.random.Generator], Array]
"""(M, rng) -> M values of the output: (M,), or (M, k) for `adaptive_vector`."""
BATCH = 10_000
MOST_DRAWS = 20_000_000
"""Draws after which to give up: 160 MB per output."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """What the draws of one output say."""

    mean: float
    standard: float
    """Standard uncertainty u."""
    interval: tuple[float, float]
    """Ends with equal probability beyond each."""
    shortest: tuple[float, float]
    """Ends of the shortest interval of that content; its width is certain, its place less so."""
    probability: float
    draws: int


@dataclass(frozen=True, slots=True, eq=False)
class Adaptive:
    """Outcome of the adaptive procedure for one output."""

    spread: Spread
    """From all draws."""
    tolerance: float
    """Numerical tolerance delta that was asked for."""
    error: Array
    """(4,) twice the standard error of mean, u, low end, high end, from the scatter of batches."""
    batches: int
    stable: bool
    """Whether all four errors came below the tolerance before the draws ran out."""
    sentence: str


def fewest_draws(probability: float) -> int:
    """Draws below which a batch has too few values beyond the ends: ceil(100 / (1 - p)).

    References
    ----------
    JCGM 101:2008, 7.9.4 b.
    """
    _probability(probability)
    # 1 - 0.95 is not quite 0.05: the ceiling must not see it
    return int(np.ceil(100 / (1 - probability) - 1e-6))


def spread(values: ArrayLike, *, probability: float = 0.95) -> Spread:
    """Mean, standard uncertainty and coverage intervals of the draws (M,) of an output.

    Raises
    ------
    InputError
        Fewer draws than `fewest_draws`: the ends of the interval would rest on a handful of values.

    References
    ----------
    JCGM 101:2008, 7.6, 7.7, 5.3.4 (shortest interval).
    """
    (values,) = check("k", values=values)
    return _spread(values, _enough(len(values), probability, "values"))


def _spread(values: Array, probability: float) -> Spread:
    """`spread` of trusted values."""
    M = len(values)
    ordered = np.sort(values)
    inner = int(probability * M + 0.5)
    first = (M - inner) // 2
    widths = ordered[inner:] - ordered[: M - inner]
    short = int(np.argmin(widths))
    return Spread(
        float(values.mean()),
        float(values.std(ddof=1)),
        (float(ordered[first]), float(ordered[min(first + inner, M - 1)])),
        (float(ordered[short]), float(ordered[short + inner])),
        probability,
        M,
    )


def adaptive(
    sample: Sample,
    rng: np.random.Generator,
    *,
    digits: int = 2,
    probability: float = 0.95,
    finer: float = 1.0,
    batch: int | None = None,
    most: int = MOST_DRAWS,
) -> Adaptive:
    """Draw batch after batch until mean, u and both ends are certain to `digits` digits of u.

    Parameters
    ----------
    sample : callable
        (M, rng) -> (M,) values of the output: inputs drawn and sent through the model, all at once.
    rng : numpy.random.Generator
        Handed to `sample`.
    digits : int
        Significant digits of u that must mean something, 1 to 4.
    probability : float
        Content of the interval.
    finer : float
        Divides the tolerance; 5 before a validation (JCGM 101:2008, 8.2).
    batch : int, optional
        Draws per batch: max(10 000, 100 / (1 - p)).
    most : int
        Draws after which to stop all the same; the sentence then says so.

    Notes
    -----
    The rule looks at scatter estimated from few batches, so it stops too early now and then: each
    output lies within the tolerance in some 9 of 10 runs, not in all.

    References
    ----------
    JCGM 101:2008, 7.9.4.
    """
    size = batch_size(digits, probability, finer, batch, most)
    values: list[Array] = []
    rows: list[tuple[float, ...]] = []
    tolerance, error = 0.0, np.full(4, np.inf)
    # u of all draws so far, gathered batch by batch about the first mean
    sums, center = np.zeros(2), 0.0
    stable = False
    while not stable and (len(rows) + 1) * size <= most:
        (y,) = check(f"{size}", sample=sample(size, rng))
        values.append(y)
        part = _spread(y, probability)
        rows.append((part.mean, part.standard, *part.interval))
        center = rows[0][0]
        sums += ((y - center).sum(), np.square(y - center).sum())
        h = len(rows)
        if h < 2:
            continue
        total = h * size
        u = float(np.sqrt((sums[1] - sums[0] ** 2 / total) / (total - 1)))
        tolerance = tolerance_of(u, digits) / finer
        error = 2 * np.std(rows, axis=0, ddof=1) / np.sqrt(h)
        stable = bool((error <= tolerance).all())
    return Adaptive(
        _spread(np.concatenate(values), probability),
        tolerance,
        frozen(error),
        len(rows),
        stable,
        outcome(stable, len(rows) * size, len(rows), tolerance),
    )


def tolerance_of(standard: float, digits: int) -> float:
    """`numerical_tolerance`, for an output that must scatter."""
    if not standard > 0:
        raise InputError(
            "an output does not scatter: all its draws are equal",
            code="A3",
            field="sample",
            value=standard,
            allowed="a standard uncertainty above zero",
            fix="give at least one input an uncertainty",
        )
    return numerical_tolerance(standard, digits)


def batch_size(digits: int, probability: float, finer: float, batch: int | None, most: int) -> int:
    """Draws per batch, with all options checked."""
    if digits not in (1, 2, 3, 4) or not finer >= 1:
        raise InputError(
            f"digits is {digits} and finer {finer}",
            code="A3",
            field="digits",
            value=digits,
            allowed="1, 2, 3 or 4 digits; finer 1 or more",
        )
    size = max(BATCH, fewest_draws(probability)) if batch is None else batch
    _enough(size, probability, "batch")
    if most < 2 * size:
        raise InputError(
            f"most is {most}",
            code="A3",
            field="most",
            value=most,
            allowed=f"two batches at least, {2 * size}",
        )
    return size


def _enough(draws: int, probability: float, field: str) -> float:
    """The probability, if so many draws can say something about it."""
    need = fewest_draws(probability)
    if draws < need:
        raise InputError(
            f"{draws} draws for {100 * probability:g} % coverage",
            code="A3",
            field=field,
            value=draws,
            allowed=f"at least {need}: fewer leave too few values beyond the ends",
            fix="take more draws or ask for less coverage",
        )
    return probability


def _probability(probability: float) -> None:
    """Refuse what is not a probability strictly between 0 and 1."""
    if not 0 < probability < 1:
        raise InputError(
            f"probability is {probability}",
            code="C41",
            field="probability",
            value=probability,
            allowed="between 0 and 1, e.g. 0.95",
        )


def outcome(stable: bool, draws: int, batches: int, tolerance: float) -> str:
    """How the procedure ended, in words."""
    if stable:
        return f"stable within {tolerance:.2g} after {draws} draws in {batches} batches"
    return (
        f"not stable within {tolerance:.2g} after {draws} draws; ask for fewer digits or allow "
        "more draws"
    )


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
