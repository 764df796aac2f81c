"""The evidence for a misfit: position rows with noise and misfit diagonal, and their likelihood."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrtri
from scipy.special import ndtri

from calib.arrays import Array, Bool, Index
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.information.rank import RANK_TOLERANCE, triangle
from calib.measurement.observations import Measurements
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import prior_precision
from calib.uncertainty.statement.shape import MisfitShape

SOUND = 0.1
"""Weight by a robust loss below which a row is no evidence: it is a gross error (beyond 7 standard
deviations by "cauchy", 13 by "huber"), and would pass for noise. Others count as they are."""
UNEVEN = 3.0
"""Stated noise over that of the rows that show misfit, up to which it is the unit of sizes."""
SEEN, POWER = 0.001, 0.95
"""A misfit counts as one that would have been seen if a test at this level had this power."""
MOST_OVER_MEDIAN = (np.inf, 4.0, 3.0, 2.0, 1.0)
"""Limits on lam, over its median, that tests are tried with: poses read many times, to which a few
rows belong, would govern a test without limit, and it would see less than one without them."""
VARIANCES, HALVINGS = (-14, 27), 16
"""Powers of two of the variances tried, in that of the noise; then halvings between two of them."""
NOTHING = 1e-6
"""Part of the largest lam below which a row shows no misfit: it compares readings of one pose."""


def sound_rows(identification: Identification, m: int) -> Bool:
    """Which (m,) of the rows identified from are evidence, and no gross errors."""
    weights = identification.weights
    return weights > SOUND if len(weights) else np.ones(m, dtype=np.bool_)


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

    @property
    def unit(self) -> float:
        """Size of misfit that about equals the noise of the rows that show it best [m].

        The stated noise, unless it is mostly that of rows much coarser than others.
        """
        quiet = float(np.mean(self.lam)) ** -0.5 if self.lam.any() else np.inf
        return min(self.noise_sd, UNEVEN * quiet)

    def joined(self, other: "PositionRows") -> "PositionRows":
        """Rows of both."""
        return PositionRows(
            np.concatenate([self.A, other.A]),
            np.concatenate([self.y, other.y]),
            np.concatenate([self.lam, other.lam]),
            self.noise + other.noise,
        )


def position_rows(
    model: RobotModel,
    parameters: Parameters,
    table: Measurements,
    shape: MisfitShape,
    sound: Bool,
    stops: Array | None = None,
) -> PositionRows:
    """Turn the `sound` position rows (m,) of each pose so that noise and misfit are diagonal.

    By U' inv(L), where N = L L' and inv(L) D inv(L)' = U lam U'. `stops` (m, 6, j) is the root of
    that part of the noise which rows of one stop share.
    """
    seen = predict(model, table)
    A = seen.rows[:, :3, parameters.free_index] * parameters.free_scale
    B, y, at = shape.rows(seen.rows[:, :3]), seen.residual[:, :3], seen.filled[:, :3]
    N = table.covariance[:, :3, :3]
    _, pose = np.unique(table.pose_id, return_inverse=True)
    found = PositionRows(np.zeros((0, A.shape[2])), np.zeros(0), np.zeros(0), 0.0)
    for rows in _alike(pose.ravel(), at, sound):  # (poses, rows of each)
        some = at[rows].reshape(len(rows), -1)
        pick = np.flatnonzero(some[0])

        def stacked(X: Array, rows: Index = rows, pick: Index = pick) -> Array:
            """Equations (poses, equations, ...) of all rows of a pose."""
            return X[rows].reshape(len(rows), -1, *X.shape[2:])[:, pick]

        noise = np.zeros((len(rows), some.shape[1], some.shape[1]))
        for k in range(rows.shape[1]):
            part = slice(3 * k, 3 * k + 3)
            noise[:, part, part] = N[rows[:, k]]
        if stops is not None and rows.shape[1] > 1:
            noise += _shared_by_stops(stops[rows, :3], table.repeat[rows])
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


def _shared_by_stops(root: Array, repeat: Index) -> Array:
    """Covariances (n, 3 k, 3 k) between the k rows of n poses, from roots (n, k, 3, j) [m]."""
    n, k = repeat.shape
    other = (repeat[:, :, None] == repeat[:, None]) & ~np.eye(k, dtype=np.bool_)
    flat = root.reshape(n, 3 * k, -1)
    whole = flat @ np.swapaxes(flat, 1, 2)
    return np.asarray(whole * np.repeat(np.repeat(other, 3, axis=1), 3, axis=2))


def believed_before(identification: Identification, precision: Array | None = None) -> PositionRows:
    """The prior as it is believed, as rows without misfit.

    Its `precision` (f, f), as it was weighed, if already at hand.
    """
    free = identification.parameters
    if identification.prior is None:
        return PositionRows(np.zeros((0, free.n_free)), np.zeros(0), np.zeros(0), 0.0)
    precision = prior_precision(identification) if precision is None else precision
    # the fit may have weighed it against more noise; no noise widens what is believed
    precision = precision / identification.tightened
    expected = np.zeros(free.n_free)
    place = {name: k for k, name in enumerate(free.free_names)}
    at = [place[name] for name in identification.prior.names]
    expected[at] = (identification.prior.mean - identification.step[at]) / free.free_scale[at]
    if at != list(range(free.n_free)):
        precision = precision[np.ix_(at, at)]
    if diagonal(precision):
        root = np.diag(np.sqrt(np.diagonal(precision)))
    else:
        root = np.linalg.cholesky(precision).T
    A = np.zeros((len(at), free.n_free))
    A[:, at] = root
    return PositionRows(A, A @ expected, np.zeros(len(at)), 0.0)


def detectable(lam: Array, n_numbers: int, doubt: float) -> float:
    """Size, in noise sd, that a likelihood ratio shows at `SEEN` with `POWER`; nan where none does.

    That of the best of some tests, each with another limit on lam: a row that tells more counts as
    if its noise were larger, so that each of them has its power.

    Parameters
    ----------
    lam : (n,) array
        Variance per size^2 of misfit in each row, that of the noise is 1.
    n_numbers : int
        Numbers fitted to the rows.
    doubt : float
        Standard deviation of the logarithm of the noise scale, as far as anything else tells it;
        infinite where the rows alone do.
    """
    showing = lam[lam > NOTHING * lam.max(initial=0.0)]
    share = 1 - n_numbers / max(len(lam), 1)
    if not len(showing) or share <= 0:
        return np.nan
    limits = float(np.median(showing)) * np.array(MOST_OVER_MEDIAN)
    limits = np.unique(np.minimum(limits, lam.max()))  # beyond the largest they cut nothing
    sizes = [_found_by_all(np.minimum(lam, limit), share, doubt) for limit in limits]
    return float(np.fmin.reduce(sizes))


def _found_by_all(lam: Array, share: float, doubt: float) -> float:
    """Size that a test finds to which each row counts by its lam; nan where it finds none."""
    tried = (2.0**k for k in range(*VARIANCES) if _shows(2.0**k, lam, share, doubt))
    high = next(tried, np.nan)
    low = high / 2
    for _ in range(HALVINGS if np.isfinite(high) else 0):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if _shows(middle, lam, share, doubt) else (middle, high)
    return float(np.sqrt(high))


def _shows(t: float, lam: Array, share: float, doubt: float) -> bool:
    """Whether a misfit of variance t would be seen beside noise whose scale is in doubt.

    References
    ----------
    Wilks: twice the gain of the expected log-likelihood, at its best without misfit by larger noise
    exp(2 L), is the square of a normal number about its root r; r = z_a + z_b s, where s^2 is the
    variance of the gain, sum 2 c (exp(-2 L) (1 + t lam) - 1)^2, over 4 r^2; of each row c is left.
    """
    grown, n = 1 + t * lam, share * len(lam)
    mean, certain = float(grown.mean()), 0.0 if np.isinf(doubt) else doubt**-2
    L = 0.5 * np.log(mean) if certain == 0.0 else 0.0
    for _ in range(40 * (certain > 0.0)):  # convex and falling: Newton's steps never pass the root
        less = n * mean * np.exp(-2 * L)
        last, L = L, L + (less - n - certain * L) / (2 * less + certain)
        if last == L:
            break
    less = np.exp(-2 * L)
    gain = n * (2 * L + mean * less - 1 - float(np.log(grown).mean())) + certain * L**2
    if gain <= 0:
        return False
    root, spread = np.sqrt(gain), np.sqrt(2 * share * ((less * grown - 1) ** 2).sum())
    return bool(root > ndtri(1 - SEEN) + ndtri(POWER) * spread / (2 * root))


def _alike(pose: Index, at: Bool, sound: Bool) -> list[Index]:
    """Sound rows (poses, k) of the poses that have k of them with the same equations filled."""
    groups: dict[tuple[int, ...], list[Index]] = {}
    for p in range(int(pose.max(initial=-1)) + 1):
        rows = np.flatnonzero((pose == p) & sound)
        if len(rows):
            groups.setdefault(tuple(at[rows].sum(axis=1)), []).append(rows)
    return [np.array(rows) for rows in groups.values()]


def reduced(A: Array, prior: Array | None = None) -> Array:
    """A derivative (n, f) of positions in the directions (n, p) that they show.

    `prior` are those of its rows that are a prior, if any.
    """
    if prior is not None and _triangular(prior) and _sure(prior, float(np.linalg.norm(A))):
        return A
    A = A[:, A.any(axis=0)]
    root = triangle(A)
    if len(root) == A.shape[1] and _sure(root, float(np.linalg.norm(root))):
        # columns at right angles lose least
        return np.asarray(solve_triangular(root, A.T, trans=1, check_finite=False).T)
    _, singular, directions = np.linalg.svd(root, full_matrices=False)
    return np.asarray(A @ directions[singular > RANK_TOLERANCE * singular[0]].T)


def diagonal(X: Array) -> bool:
    """Whether a square matrix has nothing beside its diagonal, and nowhere zero on it."""
    return np.count_nonzero(X) == len(X) and bool(np.diagonal(X).all())


def _triangular(X: Array) -> bool:
    """Whether rows are an upper triangle (p, p)."""
    return len(X) == X.shape[1] and (diagonal(X) or not np.tril(X, -1).any())


def _sure(root: Array, size: float) -> bool:
    """Whether rows of some size, among them those of a triangle (p, p), have full rank.

    By a bound on the smallest singular value.
    """
    if diagonal(root):
        inverse, flaw = 1 / np.diagonal(root), 0
    else:
        inverse, flaw = dtrtri(root)
    return flaw == 0 and bool(RANK_TOLERANCE * size * np.linalg.norm(inverse) < 1.0)
