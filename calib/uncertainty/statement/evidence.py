"""The evidence for a misfit: position rows with noise and misfit diagonal, and their likelihood."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE, triangle
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import prior_precision
from calib.uncertainty.statement.shape import MisfitShape

STEP = float(np.log(1.15)) / 2
"""Logarithmic step of the sizes that are tried: 7 %."""
SMALLEST, LARGEST = 0.03, 1e4
"""Sizes tried, in standard deviations of the noise per axis; zero as well."""
MOST_NUMBERS = 4_000_000
"""In one array on the way: 32 MB."""
NODES = np.array([-3.0, 0.0, 3.0])
"""Scales of the noise at which the system of numbers is solved, in their standard deviations."""
HOPELESS = 30.0
"""Fall of the log-likelihood beyond which no larger size is looked at."""
DOUBT = 0.1
"""Standard deviation of the logarithm of the noise scale, where no repeats tell it."""
SEEN, POWER = 0.001, 0.95
"""A misfit counts as one that would have been seen if a test at this level had this power."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseRepeats:
    """What repeats say of the scale of the stated noise."""

    degrees_of_freedom: float
    """nu: 3 (r - 1) for each pose read r times, each time approached anew."""
    sum_of_squares: float
    """Of whitened positions about the means of their poses."""
    in_evidence: bool = False
    """Whether the rows themselves are in the evidence, which then holds their scatter already."""

    @property
    def log_scale(self) -> float:
        """Most likely logarithm of the factor on the stated noise."""
        return 0.5 * float(np.log(self.sum_of_squares / self.degrees_of_freedom))

    @property
    def log_scale_sd(self) -> float:
        """Its standard deviation."""
        return 1 / float(np.sqrt(2 * self.degrees_of_freedom))

    def against(self, log_scale: Array) -> Array:
        """What minus the log-likelihood of these repeats adds, by scale of the noise."""
        if self.in_evidence:
            return np.zeros_like(log_scale)
        square = self.sum_of_squares * np.exp(-2 * log_scale)
        return np.asarray(self.degrees_of_freedom * log_scale + square / 2)


@dataclass(frozen=True, slots=True, eq=False)
class PositionRows:
    """Position rows, each pose turned so that noise and misfit are both diagonal."""

    A: Array
    """(n, f) derivative by the free numbers, scaled columns."""
    y: Array
    """(n,) residual."""
    lam: Array
    """(n,) variance per size^2 of misfit, where that of the noise is 1 [1/m^2]."""
    noise: float
    """Sum of the noise variances before turning [m^2]."""

    @property
    def noise_sd(self) -> float:
        """Stated noise, root mean square per axis [m]."""
        return float(np.sqrt(self.noise / len(self.lam)))

    def joined(self, other: "PositionRows") -> "PositionRows":
        """Rows of both."""
        return PositionRows(
            np.concatenate([self.A, other.A]),
            np.concatenate([self.y, other.y]),
            np.concatenate([self.lam, other.lam]),
            self.noise + other.noise,
        )


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


def position_rows(
    model: RobotModel,
    parameters: Parameters,
    table: Measurements,
    shape: MisfitShape,
    weights: Array,
) -> PositionRows:
    """Turn the position rows of each pose by U' inv(L): N = L L', inv(L) D inv(L)' = U lam U'."""
    seen = predict(model, table)
    A = seen.rows[:, :3, parameters.free_index] * parameters.free_scale
    B, y, at = shape.rows(seen.rows[:, :3]), seen.residual[:, :3], seen.filled[:, :3]
    heavy = weights > 0
    N = table.covariance[:, :3, :3] / np.where(heavy, weights, 1.0)[:, None, None]
    _, pose = np.unique(table.pose_id, return_inverse=True)
    found = PositionRows(np.zeros((0, A.shape[2])), np.zeros(0), np.zeros(0), 0.0)
    for rows in _alike(pose.ravel(), at, heavy):  # (poses, rows of each)
        some = at[rows].reshape(len(rows), -1)
        pick = np.flatnonzero(some[0])

        def stacked(X: Array, rows: Index = rows, pick: Index = pick) -> Array:
            """Equations (poses, equations, ...) of all rows of a pose."""
            return X[rows].reshape(len(rows), -1, *X.shape[2:])[:, pick]

        noise = np.zeros((len(rows), some.shape[1], some.shape[1]))
        for k in range(rows.shape[1]):
            part = slice(3 * k, 3 * k + 3)
            noise[:, part, part] = N[rows[:, k]]
        noise = noise[:, pick][:, :, pick]
        root = np.linalg.cholesky(noise)
        lean = np.linalg.solve(root, stacked(B))
        lam, U = np.linalg.eigh(lean @ np.swapaxes(lean, 1, 2))
        turned = np.swapaxes(U, 1, 2)
        found = found.joined(
            PositionRows(
                (turned @ np.linalg.solve(root, stacked(A))).reshape(-1, A.shape[2]),
                (turned @ np.linalg.solve(root, stacked(y)[:, :, None])).ravel(),
                np.maximum(lam, 0.0).ravel(),
                float(np.trace(noise, axis1=1, axis2=2).sum()),
            )
        )
    return found


def believed_before(identification: Identification) -> PositionRows:
    """The prior as rows without misfit."""
    precision, free = prior_precision(identification), identification.parameters
    expected = np.zeros(free.n_free)
    if identification.prior is None:
        return PositionRows(np.zeros((0, free.n_free)), np.zeros(0), np.zeros(0), 0.0)
    at = [free.free_names.index(name) for name in identification.prior.names]
    expected[at] = (identification.prior.mean - identification.step[at]) / free.free_scale[at]
    root = np.linalg.cholesky(precision[np.ix_(at, at)]).T
    A = np.zeros((len(at), free.n_free))
    A[:, at] = root
    return PositionRows(A, A @ expected, np.zeros(len(at)), 0.0)


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
    some = max(1, MOST_NUMBERS // X.shape[1] ** 2)
    for start in range(0, len(t), some):
        part = slice(start, start + some)
        H, logarithms = _normal(X[:n], unit**2 * rows.lam, t[part])
        of_both[part] = _values(H, X[n:], n, log_g, center, sd) - logarithms[:, None] / 2 - known
        highest = max(highest, float(of_both[part].max()))
        if of_both[part].max(axis=1)[-1] < highest - HOPELESS:
            break  # larger ones are less likely still
    of_both = np.maximum(of_both, highest - 2 * HOPELESS)  # no more is known of those left out
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


def detectable(lam: Array, n_numbers: int) -> float:
    """Size, in noise sd, that a score test at `SEEN` finds with `POWER`; nan where it finds none.

    References
    ----------
    sqrt(c) t sum lam^2 = z_a sqrt(2 sum lam^2) + z_b sqrt(2 sum lam^2 (1 + t lam)^2), t = size^2
    and c = 1 - numbers / rows.
    """
    t = np.geomspace(1e-4, 1e8, 2000)
    square, cube, fourth = ((lam**k).sum() for k in (2, 3, 4))
    gain = np.sqrt(max(1 - n_numbers / len(lam), 0.0)) * t * square
    need = ndtri(1 - SEEN) * np.sqrt(2 * square)
    need = need + ndtri(POWER) * np.sqrt(2 * (square + 2 * t * cube + t**2 * fourth))
    seen = np.flatnonzero(gain > need)
    return float(np.sqrt(t[seen[0]])) if len(seen) else np.nan


def _alike(pose: Index, at: Bool, heavy: Bool) -> list[Index]:
    """Rows (poses, k) of the poses that have k rows with the same equations filled."""
    groups: dict[tuple[int, ...], list[Index]] = {}
    for p in range(int(pose.max(initial=-1)) + 1):
        rows = np.flatnonzero((pose == p) & heavy)
        if len(rows):
            groups.setdefault(tuple(at[rows].sum(axis=1)), []).append(rows)
    return [np.array(rows) for rows in groups.values()]


def reduced(A: Array) -> Array:
    """A derivative (n, f) of positions in the directions (n, p) that they show."""
    _, singular, directions = np.linalg.svd(triangle(A), full_matrices=False)
    return np.asarray(A @ directions[singular > RANK_TOLERANCE * singular[0]].T)


def _normal(X: Array, lam: Array, t: Array) -> tuple[Array, Array]:
    """X'inv(V)X (k, p, p) and ln|V| (k,) of rows X (n, p) for sizes t (k,), V = 1 + t^2 lam.

    For all at once: the weights of all, times products of two columns.
    """
    i, j = np.tril_indices(X.shape[1])
    products, logarithms = np.zeros((len(t), len(i))), np.zeros(len(t))
    block = max(1, MOST_NUMBERS // len(i))
    for k in range(0, len(X), block):
        some = slice(k, k + block)
        V = 1 + t[:, None] ** 2 * lam[some]
        products += (1 / V) @ (X[some, i] * X[some, j])
        logarithms += np.log(V).sum(axis=1)
    H = np.empty((len(t), X.shape[1], X.shape[1]))
    H[:, i, j] = H[:, j, i] = products
    return H, logarithms


def _eliminated(H: Array) -> tuple[Array, Array]:
    """ln|A'inv(V)A| (k,) and what is left of y'inv(V)y (k,), of products of the columns [A, y]."""
    root = np.linalg.cholesky(H[:, :-1, :-1])
    b = np.linalg.solve(root, H[:, :-1, -1:])[:, :, 0]
    logarithms = 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return logarithms, H[:, -1, -1] - (b**2).sum(axis=1)
