"""Every pose set on a block of robots at once: visits, fits and judgements over the robot axis.

This is done for geometric models fitted by ordinary least squares, robots that arrays can express,
and a tracker whose only errors are noise. Otherwise robots are played one by one, which takes ten
times as long.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.frames import target_points
from calib.geometry.parameters import Parameters
from calib.identification.many.fit import fit_many
from calib.identification.many.points import stated_points
from calib.identification.many.tables import ManyTables, known_to_many
from calib.identification.result import Mode
from calib.information.propagation import point_uncertainty
from calib.uncertainty.regions import inside
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.laboratory.truth.many import ManyTrueRobots
from testbed.streams import stream


def true_robots(owns: Sequence[Laboratory]) -> ManyTrueRobots | None:
    """The robots of some laboratories as arrays; None if they have to be played one by one."""
    first, settings = owns[0], owns[0].scenario.identification
    free = first.free("whitened")
    plain = settings.model == "geometric" and settings.prior is None and settings.loss == "squared"
    if not plain or first.rounds or not first.tracker.steady:
        return None
    if not known_to_many(first.robot.model) or not free.n_free:
        return None
    arms = ManyTrueRobots.of([own.truth for own in owns])
    if arms is not None:
        arms.require_same(first.truth, first.setting.test_q)
    return arms


def numbers_of(own: Laboratory) -> dict[Mode, Parameters]:
    """Free numbers of each estimator of the scenario; by default all that the pool determines."""
    modes = own.scenario.identification.estimators
    return {mode: own.free(mode) if mode == "paper" else own.kept() for mode in modes}


def true_points(arms: ManyTrueRobots, q: Array, target: Array) -> Array:
    """True points (R, t, 3) at q (t, n), visited in turn, without scatter [m]."""
    return target_points(arms.poses(q[None]), target)


def judged(
    owns: Sequence[Laboratory],
    arms: ManyTrueRobots,
    name: str,
    sets: Sequence[Index],
    robots: Sequence[int],
    true: Array,
    free: Mapping[Mode, Parameters],
    same: bool,
) -> Array | None:
    """Mean and rms error, stated u and share inside (4, e, R) of one trial, per estimator.

    Parameters
    ----------
    owns : sequence of Laboratory
        The laboratory of each robot.
    arms : ManyTrueRobots
        Result of `true_robots`.
    name : str
        Name of the trial.
    sets : sequence of (m,) array
        Places in the pool that each robot visits.
    robots : sequence of int
        Numbers of the robots, for the streams.
    true : (R, t, 3) array
        Result of `true_points` [m].
    free : mapping
        Free numbers of each estimator, from `numbers_of`.
    same : bool
        Whether all robots visit the same set.

    Returns
    -------
    (4, e, R) array; None if a fit does not converge, or has no more rows than free numbers.
    """
    own, out = owns[0], []
    tables = _visited(owns, arms, name, sets[:1] if same else sets, robots)
    for mode, parameters in free.items():
        if 6 * tables.seen.shape[2] <= parameters.n_free:
            return None
        fits = fit_many(own.setting.nominal, tables, parameters, mode=mode, shared=same)
        if not fits.converged.all():
            return None
        point, sigma = stated_points(fits, own.setting.test_q[None], own.setting.target)
        error = np.linalg.norm(true - point, axis=2)
        held = inside(true - point, sigma)
        u = np.sqrt(np.mean(point_uncertainty(sigma) ** 2, axis=1))
        rms = np.sqrt(np.mean(error**2, axis=1))
        out.append((error.mean(axis=1), rms, u, held.mean(axis=1)))
    return np.moveaxis(np.array(out), 0, 1)


def _visited(
    owns: Sequence[Laboratory],
    arms: ManyTrueRobots,
    name: str,
    sets: Sequence[Index],
    robots: Sequence[int],
) -> ManyTables:
    """Readings of one visit by each robot, the same as those of `Laboratory.measure_pool`."""
    own, m, seed = owns[0], len(sets[0]), owns[0].scenario.seed
    q = own.pool_q[np.array(sets)]

    def normal(what: str, *shape: int) -> Array:
        rngs = (stream(seed, what, "population", name, robot) for robot in robots)
        return np.array([rng.standard_normal((m, *shape)) for rng in rngs])

    scatter = normal("approach", q.shape[2]) if arms.joint_repeatability.any() else None
    T = arms.poses(q, normal=scatter)
    covariance = own.covariance(q.reshape(-1, q.shape[2])).reshape(-1, m, 6, 6)
    return ManyTables.read(q, *own.tracker.readings(T, normal("tracker", 3, 3)), covariance)
