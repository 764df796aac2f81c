"""The restricted likelihood of sizes of misfit, the scale of the noise profiled out.

Every size and every scale on a grid: many sizes share one pass over the rows, all scales one system
of numbers, or with a prior three.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, frozen
from calib.uncertainty.statement.evidence import NoiseRepeats, PositionRows, reduced

STEP = float(np.log(1.15)) / 2
"""Logarithmic step of the sizes that are tried: 7 %."""
SMALLEST, LARGEST = 0.03, 1e4
"""Sizes tried, in standard deviations of the noise per axis; zero as well."""
MOST_NUMBERS = 4_000_000
"""In one array on the way: 32 MB."""
COSTLY, POOLS = 5e7, 120
"""Products of columns above which rows that share noise and misfit alike are pooled; pools."""
EPSILON = 1e-12
"""Part of the largest share below which no misfit shows in a row."""
NODES = np.array([-3.0, 0.0, 3.0])
"""Scales of the noise at which the system of numbers is solved, in their standard deviations."""
HOPELESS = 30.0
"""Fall of the log-likelihood beyond which no larger size is looked at."""
DOUBT = 0.1
"""Standard deviation of the logarithm of the noise scale, where no repeats tell it."""


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Restricted log-likelihood of sizes of misfit, the scale of the noise profiled out."""

    size: Array
    """(g,) in stated standard deviations of the noise per axis; the first is zero."""
    value: Array
    """(g,) logarithm, up to a constant."""
    noise_scale: Array
    """(g,) most likely factor on the stated noise at each size."""

    def limit(self, drop: float) -> float:
        """Largest size within `drop` of the best, straight between grid points; inf if beyond."""
        level = self.value.max() - drop
        last = int(np.flatnonzero(self.value >= level)[-1])
        if last + 1 == len(self.size):
            return float(np.inf)
        ends = slice(last, last + 2)
        return float(np.interp(-level, -self.value[ends], self.size[ends]))


def likelihood(
    rows: PositionRows,
    unit: float,
    repeats: NoiseRepeats | None,
    before: PositionRows | None = None,
) -> Likelihood | None:
    """Restricted likelihood of sizes of misfit; None where the rows show no more than the numbers.

    Parameters
    ----------
    rows : PositionRows
        Of all poses.
    unit : float
        Stated noise per axis, in which sizes are counted [m].
    repeats : NoiseRepeats or None
        What repeats say of the scale of the noise; else it is known within `DOUBT`.
    before : PositionRows, optional
        Those of a prior, which no noise widens.

    References
    ----------
    V = g^2 (N + t^2 D), H = A'inv(V)A + Lambda0: with the size t counted in scaled noise, -2 l =
    ln|V| + ln|H| + y'Py + (what is known of g). Without a prior one system of numbers per t does,
    whatever g is; with one, ln|H| and g^2 y'Py are parabolas of ln g through `NODES` systems.
    """
    both = rows if before is None or not len(before.y) else rows.joined(before)
    A = reduced(both.A)
    n, freedom = len(rows.y), len(A) - A.shape[1]
    if freedom < 1:
        return None
    center, sd = (0.0, DOUBT) if repeats is None else (repeats.log_scale, repeats.log_scale_sd)
    reach = int(np.ceil(5 * sd / STEP))
    log_g = center + STEP * np.arange(-reach, reach + 1.0)
    count = int(np.log(LARGEST / SMALLEST) / STEP) + 1
    t = np.concatenate([[0.0], SMALLEST * np.exp(STEP * np.arange(-reach, count + reach))])
    known = (log_g - center) ** 2 / (2 * sd**2) if repeats is None else repeats.against(log_g)
    X = np.column_stack([A, both.y])
    of_both, highest = np.full((len(t), len(log_g)), -np.inf), -np.inf
    lam = unit**2 * rows.lam
    pools = _Pools.of(X[:n], lam) if n * X.shape[1] ** 2 > COSTLY and lam.any() else None
    some = max(1, MOST_NUMBERS // X.shape[1] ** 2)
    for start in range(0, len(t), some):
        part = slice(start, start + some)
        H = _normal(X[:n], lam, t[part]) if pools is None else pools.normal(t[part])
        logarithms = np.log1p(t[part, None] ** 2 * lam).sum(axis=1)
        of_both[part] = _values(H, X[n:], n, log_g, center, sd) - logarithms[:, None] / 2 - known
        highest = max(highest, float(of_both[part].max()))
        if of_both[part].max(axis=1)[-1] < highest - HOPELESS:
            break  # larger ones are less likely still
    of_both[np.isneginf(of_both)] = highest - 2 * HOPELESS  # no more is known of these
    # size = t g: equal steps in both logarithms, so that every size meets every scale on the grid
    place = np.arange(count)[:, None] + 1 + 2 * reach - np.arange(len(log_g))
    of_size = np.concatenate([of_both[:1], of_both[place, np.arange(len(log_g))]])
    best = of_size.argmax(axis=1)
    return Likelihood(
        frozen(np.concatenate([[0.0], SMALLEST * np.exp(STEP * np.arange(count) + center)])),
        frozen(of_size.max(axis=1)),
        frozen(np.exp(log_g[best])),
    )


def _values(H: Array, prior: Array, n: int, log_g: Array, center: float, sd: float) -> Array:
    """Log-likelihood (k, g) by size and scale of the noise but for ln|1 + t^2 lam| and the scale.

    `H` (k, p + 1, p + 1) are products of the columns [A, y] of n rows, at unit noise.
    """
    if not len(prior):
        logarithm, square = _eliminated(H)
        free = n - H.shape[1] + 1
        return np.asarray(
            -(logarithm[:, None] + 2 * free * log_g + square[:, None] * np.exp(-2 * log_g)) / 2
        )
    nodes = center + NODES * sd
    found = [_eliminated(H * np.exp(-2 * node) + prior.T @ prior) for node in nodes]
    logarithm = np.array([each[0] for each in found])
    square = np.array([each[1] * np.exp(2 * node) for node, each in zip(nodes, found, strict=True)])
    powers = np.vander(nodes - center, len(nodes))
    place = np.linalg.solve(powers.T, np.vander(log_g - center, len(nodes)).T).T
    quadratic = (place @ square).T * np.exp(-2 * log_g)
    return np.asarray(-((place @ logarithm).T + 2 * n * log_g + quadratic) / 2)


def _normal(X: Array, lam: Array, t: Array) -> Array:
    """X'inv(V)X (k, p, p) of rows X (n, p) for sizes t (k,), V = 1 + t^2 lam.

    For all at once: the weights of all, times products of two columns.
    """
    i, j = np.tril_indices(X.shape[1])
    products = np.zeros((len(t), len(i)))
    block = max(1, MOST_NUMBERS // len(i))
    for k in range(0, len(X), block):
        some = slice(k, k + block)
        products += (1 / (1 + t[:, None] ** 2 * lam[some])) @ (X[some, i] * X[some, j])
    H = np.empty((len(t), X.shape[1], X.shape[1]))
    H[:, i, j] = H[:, j, i] = products
    return H


@dataclass(frozen=True, slots=True, eq=False)
class _Pools:
    """Products of the columns of many rows, pooled by how misfit and noise share in them.

    Between two nodes the weight of a row is straight in ln lam: for nodes 4 % apart to 2e-5. They
    stand close where rows do.
    """

    lam: Array
    """(b,) at the nodes."""
    products: Array
    """(b, p, p) what belongs to each."""

    @classmethod
    def of(cls, X: Array, lam: Array) -> "_Pools":
        """Those of rows X (n, p)."""
        shares = lam > lam.max() * EPSILON
        x = np.log(np.where(shares, lam, lam.max()))
        even = np.linspace(x.min(), x.max(), POOLS // 3)
        nodes = np.unique([*even, *np.quantile(x, np.linspace(0, 1, POOLS - len(even)))])
        nodes = nodes if len(nodes) > 1 else np.append(nodes, nodes + 1.0)
        place = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
        beyond = (x - nodes[place]) / np.diff(nodes)[place]
        products = np.zeros((len(nodes) + 1, X.shape[1], X.shape[1]))
        for k in range(len(nodes) - 1):
            rows = shares & (place == k)
            whole, part = X[rows].T @ X[rows], (X[rows].T * beyond[rows]) @ X[rows]
            products[k] += whole - part
            products[k + 1] += part
        products[-1] = X[~shares].T @ X[~shares]  # where no misfit shows
        return cls(np.append(np.exp(nodes), 0.0), products)

    def normal(self, t: Array) -> Array:
        """X'inv(V)X (k, p, p) for sizes t (k,)."""
        weights = 1 / (1 + t[:, None] ** 2 * self.lam)
        return np.asarray(np.tensordot(weights, self.products, 1))


def _eliminated(H: Array) -> tuple[Array, Array]:
    """ln|A'inv(V)A| (k,) and what is left of y'inv(V)y (k,), of products of the columns [A, y]."""
    root = np.linalg.cholesky(H[:, :-1, :-1])
    b = np.linalg.solve(root, H[:, :-1, -1:])[:, :, 0]
    logarithms = 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return logarithms, H[:, -1, -1] - (b**2).sum(axis=1)
