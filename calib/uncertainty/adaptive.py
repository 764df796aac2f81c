"""Adaptive Monte Carlo (JCGM 101 and 102): as many draws as the wanted digits need."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from calib.arrays import Array, check, frozen, require_probability
from calib.errors import refuse
from calib.kinds import checked_kinds
from calib.shown import Shown
from calib.uncertainty.covariance import correlation
from calib.uncertainty.monte_carlo import numerical_tolerance

Sample = Callable[[int, np.random.Generator], Array]
"""(M, rng) -> M values of the k outputs (M, k)."""
BATCH = 10_000
MOST_DRAWS = 5_000_000
"""Draws after which to give up: 40 MB per output."""


@dataclass(frozen=True, slots=True, eq=False)
class Adaptive(Shown):
    """Outcome of the adaptive procedure for k outputs together."""

    mean: Array
    """(k,) means."""
    covariance: Array
    """(k, k)."""
    largest_eigenvalue: float
    """Of the correlation matrix: 1 without correlation, k with nothing else."""
    factor: float
    """k_p of the ellipsoid of the covariance: its reach as a Mahalanobis distance."""
    probability: float
    draws: int
    tolerance: Array
    """(2 k + 2,) of means, standard uncertainties, largest eigenvalue, factor."""
    error: Array
    """(2 k + 2,) twice the standard error of the same, from the scatter of batches."""
    batches: int
    stable: bool
    """Whether all errors came below the tolerance before the draws ran out."""
    sentence: str

    def __repr__(self) -> str:
        return f"Adaptive({len(self.mean)} outputs, {self.sentence})"

    @property
    def standard(self) -> Array:
        """(k,) standard uncertainties."""
        return np.sqrt(np.diagonal(self.covariance))


def fewest_draws(probability: float) -> int:
    """Draws below which a batch has too few values beyond the ends: ceil(100 / (1 - p)).

    References
    ----------
    JCGM 101:2008, 7.9.4 b.
    """
    require_probability(probability, "C41")
    # 1 - 0.95 is not quite 0.05: the ceiling must not see it
    return int(np.ceil(100 / (1 - probability) - 1e-6))


@checked_kinds
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
    """Draw batch after batch until means, u, correlation and k_p are certain to `digits` digits.

    Parameters
    ----------
    sample : callable
        (M, rng) -> (M, k) values of the outputs: inputs drawn and sent through the model, all at
        once.
    rng : numpy.random.Generator
        Handed to `sample`.
    digits : int
        Significant digits of u that must mean something, 1 to 4.
    probability : float
        Content of the ellipsoid.
    finer : float
        Divides the tolerance; 5 before a validation (JCGM 101:2008, 8.2).
    batch : int, optional
        Draws per batch: max(10 000, 100 / (1 - p)).
    most : int
        Draws after which to stop all the same; the sentence then states it.

    Notes
    -----
    The rule looks at scatter estimated from few batches, so it stops too early now and then: each
    output lies within the tolerance in some 9 of 10 runs, not in all.

    References
    ----------
    JCGM 101:2008, 7.9.4; JCGM 102:2011, 7.7 (ellipsoid), 7.8 (adaptive procedure).
    """
    size = _batch_size(digits, probability, finer, batch, most)
    values: list[Array] = []
    rows: list[Array] = []
    tolerance = error = np.full(0, np.inf)
    # covariance of all draws so far, gathered batch by batch about the first mean
    sums: tuple[Array, Array] | None = None
    stable = False
    while not stable and (len(rows) + 1) * size <= most:
        outputs = str(values[0].shape[1]) if values else "k"
        (y,) = check(f"{size} {outputs}", sample=sample(size, rng))
        values.append(y)
        rows.append(_figures(y, probability))
        offset = y - values[0].mean(axis=0)
        new = (offset.sum(axis=0), offset.T @ offset)
        sums = new if sums is None else (sums[0] + new[0], sums[1] + new[1])
        h, k = len(rows), y.shape[1]
        if h < 2:
            continue
        total = h * size
        U = (sums[1] - np.outer(sums[0], sums[0]) / total) / (total - 1)
        u = [numerical_tolerance(float(v), digits) for v in np.sqrt(np.diagonal(U))]
        # eigenvalue and factor are treated like an uncertainty: digits of their own size
        largest = float(np.linalg.eigvalsh(correlation(U))[-1])
        factor = float(np.mean([row[-1] for row in rows]))
        extra = [numerical_tolerance(v, digits) for v in (largest, factor)]
        tolerance = np.array([*u, *u, *extra]) / finer
        error = 2 * np.std(rows, axis=0, ddof=1) / np.sqrt(h)
        stable = bool((error <= tolerance).all())
    whole = np.concatenate(values)
    row, k = _figures(whole, probability), whole.shape[1]
    return Adaptive(
        mean=frozen(row[:k]),
        covariance=frozen(np.cov(whole, rowvar=False).reshape(k, k)),
        largest_eigenvalue=float(row[-2]),
        factor=float(row[-1]),
        probability=probability,
        draws=len(whole),
        tolerance=frozen(tolerance),
        error=frozen(error),
        batches=len(rows),
        stable=stable,
        sentence=_outcome(stable, len(whole), len(rows), float(tolerance.min(initial=np.inf))),
    )


def _batch_size(digits: int, probability: float, finer: float, batch: int | None, most: int) -> int:
    """Draws per batch, with all options checked."""
    require_digits(digits)
    if not finer >= 1:
        raise refuse("finer", finer, "1 or more", code="A3")
    need = fewest_draws(probability)
    size = max(BATCH, need) if batch is None else batch
    if size < need:
        raise refuse(
            "batch", size, f"at least {need}: fewer leave too few values beyond the ends",
            code="A3", message=f"{size} draws for {100 * probability:g} % coverage",
            fix="take more draws or ask for less coverage",
        )  # fmt: skip
    if most < 2 * size:
        raise refuse("most", most, f"two batches at least, {2 * size}", code="A3")
    return size


def require_digits(digits: int) -> None:
    """Refuse another number of significant digits than 1 to 4."""
    if digits not in (1, 2, 3, 4):
        raise refuse("digits", digits, "1, 2, 3 or 4", code="A3")


def _figures(y: Array, probability: float) -> Array:
    """Means, standard uncertainties, largest eigenvalue and factor (2 k + 2,) of draws (M, k)."""
    mean, U = y.mean(axis=0), np.cov(y, rowvar=False).reshape(y.shape[1], -1)
    u = np.sqrt(np.diagonal(U))
    if not (u > 0).all():
        raise refuse(
            "sample", float(u.min()), "a standard uncertainty above zero", code="A3",
            message="an output does not scatter: all its draws are equal",
            fix="give at least one input an uncertainty",
        )  # fmt: skip
    rho = correlation(U)
    scaled = (y - mean) / u
    try:
        root = np.linalg.cholesky(rho)
    except np.linalg.LinAlgError:
        message = "the outputs depend on each other exactly"
        allowed, fix = "outputs with a positive definite covariance", "leave one out"
        raise refuse("sample", allowed=allowed, code="A3", message=message, fix=fix) from None
    reach = np.linalg.norm(solve_triangular(root, scaled.T, lower=True), axis=0)
    inner = min(int(np.ceil(probability * len(y))), len(y)) - 1
    factor = np.partition(reach, inner)[inner]
    return np.array([*mean, *u, np.linalg.eigvalsh(rho)[-1], factor])


def _outcome(stable: bool, draws: int, batches: int, tolerance: float) -> str:
    """How the procedure ended, in words."""
    if stable:
        return f"stable within {tolerance:.2g} after {draws} draws in {batches} batches"
    return (
        f"not stable within {tolerance:.2g} after {draws} draws; ask for fewer digits or allow "
        "more draws"
    )
