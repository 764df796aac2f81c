"""What poses not measured yet will leave unknown at the goal: noise, and errors that all share."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.design.blocks import has_full_rank, information
from calib.measurement.noise import whiteners
from testbed.laboratory.bench import Bench
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.scenario.laboratory import At960Tracker


def shared_rows(bench: Bench, q: Array) -> Array:
    """Whitened effect (m, r, k) of each error that all readings of poses q (m, n) share.

    Each in its own standard deviation, as the tracker states them; none if it states none.
    """
    settings, own = bench.scenario.tracker, slice(0, bench.equations)
    if not isinstance(settings, At960Tracker) or not settings.systematic:
        return np.zeros((len(q), bench.equations, 0))
    size = bias_size(settings)
    stated = size.variance > 0
    if not len(q):
        return np.zeros((0, bench.equations, int(stated.sum())))
    T, tracker = bench.robot.model.poses(q), bench.tracker
    B = size.sensitivity(tracker.targets(T), T[:, :3, :3], tracker.T_world_tracker)[:, own, stated]
    whitener = whiteners(bench.covariance(q)[:, own, own])
    return np.asarray(whitener @ (B * np.sqrt(size.variance[stated])))


@dataclass(frozen=True, slots=True, eq=False)
class GoalU:
    """3-D standard uncertainty of the tool point at the goal, k = 1, in its two parts."""

    noise: Array
    """(g,) from what scatters anew at each reading [m]."""
    shared: Array
    """(g,) from what all readings share, which more poses hardly lower [m]."""

    @property
    def whole(self) -> Array:
        """(g,) both together [m]."""
        return np.hypot(self.noise, self.shared)


def goal_u(M: Array, rows: Array) -> GoalU:
    """Uncertainty at the goal, rows (g, 3, p) [m], from sums of products M (p + k, p + k).

    Parameters
    ----------
    M : (p + k, p + k) array
        Of all whitened rows [A, B]: information of the numbers, and the k errors in common.
    rows : (g, 3, p) array
        Tool point per scaled number [m].

    References
    ----------
    JCGM 102:2011, 6.2: y = J x has covariance J C J'; here C = M^-1, and u^2 = tr(J M^-1 J') adds
    the variances of the three coordinates. Errors in common move the estimate by M^-1 A'B.
    """
    g, _, p = rows.shape
    lower = np.linalg.cholesky(M[:p, :p])
    half = np.linalg.solve(lower, rows.reshape(-1, p).T)
    moved = half.T @ np.linalg.solve(lower, M[:p, p:])
    squares = (half**2).sum(axis=0), (moved**2).sum(axis=1)
    return GoalU(*(np.sqrt(square.reshape(g, 3).sum(axis=1)) for square in squares))


def goal_uncertainty(blocks: Array, goal: Array) -> Array:
    """The whole (g,) after measuring whitened blocks (m, r, p + k); goal (g, 3, p) [m].

    Infinite if the rows leave a number undetermined.
    """
    if not has_full_rank(blocks[:, :, : goal.shape[2]].reshape(-1, goal.shape[2])):
        return np.full(len(goal), np.inf)
    return goal_u(information(blocks), goal).whole
