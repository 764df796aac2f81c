"""Systems of numbers behind the likelihood of a misfit: by numbers, by rows, or by pooled rows."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf, dsytrd, dsytrd_lwork, dtrtri

from calib.arrays import Array
from calib.uncertainty.statement.evidence import diagonal

COSTLY, POOLS = 5e7, 120
"""Products of columns above which rows that share noise and misfit alike are pooled; pools."""
ROWS_FOR_NUMBERS = 2.0
"""Rows for each number up to which the covariance of rows is the smaller work."""
SMALL = 40
"""Columns up to which systems are made and factored together; of larger ones each stays near the
processor."""
EPSILON = 1e-12
"""Part of the largest share below which no misfit shows in a row."""


def systems_of(X: Array, lam: Array, nodes: Array) -> "OfNumbers | OfRows":
    """The systems of some rows and a prior, by numbers or by rows as it costs less.

    Parameters
    ----------
    X : (n + b, p + 1) array
        Columns [A, y], in units of the noise: n rows, below them b of the prior.
    lam : (n,) array
        Variance per t^2 of misfit in each row.
    nodes : (k,) array
        Logarithms of the scale of the noise.
    """
    n, p = len(lam), X.shape[1] - 1
    if n <= ROWS_FOR_NUMBERS * p and len(X) - n >= p:
        return OfRows.of(X[:n], X[n:], lam, nodes)
    pooled = n * X.shape[1] ** 2 > COSTLY and lam.any()
    before = X[n:].T @ X[n:]
    return OfNumbers(X[:n], before, lam, nodes, Pools.of(X[:n], lam) if pooled else None)


@dataclass(frozen=True, slots=True, eq=False)
class OfNumbers:
    """One system of numbers for each size and scale of the noise."""

    X: Array
    """(n, p + 1) columns [A, y] of the rows."""
    before: Array
    """(p + 1, p + 1) products of the same columns of the prior."""
    lam: Array
    """(n,) variance per t^2 of misfit."""
    nodes: Array
    """(k,) logarithms of the scale."""
    pools: "Pools | None"
    """The rows pooled, where they are many; None where each stands for itself."""

    def eliminated(self, t: Array) -> tuple[Array, Array]:
        """ln|H| and y'Py (nodes, k) of sizes t (k,)."""
        scales, pools = np.exp(-2 * self.nodes), self.pools
        columns = np.ascontiguousarray(self.X.T)
        if self.X.shape[1] <= SMALL:
            every = _normal(columns, self.lam, t) if pools is None else pools.normal(t)
            whole = every * scales[:, None, None, None]
            whole += self.before
            # one factor serves both; the corner is raised, so that it has one where nothing is left
            raised = whole[..., -1, -1] + 1.0
            whole[..., -1, -1] += raised
            pivots = np.linalg.cholesky(whole).diagonal(0, 2, 3)
        else:
            raised, pivots = self._in_turn(columns, t)
        return 2 * np.log(pivots[..., :-1]).sum(axis=2), pivots[..., -1] ** 2 - raised

    def _in_turn(self, columns: Array, t: Array) -> tuple[Array, Array]:
        """Raised corners (nodes, k) and pivots (nodes, k, p), one system after the other."""
        scales = np.exp(-2 * self.nodes)
        raised, pivots = (
            np.empty((len(scales), len(t))),
            np.empty((len(scales), len(t), len(columns))),
        )
        if self.pools is not None:
            every = iter(self.pools.normal(t))
        else:
            every = (_normal(columns, self.lam, t[j : j + 1])[0] for j in range(len(t)))
        for j, H in enumerate(every):
            for k, scale in enumerate(scales):
                whole = H * scale
                whole += self.before
                raised[k, j] = whole[-1, -1] + 1.0
                whole[-1, -1] += raised[k, j]
                factor, flaw = dpotrf(whole.T, lower=1, clean=0, overwrite_a=1)
                if flaw:
                    raise np.linalg.LinAlgError("Matrix is not positive definite")
                pivots[k, j] = factor.diagonal()
        return raised, pivots


@dataclass(frozen=True, slots=True, eq=False)
class OfRows:
    """The same where rows are few and all numbers have a prior: by the covariance of the rows.

    References
    ----------
    K = A inv(Lambda0) A', V = g^2 + K + g^2 t^2 Lambda; Lambda against g^2 + K = L L' is made
    tridiagonal, with y along its first axis, so that every t costs one continued fraction.
    ln|H| = ln|V| + ln|Lambda0| - ln|g^2 (1 + t^2 Lambda)|.
    """

    lam: Array
    """(n,) variance per t^2 of misfit."""
    logarithm: Array
    """(k,) ln|g^2 + K| + ln|Lambda0| - 2 n ln g."""
    own: Array
    """(k, n) diagonals, times g^2."""
    next: Array
    """(k, n - 1) what stands beside them."""
    square: Array
    """(k,) sums of squares of the residuals, of variance one."""

    @classmethod
    def of(cls, X: Array, prior: Array, lam: Array, nodes: Array) -> "OfRows":
        """Those of columns [A, y] of rows (n, p + 1) and prior."""
        p = X.shape[1] - 1
        triangle = len(prior) == p and not np.tril(prior, -1).any()
        both = prior if triangle else np.asarray(np.linalg.qr(prior, mode="r"))
        root, pull = both[:p, :p], both[:p, p]
        if diagonal(root):
            B = X[:, :p].T / np.diagonal(root)[:, None]
        else:
            B = solve_triangular(root, X[:, :p].T, trans=1, check_finite=False)
        y = X[:, p] - pull @ B
        K, of_prior = B.T @ B, 2 * np.log(np.abs(np.diag(root))).sum()
        logarithm, found = [], []
        for g in np.exp(nodes):
            L = np.linalg.cholesky(K + g**2 * np.eye(len(y)))
            logarithm.append(2 * np.log(np.diag(L) / g).sum() + of_prior)
            back, _ = dtrtri(L.T)  # upper: of the transposed factor
            lean = (g * np.sqrt(lam))[:, None] * back
            found.append(_tridiagonal(lean.T @ lean, y @ back))
        own, beside, square = (np.array(part) for part in zip(*found, strict=True))
        return cls(lam, np.array(logarithm), own, beside, square)

    def eliminated(self, t: Array) -> tuple[Array, Array]:
        """ln|H| and y'Py (nodes, k) of sizes t (k,)."""
        square = t**2
        pivots = 1 + self.own.T[:, :, None] * square
        follows = (self.next.T[:, :, None] * square) ** 2
        for k in range(len(follows) - 1, -1, -1):
            pivots[k] -= follows[k] / pivots[k + 1]
        logarithm = np.log(pivots).sum(axis=0) - np.log1p(square[:, None] * self.lam).sum(axis=1)
        return self.logarithm[:, None] + logarithm, self.square[:, None] / pivots[0]


def _tridiagonal(M: Array, y: Array) -> tuple[Array, Array, float]:
    """Diagonal (n,) and what is beside it (n - 1,) of M (n, n) where y is along the first axis.

    And the square of y. By two-sided reflections: the first takes y there, all others leave it.
    """
    size = float(np.linalg.norm(y))
    v = y.copy()
    v[0] += np.copysign(size, y[0])
    if size > 0:
        v *= np.sqrt(2) / np.linalg.norm(v)
        w = M @ v
        w -= (v @ w / 2) * v
        M = M - v[:, None] * w - w[:, None] * v
    work = int(dsytrd_lwork(len(y), lower=1)[0])
    _, own, beside, _, _ = dsytrd(M.T, lower=1, lwork=work)
    return own, beside, size**2


def _normal(columns: Array, lam: Array, t: Array) -> Array:
    """X'inv(V)X (k, p, p) of rows as columns (p, n) for sizes t (k,), V = 1 + t^2 lam."""
    half = columns * (1 / np.sqrt(1 + t[:, None] ** 2 * lam))[:, None]
    return np.asarray(half @ half.transpose(0, 2, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Pools:
    """Products of the columns of many rows, pooled by how misfit and noise share in them.

    Between two nodes the weight of a row is straight in ln lam: for nodes 4 % apart to 2e-5. They
    stand close where rows do.
    """

    lam: Array
    """(b,) at the nodes."""
    products: Array
    """(b, p, p) what belongs to each."""

    @classmethod
    def of(cls, X: Array, lam: Array) -> "Pools":
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
        flat = weights @ self.products.reshape(len(self.lam), -1)
        return np.asarray(flat.reshape(len(t), *self.products.shape[1:]))
