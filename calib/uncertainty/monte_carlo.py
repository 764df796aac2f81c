"""Monte Carlo uncertainty of the tool point: the paper's form, and the correlated 3-D form."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.arrays import Array, check, frozen, require_probability
from calib.errors import refuse
from calib.geometry.model import RobotModel
from calib.information.propagation import point_uncertainty, tool_covariance
from calib.kinds import checked_kinds
from calib.shown import Shown, length_words, mean_of
from calib.uncertainty.covariance import checked, covariance_factor, drawn
from calib.uncertainty.covariance import correlated_draws as correlated_draws
from calib.uncertainty.covariance import independent_draws as independent_draws
from calib.uncertainty.point_loops import PASS, PointLoop
from calib.uncertainty.tool_point import propagate as propagate

DRAWS = 10_000
"""M of the paper; leaves 0.7 % in a standard uncertainty."""
POSE_BLOCK, VALUES = 64, 4_000_000
"""Poses whose draws are held at once where ranges and quantiles need all of them: the fewer, the
more draws there are, but never fewer than 8."""


@dataclass(frozen=True, slots=True, eq=False)
class DistanceSpread(Shown):
    """The paper's statement about N postures: scatter of ``|P|``, parameters independent."""

    draws: int
    """M."""
    nominal: Array
    """(N,) ``|P|`` of the model itself [m]."""
    mean: Array
    """(N,) mean of ``|P|`` [m]."""
    standard: Array
    """(N,) standard deviation of ``|P|``: the paper's u_g [m]."""
    extremes: Array
    """(N, 2) smallest and largest ``|P|`` [m]."""
    interval: Array
    """(N, 2) ends of the interval with equal tails [m]."""
    linear_interval: Array
    """(N, 2) the same of ``|P|`` made linear in the parameters, on the same draws [m]."""
    linear: Array
    """(N,) standard uncertainty of ``|P|`` by linear propagation, without draws [m]."""
    axis_standard: Array
    """(N, 3) standard deviations of x, y, z [m]: what ``|P|`` does not show."""
    axis_extremes: Array
    """(N, 3, 2) smallest and largest deviation of x, y, z from nominal [m]."""

    def __repr__(self) -> str:
        u = length_words(mean_of(self.standard), um=".3g")
        return f"DistanceSpread({len(self.standard)} postures, mean u of |P| {u})"

    @property
    def point(self) -> Array:
        """(N,) sqrt(u_x^2 + u_y^2 + u_z^2) [m]."""
        return np.asarray(np.sqrt(np.square(self.axis_standard).sum(axis=-1)))

    @property
    def nonlinearity(self) -> Array:
        """(N,) larger gap between the interval ends, exact and linear, on the same draws [m].

        The sampling error cancels in the pair. Below `numerical_tolerance` of u, linear propagation
        is validated (JCGM 101:2008, clause 8).
        """
        return np.asarray(np.abs(self.interval - self.linear_interval).max(axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class PointSpread(Shown):
    """Scatter of the tool point at N postures, correlations included, beside linear propagation."""

    draws: int
    """M."""
    nominal: Array
    """(N, 3) tool point of the model itself, in the world [m]."""
    shift: Array
    """(N, 3) mean minus nominal, sampling error of the linear part removed [m]."""
    covariance: Array
    """(N, 3, 3) plain sample covariance [m^2]."""
    linear: Array
    """(N, 3, 3) J C J' [m^2]."""
    controlled: Array
    """(N, 3, 3) linear + sample covariance - sample covariance of the linear part [m^2].

    The linear part of the same draws is the control variate: a thousand draws give u to about 1e-6.
    """
    worst_remainder: Array
    """(N,) largest ``|exact - linear|`` of the first 10 000 draws, in units of the linear u_3D."""

    def __repr__(self) -> str:
        u = length_words(mean_of(self.point), um=".3g")
        return f"PointSpread({len(self.nominal)} postures, {self.draws} draws, mean u {u})"

    @property
    def point(self) -> Array:
        """(N,) u_3D from the controlled covariance [m]."""
        return point_uncertainty(self.controlled)

    @property
    def linear_point(self) -> Array:
        """(N,) u_3D from linear propagation [m]."""
        return point_uncertainty(self.linear)

    @property
    def largest_difference(self) -> float:
        """Largest difference from linear propagation, in mean or u, in units of u_3D."""
        u = self.linear_point
        gaps = np.stack([np.linalg.norm(self.shift, axis=-1), np.abs(self.point - u)])
        return float(_in_units(gaps, u).max())


@checked_kinds
def distance_spread(
    model: RobotModel,
    q: ArrayLike,
    standard: ArrayLike,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
    probability: float = 0.95,
) -> DistanceSpread:
    """Scatter of the distance of the tool point for independent parameters: the paper's form.

    Two things make it differ from what the tool point really does: the distance shows the radial
    direction only (too small), and the correlations of the parameters are dropped (too large).

    Parameters
    ----------
    model : RobotModel
        Robot whose numbers are the means.
    q : (N, n) array_like
        Commanded joint values [rad, m].
    standard : (P,) array_like
        Standard uncertainty of every number, zero where fixed [m, rad].
    rng : numpy.random.Generator
        Source of the draws.
    draws : int
        M.
    probability : float
        Content of the intervals.

    References
    ----------
    Wen et al. 2022, with g = sqrt(Px^2 + Py^2 + Pz^2); the squares are missing in print.
    """
    standard, q = check(f"{model.n_numbers}, N {model.chain.n_joints}", standard=standard, q=q)
    if not len(q):
        raise refuse("q", 0, "at least one posture", code="A1", message="q has no postures")
    steps = independent_draws(standard, draws, rng)
    moving = np.flatnonzero(standard)
    require_probability(probability)
    tails = [(1 - probability) / 2, (1 + probability) / 2]
    T, J = model.poses_and_jacobian(q)
    nominal = T[:, :3, 3]
    distance = np.linalg.norm(nominal, axis=-1)
    if not (distance > 0).all():
        message = f"tool point {int(np.argmin(distance))} lies in the origin"
        allowed = "postures whose distance from the world origin is not zero"
        raise refuse("q", allowed=allowed, code="A3", message=message)
    radial = nominal / distance[:, None]
    slope = np.einsum("ni,nip->np", radial, J[:, :3, moving])  # d|P| / d parameter
    rows: list[tuple[Array, ...]] = []
    size = min(POSE_BLOCK, max(8, VALUES // draws))
    for start in range(0, len(nominal), size):
        part = slice(start, start + size)
        some, there = q[part], nominal[part]
        loop = PointLoop.of(model, some, there, -(-draws * len(nominal) // len(some)))
        deviation = np.empty((3, draws, len(some)))
        for these, points in loop.deviations(steps):
            deviation[:, these] = points
        g = np.sqrt(sum(np.square(e + p) for e, p in zip(deviation, there.T, strict=True)))
        straight = steps[:, moving] @ slope[part].T
        rows.append(
            (
                g.mean(axis=0),
                g.std(axis=0, ddof=1),
                np.stack([g.min(axis=0), g.max(axis=0)], -1),
                np.quantile(g, tails, axis=0).T,
                distance[part, None] + np.quantile(straight, tails, axis=0).T,
                deviation.std(axis=1, ddof=1).T,
                np.stack([deviation.min(axis=1), deviation.max(axis=1)], -1).swapaxes(0, 1),
            )
        )
    mean, sd, extremes, interval, straight_interval, axis_sd, axis_extremes = (
        frozen(np.concatenate(column)) for column in zip(*rows, strict=True)
    )
    return DistanceSpread(
        draws=draws,
        nominal=frozen(distance),
        mean=mean,
        standard=sd,
        extremes=extremes,
        interval=interval,
        linear_interval=straight_interval,
        linear=frozen(np.linalg.norm(slope * standard[moving], axis=-1)),
        axis_standard=axis_sd,
        axis_extremes=axis_extremes,
    )


@checked_kinds
def point_spread(
    model: RobotModel,
    q: ArrayLike,
    covariance: ArrayLike,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
) -> PointSpread:
    """Mean and covariance of the tool point at joints q (N, n) for correlated parameters.

    Moments are gathered batch by batch; memory does not grow with draws times poses.

    Parameters
    ----------
    model : RobotModel
        Robot whose numbers are the means.
    q : (N, n) array_like
        Commanded joint values [rad, m].
    covariance : (P, P) array_like
        Of the full parameter vector, zero for fixed numbers [m, rad].
    rng : numpy.random.Generator
        Source of the draws.
    draws : int
        M.

    References
    ----------
    JCGM 101:2008, clause 7; linear result as control variate.
    """
    (covariance,) = check(f"{model.n_numbers} {model.n_numbers}", covariance=covariance)
    linear = tool_covariance(model, q, covariance)[:, :3, :3]
    L = covariance_factor(covariance)
    moving = np.flatnonzero(L.any(axis=1))
    T, J = model.poses_and_jacobian(q)
    nominal, slope = T[:, :3, 3], J[:, :3, moving]
    loop = PointLoop.of(model, np.asarray(q, dtype=np.float64), nominal, checked(draws))
    first, second = np.zeros(len(moving)), np.zeros((len(moving),) * 2)
    worst = np.zeros(len(nominal))
    size = PASS if loop.compiled else DRAWS
    for start in range(0, draws, size):
        steps = drawn(L, min(size, draws - start), rng)
        own = steps[:, moving]
        first += own.sum(axis=0)
        second += own.T @ own
        for part, exact in loop.deviations(steps):
            if start >= DRAWS:
                continue
            straight = np.moveaxis(slope @ own[part].T, 0, -1)
            worst = np.maximum(worst, np.square(exact - straight).sum(axis=0).max(axis=0))
    mean, spread = loop.moments(draws)
    # the linear part of the same draws, from their own moments
    center = first / draws
    scatter = (second - draws * np.outer(center, center)) / (draws - 1)
    return PointSpread(
        draws=draws,
        nominal=frozen(nominal),
        shift=frozen(mean - slope @ center),
        covariance=frozen(spread),
        linear=frozen(linear),
        controlled=frozen(linear + spread - slope @ scatter @ np.swapaxes(slope, 1, 2)),
        worst_remainder=frozen(_in_units(np.sqrt(worst), point_uncertainty(linear))),
    )


def numerical_tolerance(standard: float, digits: int = 2) -> float:
    """Half a unit in the last of `digits` significant digits of a standard uncertainty.

    References
    ----------
    JCGM 101:2008, 7.9.2: u = c 10^l with c of `digits` digits; delta = 10^l / 2.
    """
    if not standard > 0:
        raise refuse("standard", standard, "a standard uncertainty above zero", code="A3")
    return float(0.5 * 10.0 ** (np.floor(np.log10(standard)) - (digits - 1)))


def _in_units(values: Array, u: Array) -> Array:
    """Values (..., N) over u (N,); nothing counts as nothing where there is no uncertainty."""
    u = np.broadcast_to(u, values.shape)
    return np.divide(values, u, out=np.zeros_like(values), where=u > 0)
