"""Adaptive Monte Carlo: as many draws as the digits asked for need, for one output."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen
from calib.errors import InputError
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
