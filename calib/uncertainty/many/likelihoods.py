"""The likelihood of a misfit, computed at a few sizes and interpolated by polynomials."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from calib.arrays import Array, frozen
from calib.uncertainty.statement.evidence import PositionRows, reduced
from calib.uncertainty.statement.likelihood import HOPELESS, Grid, Likelihood, missed
from calib.uncertainty.statement.likelihood_systems import SMALL, OfNumbers, Pools, systems_of

PARTS = ((2.4, 16), (3.0, 18))
"""Length in s = ln(1 + c t^2) and number of terms of the first polynomial and of all others; see
below. Most robots with little misfit need only the first."""
ALIKE, LIKE_NOISE, UNLIKELY = 3.0, 2.0, 10.0
"""If the shares of misfit of all rows differ by less than a factor exp(3), and their mean square
without misfit is below twice that of noise, then the log-likelihood has a single peak, and the
search ends after a drop by ten instead of `HOPELESS`. Otherwise a few rows of small shares may
require a size that all others contradict, with a second peak behind the drop."""
POOLS = 16
"""Most sums over rows that replace one sum for each size."""


class _OfSizes(NamedTuple):
    """What is found of the sizes of one table."""

    every: Array
    """(3, nodes, k) as in `Grid.profile`."""
    rows: int
    numbers: int


def likelihoods_between(
    tables: Sequence[PositionRows], units: Array, priors: Sequence[PositionRows | None]
) -> list[Likelihood | None]:
    """`likelihood` to 1e-10, for tables without repeats that show the scale of the noise.

    `units` (R,) and `priors` are those of each table [m]. Tables with the same numbers of rows and
    of numbers are profiled together.
    """
    alike: dict[tuple[tuple[int, ...], int, int], list[tuple[int, Array]]] = {}
    for k, one in enumerate(zip(tables, units.tolist(), priors, strict=True)):
        found = _of_sizes(*one)
        if found is not None:
            key = found.every.shape, found.rows, found.numbers
            alike.setdefault(key, []).append((k, found.every))
    profiled: list[Likelihood | None] = [None] * len(tables)
    for (_, n, p), some in alike.items():
        size, *parts = _grid().profile(np.array([every for _, every in some]), n, p)
        for (k, _), *values in zip(some, *parts, strict=True):
            profiled[k] = Likelihood(*map(frozen, (size, *values)))
    return profiled


def _of_sizes(rows: PositionRows, unit: float, before: PositionRows | None) -> _OfSizes | None:
    """What a likelihood is profiled from; None where rows show no more than the numbers.

    References
    ----------
    ln|1 + t^2 lam|, ln|H| and y'Py are analytic in s = ln(1 + c t^2), c no less than any lam,
    wherever |Im s| < pi: there no 1 + t^2 lam is zero, and the imaginary parts of all weights
    1 / (1 + t^2 lam) have one sign, so that H, a sum of these and a positive prior, has no null
    vector. A polynomial in Chebyshev points of a stretch L falls short of such functions by
    rho^-terms, rho = b + sqrt(1 + b^2) with b = 2 pi / L (Trefethen 2013, theorem 8.2): 4e-12.
    """
    both = rows if before is None or not len(before.y) else rows.joined(before)
    A = reduced(both.A, None if before is None else before.A)
    n, p = len(rows.y), A.shape[1]
    if len(A) - p < 1:
        return None
    grid, lam = _grid(), unit**2 * rows.lam
    nodes = grid.nodes if n < len(A) else np.zeros(1)
    systems = systems_of(np.column_stack([A, both.y]), lam, nodes)
    if isinstance(systems, OfNumbers) and p < SMALL:
        systems = replace(systems, pools=systems.pools or pooled(systems.X, lam))
    most = max(float(lam.max()), float(grid.t[-1]) ** -2)
    s = np.log1p(most * grid.t**2)
    alike = lam.max() < np.exp(ALIKE) * lam.min()
    every, start, best = np.full((3, len(nodes), len(s)), np.nan), 0, np.full(2, -np.inf)
    while start < len(s):
        low, (length, terms) = s[start], PARTS[start > 0]
        end = int(np.searchsorted(s, low + length, side="right"))
        at, (x, to_terms) = slice(start, end), _chebyshev(terms)
        t = np.sqrt(np.expm1(low + length * (x + 1) / 2) / most)
        found = np.stack(systems.eliminated(t))  # (2, nodes, terms)
        logarithms = np.log1p(t[:, None] ** 2 * lam).sum(axis=1)
        series = _series(2 * (s[at] - low) / length - 1, terms)
        between = (series @ to_terms).T
        every[:2, :, at], every[2, :, at] = found @ between, logarithms @ between
        if not start:  # its first size is none
            alike = alike and every[1, len(nodes) // 2, 0] < LIKE_NOISE * (len(A) - p)
        value = grid.likeliest(every[:, :, at], n, p)
        best = np.maximum(best, value.max(axis=1))
        if (value[:, -1] < best - (UNLIKELY if alike else HOPELESS) - missed(n)).all():
            break  # larger sizes are less likely still
        start = end
    return _OfSizes(every, n, p)


def pooled(X: Array, lam: Array) -> Pools | None:
    """Products of the columns of rows X (n, p) with misfit `lam` (n,), pooled to 1e-12.

    None if `lam` differs so much that more than `POOLS` of them would be needed.

    References
    ----------
    A weight 1 / (1 + t^2 lam) is analytic in x = ln lam wherever |Im x| < pi, for every t. With
    polynomials in Chebyshev points of x, as above, a few sums over rows are enough for all t.
    """
    if not lam.min() > 0.0:
        return None
    x = np.log(lam)
    length = max(float(np.ptp(x)), 1e-3)
    b = 2 * np.pi / length
    terms = int(np.ceil(12 * np.log(10) / np.log(b + np.sqrt(1 + b**2))))
    if terms > POOLS:
        return None
    points, to_terms = _chebyshev(terms)
    low, columns = x.min(), np.ascontiguousarray(X.T)
    share = _series(2 * (x - low) / length - 1, terms) @ to_terms  # above -1
    half = columns * np.ascontiguousarray(np.sqrt(share + 1.0).T)[:, None]
    products = half @ np.swapaxes(half, 1, 2) - columns @ columns.T
    return Pools(np.exp(low + length * (points + 1) / 2), products)


def _series(x: Array, terms: int) -> Array:
    """Chebyshev polynomials (k, terms) at x (k,) in -1 to 1."""
    return np.asarray(np.cos(np.arange(terms) * np.arccos(np.clip(x, -1.0, 1.0))[:, None]))


@cache
def _grid() -> Grid:
    """Sizes that are tried if no repeats show the scale of the noise."""
    return Grid.of(None)


@cache
def _chebyshev(terms: int) -> tuple[Array, Array]:
    """Points (k,) in -1 to 1, and the matrix (k, k) from values there to terms of the series.

    References
    ----------
    Trefethen 2013, chapter 3.
    """
    angle = np.pi * (np.arange(terms) + 0.5) / terms
    to_terms = 2 / terms * np.cos(np.arange(terms)[:, None] * angle)
    to_terms[0] /= 2
    return np.cos(angle), to_terms
