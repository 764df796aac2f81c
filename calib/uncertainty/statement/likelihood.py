"""The restricted likelihood of sizes of misfit, the scale of the noise profiled out.

Every size and every scale on a grid: many sizes share one pass over the rows, all scales one system
of numbers, or with a prior three.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from calib.arrays import Array, Index, frozen
from calib.uncertainty.statement.evidence import NoiseRepeats, PositionRows, reduced

STEP = float(np.log(1.15)) / 2
"""Logarithmic step of the sizes that are tried: 7 %."""
SMALLEST, LARGEST = 0.03, 1e4
"""Sizes tried, in standard deviations of the noise per axis; zero as well."""
AT_ONCE = 24
"""Sizes looked at together: most rows deny all but the first fifty."""
COSTLY, POOLS = 5e7, 120
"""Products of columns above which rows that share noise and misfit alike are pooled; pools."""
ROWS_FOR_NUMBERS = 2.0
"""Rows for each number up to which the covariance of rows is the smaller work."""
EPSILON = 1e-12
"""Part of the largest share below which no misfit shows in a row."""
NODES = np.array([-3.0, 0.0, 3.0])
"""Scales of the noise at which the system of numbers is solved, in their standard deviations."""
HOPELESS = 30.0
"""Fall of the log-likelihood beyond which no larger size is looked at."""
WIDE, STRIDE = 200, 8
"""Numbers from which on every eighth size is tried first, then all about the best of these."""
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
    lam = unit**2 * rows.lam
    nodes = center + NODES * sd if n < len(A) else np.zeros(1)
    systems = _systems(np.column_stack([A, both.y]), lam, nodes)
    of_both = np.full((len(t), len(log_g)), -np.inf)

    def look(at: Index, many: int) -> None:
        """Fill in the rows of some sizes, ever larger ones, as long as these are not hopeless."""
        for start in range(0, len(at), many):
            part = at[start : start + many]
            logarithms = np.log1p(t[part, None] ** 2 * lam).sum(axis=1)
            values = _values(systems.eliminated(t[part]), nodes, log_g, n, A.shape[1])
            of_both[part] = values - logarithms[:, None] / 2 - known
            value = of_both.max(axis=1)
            if value[part[-1]] < value[: part[-1]].max(initial=-np.inf) - HOPELESS:
                break  # larger ones are less likely still

    every = np.arange(len(t))
    if A.shape[1] > WIDE:
        look(every[::STRIDE], STRIDE // 2)
        peak = int(of_both.max(axis=1).argmax())
        near = every[max(0, peak - STRIDE - 2 * reach) :]
        look(near[np.isneginf(of_both[near, 0])], STRIDE)
    else:
        look(every, AT_ONCE)
    of_both[np.isneginf(of_both)] = of_both.max() - 2 * HOPELESS  # no more is known of these
    # size = t g: equal steps in both logarithms, so that every size meets every scale on the grid
    place = np.arange(count)[:, None] + 1 + 2 * reach - np.arange(len(log_g))
    of_size = np.concatenate([of_both[:1], of_both[place, np.arange(len(log_g))]])
    best = of_size.argmax(axis=1)
    return Likelihood(
        frozen(np.concatenate([[0.0], SMALLEST * np.exp(STEP * np.arange(count) + center)])),
        frozen(of_size.max(axis=1)),
        frozen(np.exp(log_g[best])),
    )


def _values(found: tuple[Array, Array], nodes: Array, log_g: Array, n: int, p: int) -> Array:
    """Log-likelihood (k, g) by size and scale of the noise but for ln|1 + t^2 lam| and the scale.

    `found` are ln|H| and y'Py (nodes, k) of n rows and p numbers.
    """
    logarithm, square = found
    if len(nodes) == 1:  # without a prior
        left = square[0, :, None] * np.exp(-2 * log_g)
        return np.asarray(-(logarithm[0, :, None] + 2 * (n - p) * log_g + left) / 2)
    square = square * np.exp(2 * nodes[:, None])
    center = nodes.mean()
    powers = np.vander(nodes - center, len(nodes))
    place = np.linalg.solve(powers.T, np.vander(log_g - center, len(nodes)).T).T
    quadratic = (place @ square).T * np.exp(-2 * log_g)
    return np.asarray(-((place @ logarithm).T + 2 * n * log_g + quadratic) / 2)


def _systems(X: Array, lam: Array, nodes: Array) -> "_OfNumbers | _OfRows":
    """Of rows and a prior, columns [A, y], by numbers or by rows as it costs less."""
    n, p = len(lam), X.shape[1] - 1
    if n <= ROWS_FOR_NUMBERS * p and len(X) - n >= p:
        return _OfRows.of(X[:n], X[n:], lam, nodes)
    pooled = n * X.shape[1] ** 2 > COSTLY and lam.any()
    before = X[n:].T @ X[n:]
    return _OfNumbers(X[:n], before, lam, nodes, _Pools.of(X[:n], lam) if pooled else None)


@dataclass(frozen=True, slots=True, eq=False)
class _OfNumbers:
    """One system of numbers for each size and scale of the noise."""

    X: Array
    """(n, p + 1) columns [A, y] of the rows."""
    before: Array
    """(p + 1, p + 1) products of the same columns of the prior."""
    lam: Array
    """(n,) variance per t^2 of misfit."""
    nodes: Array
    """(k,) logarithms of the scale."""
    pools: "_Pools | None"

    def eliminated(self, t: Array) -> tuple[Array, Array]:
        """ln|H| and y'Py (nodes, k) of sizes t (k,)."""
        pools = self.pools
        H = _normal(self.X, self.lam, t) if pools is None else pools.normal(t)
        found = [_eliminated(H * np.exp(-2 * node) + self.before) for node in self.nodes]
        return np.stack([one[0] for one in found]), np.stack([one[1] for one in found])


@dataclass(frozen=True, slots=True, eq=False)
class _OfRows:
    """The same where rows are few and all numbers have a prior: by the covariance of the rows.

    References
    ----------
    K = A inv(Lambda0) A', V = g^2 + K + g^2 t^2 Lambda: with the eigenvalues mu of Lambda against
    g^2 + K all t are at hand. ln|H| = ln|V| + ln|Lambda0| - ln|g^2 (1 + t^2 Lambda)|.
    """

    lam: Array
    """(n,) variance per t^2 of misfit."""
    nodes: Array
    """(k,) logarithms of the scale."""
    logarithm: Array
    """(k,) ln|g^2 + K| + ln|Lambda0| - 2 n ln g."""
    mu: Array
    """(k, n) eigenvalues, times g^2."""
    y: Array
    """(k, n) residuals along the eigenvectors, of variance one."""

    @classmethod
    def of(cls, X: Array, prior: Array, lam: Array, nodes: Array) -> "_OfRows":
        """Those of columns [A, y] of rows (n, p + 1) and prior."""
        root = np.linalg.qr(prior[:, :-1], mode="r")
        expected = np.linalg.lstsq(prior[:, :-1], prior[:, -1])[0]
        y = X[:, -1] - X[:, :-1] @ expected
        B = solve_triangular(root, X[:, :-1].T, trans=1, check_finite=False)
        K, of_prior = B.T @ B, 2 * np.log(np.abs(np.diag(root))).sum()
        logarithm, mu, along = [], [], []
        for g in np.exp(nodes):
            L = np.linalg.cholesky(K + g**2 * np.eye(len(y)))
            both = np.column_stack([g * np.diag(np.sqrt(lam)), y])
            both = solve_triangular(L, both, lower=True, check_finite=False)
            values, axes = np.linalg.eigh(both[:, :-1] @ both[:, :-1].T)
            logarithm.append(2 * np.log(np.diag(L) / g).sum() + of_prior)
            mu.append(np.maximum(values, 0.0))
            along.append(both[:, -1] @ axes)
        return cls(lam, nodes, np.array(logarithm), np.array(mu), np.array(along))

    def eliminated(self, t: Array) -> tuple[Array, Array]:
        """ln|H| and y'Py (nodes, k) of sizes t (k,)."""
        square = t[:, None] ** 2
        size = 1 + square * self.mu[:, None]
        logarithm = np.log(size).sum(axis=2) - np.log1p(square * self.lam).sum(axis=1)
        return self.logarithm[:, None] + logarithm, (self.y[:, None] ** 2 / size).sum(axis=2)


def _normal(X: Array, lam: Array, t: Array) -> Array:
    """X'inv(V)X (k, p, p) of rows X (n, p) for sizes t (k,), V = 1 + t^2 lam."""
    weights = 1 / (1 + t[:, None] ** 2 * lam)
    return np.stack([(X.T * weight) @ X for weight in weights])


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
        products = np.empty((len(nodes) + 1, X.shape[1], X.shape[1]))
        sharing = np.flatnonzero(shares)
        in_order = sharing[np.argsort(place[sharing], kind="stable")]
        ends = np.searchsorted(place[in_order], np.arange(len(nodes)))
        for k in range(len(nodes)):
            # rows before a node belong to it by how far they are, those behind by what is left
            rows = in_order[ends[max(k - 1, 0)] : ends[min(k + 1, len(ends) - 1)]]
            share = np.where(place[rows] < k, beyond[rows], 1 - beyond[rows])
            some = X[rows]
            np.matmul(some.T * share, some, out=products[k])
        products[-1] = X[~shares].T @ X[~shares]  # where no misfit shows
        return cls(np.append(np.exp(nodes), 0.0), products)

    def normal(self, t: Array) -> Array:
        """X'inv(V)X (k, p, p) for sizes t (k,)."""
        weights = 1 / (1 + t[:, None] ** 2 * self.lam)
        return np.asarray(np.tensordot(weights, self.products, 1))


def _eliminated(H: Array) -> tuple[Array, Array]:
    """ln|A'inv(V)A| (k,) and what is left of y'inv(V)y (k,), of products of the columns [A, y]."""
    # one factor serves both; the corner is raised, so that it has one where nothing is left
    raised, H = H[:, -1, -1] + 1.0, H.copy()
    H[:, -1, -1] += raised
    pivots = np.diagonal(np.linalg.cholesky(H), axis1=1, axis2=2)
    return 2 * np.log(pivots[:, :-1]).sum(axis=1), pivots[:, -1] ** 2 - raised
